//! A clear coat above a surface, of the index of refraction 1.5. Twin of `bsdf/clearcoat.glsl`.

use super::{super::microfacet::grazing_weight, albedo::ggx_albedo};

/// Reflectance along the normal, of the index 1.5.
const CLEARCOAT_REFLECTANCE: f32 = 0.04;

pub fn clearcoat_fresnel(cosine: f32) -> f32 {
    let weight = grazing_weight(cosine);
    CLEARCOAT_REFLECTANCE * (1.0 - weight) + weight
}

/// The share of light that a whole coat reflects. `roughness`: as in [`ggx_albedo`].
pub fn clearcoat_albedo(cosine: f32, roughness: f32) -> f32 {
    let albedo = ggx_albedo(cosine, roughness);
    CLEARCOAT_REFLECTANCE * (1.0 - albedo.loss - albedo.grazing) + albedo.grazing
}
