//! The light that bounces between microfacets more than once, and the light below a dielectric's microfacets. Twin of
//! `bsdf/multiple_scattering.glsl`, which names the sources.

use glam::Vec3;

/// Returns the mean of a Fresnel term F0 + (F90 - F0) (1 - cosine)^5 over the hemisphere, weighted by the cosine.
pub fn mean_reflectance(at_normal: Vec3, at_grazing: Vec3) -> Vec3 {
    at_normal + (at_grazing - at_normal) / 21.0
}

/// The share that leaves the microfacets after more than one bounce, of the light that a first bounce does not bring
/// out. `reflectance`: the mean one. `loss`: the mean share that a bounce does not bring out.
pub fn later_bounces(reflectance: Vec3, loss: f32) -> Vec3 {
    reflectance * reflectance * (1.0 - loss) / (1.0 - reflectance * loss)
}
