//! The sheen of cloth, whose fibres stand upright. Directions are in the frame of the surface. Twin of
//! `bsdf/sheen.glsl`, which names the source.

use std::f32::consts::PI;

use glam::{FloatExt, Vec2, Vec3, Vec3Swizzles};

use crate::reference::turns::sin_cos_of_turns;

/// Pdf of the fibres' normals. `width`: of the distribution.
fn sheen_distribution(half_vector: Vec3, width: f32) -> f32 {
    let sine = half_vector.xy().dot(half_vector.xy()).clamp(0.0, 1.0).sqrt();
    (2.0 + 1.0 / width) * sine.max(1.0e-6).powf(1.0 / width) / (2.0 * PI)
}

/// The fit of Estevez and Kulla: its constants are for the widths 0 and 1.
fn sheen_exponent(cosine: f32, width: f32) -> f32 {
    let weight = (1.0 - width) * (1.0 - width);
    let (a, b) = (21.5473_f32.lerp(25.3245, weight), 3.82987_f32.lerp(3.32435, weight));
    let (c, d) = (0.19823_f32.lerp(0.16801, weight), (-1.97760_f32).lerp(-1.27393, weight));
    let e = (-4.32054_f32).lerp(-4.85967, weight);
    a / (1.0 + b * cosine.max(1.0e-6).powf(c)) + d * cosine + e
}

/// Smith's Lambda of the distribution.
fn sheen_lambda(cosine: f32, width: f32) -> f32 {
    if cosine < 0.5 {
        return sheen_exponent(cosine, width).exp();
    }
    (2.0 * sheen_exponent(0.5, width) - sheen_exponent(1.0 - cosine, width)).exp()
}

/// The factor that keeps the albedo at or below 1. `albedo`: of the model.
pub fn sheen_bound(albedo: f32) -> f32 {
    1.0 / albedo.max(1.0)
}

/// The reflectance times the light's cosine, for a sheen of reflectance 1, without the bound.
pub fn evaluate_sheen(to_viewer: Vec3, to_light: Vec3, roughness: f32) -> f32 {
    let width = roughness * roughness;
    let half_vector = (to_viewer + to_light).normalize();
    let shadowing = 1.0 + sheen_lambda(to_viewer.z, width) + sheen_lambda(to_light.z, width);
    sheen_distribution(half_vector, width) / (shadowing * 4.0 * to_viewer.z)
}

/// Returns a direction of the hemisphere, all alike.
pub fn sample_sheen(u: Vec2) -> Vec3 {
    let (radius, (sine, cosine)) = ((1.0 - u.x * u.x).max(0.0).sqrt(), sin_cos_of_turns(u.y));
    Vec3::new(radius * cosine, radius * sine, u.x)
}

pub fn sheen_pdf(to_light: Vec3) -> f32 {
    if to_light.z > 0.0 { 0.5 / PI } else { 0.0 }
}
