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
    let y = 8.5227442 + Vec4::new(-10.963147, 79.872063, -232.42944, 17.419209).dot(powers) + 210.4131 * fifth;
    let y =
        y * z + -20.575962 + Vec4::new(37.890228, -249.74614, 771.74255, -597.86566).dot(powers) + -41.687645 * fifth;
    let y = y * z + 15.525029 + Vec4::new(-40.795704, 236.88469, -706.77136, 706.883).dot(powers) + -155.20528 * fifth;
    let y = y * z + -4.2633696 + Vec4::new(17.504826, -85.484901, 228.00821, -237.29614).dot(powers) + 67.25351 * fifth;
    let y =
        y * z + 0.78486699 + Vec4::new(-3.3760931, 14.595876, -33.455288, 38.245049).dot(powers) + -13.047832 * fifth;
    let y = y * z
        + -0.021635758
        + Vec4::new(0.20264785, -0.82070565, 1.5798448, -1.3904365).dot(powers)
        + 0.45798045 * fifth;
    y
}

fn grazing_polynomial(z: f32, powers: Vec4, fifth: f32) -> f32 {
    let y = 43.237442 + Vec4::new(-688.62921, 2864.2729, -5492.8657, 5023.2246).dot(powers) + -1638.3431 * fifth;
    let y =
        y * z + -98.257233 + Vec4::new(1623.2207, -6962.7178, 13274.707, -12001.156).dot(powers) + 4049.2202 * fifth;
    let y =
        y * z + 78.186623 + Vec4::new(-1303.4658, 5784.9307, -11117.942, 9912.4473).dot(powers) + -3318.6135 * fifth;
    let y = y * z + -24.997671 + Vec4::new(405.41129, -1829.0001, 3588.5264, -3229.603).dot(powers) + 1082.3663 * fifth;
    let y =
        y * z + 2.3397923 + Vec4::new(-41.212421, 180.50139, -338.95181, 304.03543).dot(powers) + -102.57932 * fifth;
    let y =
        y * z + -0.00194966 + Vec4::new(-1.1703906, -6.7782693, 19.844473, -19.539381).dot(powers) + 6.6895761 * fifth;
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
    let loss =
        -0.0012865789 + Vec4::new(-0.01124437, 0.44400364, 2.6509104, -3.9033575).dot(powers) + 1.4113265 * fifth;
    let change = 0.01249467 + Vec4::new(0.12266012, -2.301764, 6.0072041, -5.9807024).dot(powers) + 2.0946815 * fifth;
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
