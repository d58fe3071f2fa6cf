//! Diffuse reflection: the same radiance in all directions. Directions are in the frame of the surface. Twin of
//! `bsdf/lambert.glsl`.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use crate::reference::turns::sin_cos_of_turns;

/// Returns a direction with a pdf in proportion to its cosine.
pub fn sample_lambert(u: Vec2) -> Vec3 {
    let (radius, (sine, cosine)) = (u.x.sqrt(), sin_cos_of_turns(u.y));
    Vec3::new(radius * cosine, radius * sine, (1.0 - u.x).max(0.0).sqrt())
}

pub fn lambert_pdf(to_light: Vec3) -> f32 {
    to_light.z.max(0.0) / PI
}

/// The reflectance towards any viewer, times the cosine.
pub fn evaluate_lambert(reflectance: Vec3, to_light: Vec3) -> Vec3 {
    reflectance * (to_light.z.max(0.0) / PI)
}
