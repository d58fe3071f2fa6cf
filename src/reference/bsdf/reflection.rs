//! Reflection by microfacets. Directions are in the frame of the surface. Twin of `bsdf/reflection.glsl`.

use glam::Vec3;

use super::ggx::{ggx_distribution, ggx_visibility, ggx_visible_pdf};

/// Returns the direction that a microfacet of this normal reflects to the viewer.
pub fn reflected_by(to_viewer: Vec3, half_vector: Vec3) -> Vec3 {
    2.0 * to_viewer.dot(half_vector) * half_vector - to_viewer
}

/// The reflectance times the light's cosine, for a Fresnel term of 1.
pub fn evaluate_reflection(to_viewer: Vec3, to_light: Vec3, half_vector: Vec3, width: f32) -> f32 {
    let visibility = ggx_visibility(to_viewer.z, to_light.z, width);
    0.25 * ggx_distribution(half_vector, width) * visibility
}

/// Pdf of the light's direction, per steradian, if a visible normal reflects it.
pub fn reflection_pdf(to_viewer: Vec3, half_vector: Vec3, width: f32) -> f32 {
    0.25 * ggx_visible_pdf(to_viewer, half_vector, width)
}
