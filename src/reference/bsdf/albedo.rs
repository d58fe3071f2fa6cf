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

#[rustfmt::skip]
fn loss_polynomial(z: f32, powers: Vec4) -> f32 {
    let y = 1.8103135 + Vec4::new(17.644272, -48.685867, 54.702972, -79.665092).dot(powers);
    let y = y * z + -3.1318867 + Vec4::new(-32.687866, 106.18821, -128.7383, 117.78883).dot(powers);
    let y = y * z + 1.0895424 + Vec4::new(14.451166, -50.563808, 62.125889, -48.548805).dot(powers);
    let y = y * z + 0.27177879 + Vec4::new(0.053681884, -1.788789, 7.0341892, 0.087344877).dot(powers);
    let y = y * z + 0.0019733009 + Vec4::new(0.020006094, -0.085017398, 0.11722442, -0.032452136).dot(powers);
    y
}

#[rustfmt::skip]
fn grazing_polynomial(z: f32, powers: Vec4) -> f32 {
    let y = 0.17026286 + Vec4::new(-40.135624, 71.991638, 29.312443, -7.0983129).dot(powers);
    let y = y * z + -0.99493665 + Vec4::new(91.650658, -287.85217, 151.4442, 35.913036).dot(powers);
    let y = y * z + 1.1559658 + Vec4::new(-52.552502, 241.3324, -300.06158, 90.341942).dot(powers);
    let y = y * z + -0.54141819 + Vec4::new(4.3573852, -17.462431, 40.811142, -18.658777).dot(powers);
    let y = y * z + 0.17344359 + Vec4::new(-3.660898, 4.5660009, -2.5668268, 0.53247041).dot(powers);
    y
}

/// `roughness`: square root of the distribution's width; 0 if the surface is perfectly smooth.
pub fn ggx_albedo(cosine: f32, roughness: f32) -> GgxAlbedo {
    let powers = roughness_powers(roughness);
    let z = cosine / (cosine + 2.0 * powers.y);
    let x = (1.0 - cosine).clamp(0.0, 1.0);
    let loss = ((1.0 - z) * loss_polynomial(z, powers)).clamp(0.0, 0.9);
    let smooth_grazing = x * x * x * x * x;
    let grazing = smooth_grazing + (1.0 - z) * grazing_polynomial(z, powers);
    GgxAlbedo { loss, grazing: grazing.clamp(0.0001, 1.0 - loss) }
}

/// The mean of [`ggx_albedo`] over the hemisphere, weighted by the cosine.
pub fn mean_ggx_albedo(roughness: f32) -> GgxAlbedo {
    let powers = roughness_powers(roughness);
    let loss = roughness * (0.012756904 + Vec4::new(-0.24498497, 1.8110416, -0.72292089, -0.26957878).dot(powers));
    let change = -0.0036951823 + Vec4::new(-0.0077142245, -0.72144741, 1.3787318, -0.69522977).dot(powers);
    let grazing = 1.0 / 21.0 + roughness * change;
    GgxAlbedo { loss: loss.max(0.0), grazing }
}

/// Of the sheen of reflectance 1. `roughness`: at least [`crate::layout::LEAST_SHEEN_ROUGHNESS`].
#[rustfmt::skip]
pub fn sheen_albedo(cosine: f32, roughness: f32) -> f32 {
    let powers = roughness_powers(roughness);
    let z = (1.0 - cosine).clamp(0.0, 1.0);
    let y = 23.986086 + Vec4::new(-119.28143, 200.94769, -151.67065, 43.763714).dot(powers);
    let y = y * z + -64.226761 + Vec4::new(329.45627, -557.09039, 422.47842, -122.59611).dot(powers);
    let y = y * z + 68.012299 + Vec4::new(-360.90784, 617.33014, -473.15115, 138.55827).dot(powers);
    let y = y * z + -34.929424 + Vec4::new(193.87425, -337.08887, 260.95612, -76.759003).dot(powers);
    let y = y * z + 11.257267 + Vec4::new(-64.440125, 116.21407, -91.912369, 27.265678).dot(powers);
    let y = y * z + -2.5927036 + Vec4::new(18.825815, -38.398308, 33.545334, -10.854482).dot(powers);
    let y = y * z + 0.08693248 + Vec4::new(-1.1865282, 4.6127133, -4.6773009, 1.5656458).dot(powers);
    let y = y.max(0.01);
    y * y
}
