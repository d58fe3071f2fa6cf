//! Directional albedos: the share of the light from one direction that a lobe reflects. Twin of `bsdf/albedo.glsl`.

use glam::Vec4;

/// Of reflection by GGX, at one cosine. So a Fresnel term F0 + (F90 - F0) (1 - V.H)^5 reflects
/// F0 (1 - loss - grazing) + F90 grazing.
#[derive(Clone, Copy, Debug)]
pub struct GgxAlbedo {
    /// The share of light that is not reflected although the Fresnel term is 1, because it meets further microfacets.
    pub loss: f32,
    /// The share that is reflected if the Fresnel term is Schlick's weight (1 - V.H)^5.
    pub grazing: f32,
}

/// Powers 1 to 4 of the roughness.
fn roughness_powers(roughness: f32) -> Vec4 {
    let squared = roughness * roughness;
    Vec4::new(roughness, squared, squared * roughness, squared * squared)
}

fn loss_polynomial(z: f32, powers: Vec4, fifth: f32) -> f32 {
    let y = 10.795775 + Vec4::new(-16.239405, 51.006134, -202.83482, 78.299561).dot(powers) + 161.27727 * fifth;
    let y =
        y * z + -26.562994 + Vec4::new(49.515839, -153.49359, 573.59247, -562.10712).dot(powers) + 9.8753901 * fifth;
    let y = y * z + 21.523111 + Vec4::new(-54.38987, 151.65544, -468.54492, 543.95184).dot(powers) + -135.23792 * fifth;
    let y =
        y * z + -7.1015534 + Vec4::new(27.680758, -71.783775, 157.78279, -171.56929).dot(powers) + 50.612175 * fifth;
    let y =
        y * z + 1.3948812 + Vec4::new(-6.7729173, 20.076412, -35.698917, 37.305031).dot(powers) + -12.584991 * fifth;
    let y = y * z
        + -0.065100223
        + Vec4::new(0.53698862, -1.8196399, 3.0541897, -2.4706855).dot(powers)
        + 0.77343577 * fifth;
    y
}

fn grazing_polynomial(z: f32, powers: Vec4, fifth: f32) -> f32 {
    let y = -15.311678 + Vec4::new(77.970711, -616.11096, 1457.0963, -1220.7534).dot(powers) + 398.43201 * fifth;
    let y = y * z + 34.28347 + Vec4::new(-95.196609, 811.09833, -2338.3191, 2226.7793).dot(powers) + -709.02826 * fifth;
    let y =
        y * z + -27.839417 + Vec4::new(41.735516, -209.92664, 854.85785, -1024.0162).dot(powers) + 378.24075 * fifth;
    let y = y * z + 10.974108 + Vec4::new(-33.234219, 68.285072, -130.46713, 134.6618).dot(powers) + -53.064407 * fifth;
    let y =
        y * z + -2.5162318 + Vec4::new(13.853616, -45.667526, 88.942169, -74.077003).dot(powers) + 23.311783 * fifth;
    let y = y * z
        + 0.26436004
        + Vec4::new(-4.1400652, 5.2931671, -2.6391835, -0.070078336).dot(powers)
        + 0.33687666 * fifth;
    y
}

/// `roughness`: square root of the distribution's width; 0 if the surface is perfectly smooth.
pub fn ggx_albedo(cosine: f32, roughness: f32) -> GgxAlbedo {
    let powers = roughness_powers(roughness);
    let fifth = roughness * powers.w;
    let z = cosine / (cosine + powers.y);
    let x = (1.0 - cosine).clamp(0.0, 1.0);
    let loss = ((1.0 - z) * loss_polynomial(z, powers, fifth)).clamp(0.0, 0.9);
    let smooth_grazing = x * x * x * x * x;
    let grazing = smooth_grazing + (1.0 - z) * grazing_polynomial(z, powers, fifth);
    GgxAlbedo { loss, grazing: grazing.clamp(0.0001, 1.0 - loss) }
}

/// The mean of [`ggx_albedo`] over the hemisphere, weighted by the cosine.
pub fn mean_ggx_albedo(roughness: f32) -> GgxAlbedo {
    let powers = roughness_powers(roughness);
    let fifth = roughness * powers.w;
    let loss = 0.000210142 + Vec4::new(-0.036332227, 0.48725173, 2.7229965, -4.1021533).dot(powers) + 1.5190759 * fifth;
    let change = -0.030435629 + Vec4::new(0.54656982, -3.856077, 8.7369375, -8.3240175).dot(powers) + 2.8850048 * fifth;
    GgxAlbedo { loss: (roughness * loss).max(0.0), grazing: 1.0 / 21.0 + roughness * change }
}

/// Of the sheen of reflectance 1. `roughness`: at least [`crate::layout::LEAST_SHEEN_ROUGHNESS`].
pub fn sheen_albedo(cosine: f32, roughness: f32) -> f32 {
    let powers = roughness_powers(roughness);
    let z = (1.0 - cosine).clamp(0.0, 1.0);
    let y = 24.152172 + Vec4::new(-120.4353, 203.7431, -154.49158, 44.784389).dot(powers);
    let y = y * z + -64.693489 + Vec4::new(332.72348, -565.05505, 430.55728, -125.53234).dot(powers);
    let y = y * z + 68.502266 + Vec4::new(-364.3663, 625.81909, -481.81183, 141.72218).dot(powers);
    let y = y * z + -35.167366 + Vec4::new(195.56726, -341.27466, 265.25433, -78.338684).dot(powers);
    let y = y * z + 11.311654 + Vec4::new(-64.828766, 117.18, -92.910378, 27.634874).dot(powers);
    let y = y * z + -2.5980201 + Vec4::new(18.863771, -38.492477, 33.642723, -10.890631).dot(powers);
    let y = y * z + 0.087039657 + Vec4::new(-1.1872613, 4.6144295, -4.6789732, 1.5662416).dot(powers);
    let y = y.max(0.01);
    y * y
}
