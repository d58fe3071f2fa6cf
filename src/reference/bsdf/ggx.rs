//! Distribution and visibility of the normals of microfacets: GGX. Directions are in the frame of the surface. Twin of
//! `bsdf/ggx.glsl`, which names the sources.

use std::f32::consts::PI;

use glam::{Vec2, Vec3, Vec3Swizzles};

use crate::reference::turns::sin_cos_of_turns;

/// Pdf of normals, per steradian and area of the surface. `half_vector.z` is at least 0.
pub fn ggx_distribution(half_vector: Vec3, width: f32) -> f32 {
    let squared = width * width;
    let spread = half_vector.xy().dot(half_vector.xy()) + half_vector.z * half_vector.z * squared;
    squared / (PI * spread * spread)
}

/// The part of Smith's terms that depends on one direction: its cosine, times 1 + 2 Lambda.
pub fn ggx_root(cosine: f32, width: f32) -> f32 {
    let squared = width * width;
    (cosine * cosine * (1.0 - squared) + squared).sqrt()
}

/// Pdf of visible normals per steradian, divided by the cosine between the viewer and the normal.
pub fn ggx_visible_pdf(to_viewer: Vec3, half_vector: Vec3, width: f32) -> f32 {
    ggx_distribution(half_vector, width) * 2.0 / (to_viewer.z + ggx_root(to_viewer.z, width))
}

/// Masking and shadowing together, divided by the viewer's cosine. `cos_light`: unsigned.
pub fn ggx_visibility(cos_viewer: f32, cos_light: f32, width: f32) -> f32 {
    let sum = cos_light * ggx_root(cos_viewer, width) + cos_viewer * ggx_root(cos_light, width);
    2.0 * cos_light / sum
}

/// Returns a visible normal.
pub fn sample_ggx(to_viewer: Vec3, width: f32, u: Vec2) -> Vec3 {
    let stretched = (width * to_viewer.xy()).extend(to_viewer.z).normalize();
    let z = (1.0 - u.y) * (1.0 + stretched.z) - stretched.z;
    let (radius, (sine, cosine)) = ((1.0 - z * z).clamp(0.0, 1.0).sqrt(), sin_cos_of_turns(u.x));
    let normal = Vec3::new(radius * cosine, radius * sine, z) + stretched;
    (width * normal.xy()).extend(normal.z.max(0.0)).normalize()
}
