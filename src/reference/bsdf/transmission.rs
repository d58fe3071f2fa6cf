//! Refraction by the microfacets of a solid's boundary. Directions are in the frame of the surface, and the viewer's is
//! on the side of the normal. Twin of `bsdf/transmission.glsl`.
//!
//! `eta`: index of refraction on the viewer's side divided by that of the other side.

use glam::Vec3;

use super::{
    super::fresnel::refraction_cosine,
    ggx::{ggx_distribution, ggx_visibility, ggx_visible_pdf},
};

/// Returns the direction that a microfacet of this normal refracts to the viewer. There must be no total reflection.
pub fn refracted_by(to_viewer: Vec3, half_vector: Vec3, eta: f32) -> Vec3 {
    let cosine = to_viewer.dot(half_vector);
    let bend = eta * cosine - refraction_cosine(cosine, eta);
    (bend * half_vector - eta * to_viewer).normalize()
}

/// Returns the normal, on the viewer's side, of the microfacets that refract the one direction into the other.
pub fn refracting_normal(to_viewer: Vec3, to_light: Vec3, eta: f32) -> Vec3 {
    let normal = (eta * to_viewer + to_light).normalize();
    if normal.z < 0.0 { -normal } else { normal }
}

/// Whether each direction is on the same side of the microfacet as of the surface.
pub fn refracts_between(to_viewer: Vec3, to_light: Vec3, half_vector: Vec3) -> bool {
    to_viewer.dot(half_vector) > 0.0 && to_light.dot(half_vector) < 0.0
}

/// Jacobian of refraction: the factor by which the pdf of a normal becomes the pdf of the light's direction.
pub fn refraction_jacobian(to_viewer: Vec3, to_light: Vec3, half_vector: Vec3, eta: f32) -> f32 {
    let cos_light = to_light.dot(half_vector);
    let sum = cos_light + eta * to_viewer.dot(half_vector);
    cos_light.abs() / (sum * sum)
}

/// The transmittance times the light's cosine, if the microfacets let all light pass.
pub fn evaluate_refraction(to_viewer: Vec3, to_light: Vec3, half_vector: Vec3, width: f32, eta: f32) -> f32 {
    let visibility = ggx_visibility(to_viewer.z, to_light.z.abs(), width) * ggx_distribution(half_vector, width);
    let cos_viewer = to_viewer.dot(half_vector);
    eta * eta * visibility * cos_viewer * refraction_jacobian(to_viewer, to_light, half_vector, eta)
}

/// Pdf of the light's direction, per steradian, if a visible normal refracts it.
pub fn refraction_pdf(to_viewer: Vec3, to_light: Vec3, half_vector: Vec3, width: f32, eta: f32) -> f32 {
    let of_normal = ggx_visible_pdf(to_viewer, half_vector, width) * to_viewer.dot(half_vector);
    of_normal * refraction_jacobian(to_viewer, to_light, half_vector, eta)
}
