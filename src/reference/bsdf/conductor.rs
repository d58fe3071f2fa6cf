//! Exact reflectance of a smooth metal in air for unpolarized light. Twin of `bsdf/conductor.glsl`.

use glam::Vec3;

/// Returns the reflectance of a metal of the index of refraction `eta` + i `k`, by colour.
pub fn conductor_reflectance(cosine: f32, eta: Vec3, k: Vec3) -> Vec3 {
    let cos_squared = (cosine * cosine).clamp(0.0, 1.0);
    let sin_squared = 1.0 - cos_squared;
    let difference = eta * eta - k * k - sin_squared;
    let sum = (difference * difference + 4.0 * eta * eta * k * k).map(f32::sqrt);
    let a = (0.5 * (sum + difference)).max(Vec3::ZERO).map(f32::sqrt);
    let perpendicular = (sum + cos_squared - 2.0 * a * cosine) / (sum + cos_squared + 2.0 * a * cosine);
    let even = cos_squared * sum + sin_squared * sin_squared;
    let odd = 2.0 * a * (cosine * sin_squared);
    let parallel = perpendicular * (even - odd) / (even + odd).max(Vec3::splat(1.0e-20));
    (0.5 * (perpendicular + parallel)).clamp(Vec3::ZERO, Vec3::ONE)
}
