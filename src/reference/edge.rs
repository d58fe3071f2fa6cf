//! What the passes of the noise filter `edge` have in common. Twin of `edge.glsl`.

use glam::Vec3;

use super::noise::luminance_of;
use crate::layout::Guide;

/// The albedo below which a colour of a surface counts as black.
pub const LEAST_ALBEDO: f32 = 1e-4;
/// The sine of the angle between a pixel's surface and the straight line to another pixel's point at which the weight
/// of the other pixel has fallen to 1 / e.
const PLANE_SINE: f32 = 0.2;
/// The exponent of the cosine between two normals is 2 to the power of this.
const NORMAL_EXPONENT_LOG2: u32 = 5;

/// The light that surfaces scatter to the camera, divided by their albedo. `radiance`: of the pixel.
pub fn light_on(radiance: Vec3, guide: &Guide) -> Vec3 {
    let scattered = (radiance - guide.seen).max(Vec3::ZERO);
    let light = scattered / guide.albedo.max(Vec3::splat(LEAST_ALBEDO));
    Vec3::select(guide.albedo.cmpgt(Vec3::splat(LEAST_ALBEDO)), light, Vec3::ZERO)
}

/// How much the light of pixel `b` tells of that on the surface of pixel `a`, from what both show. Pixels of low albedo
/// tell less, because the division by the albedo increases their noise.
pub fn surface_weight(a: &Guide, b: &Guide) -> f32 {
    if a.n_hits == 0 || b.n_hits == 0 {
        return 0.0;
    }
    let normal = a.normal_world.normalize_or_zero();
    let cosine = normal.dot(b.normal_world.normalize_or_zero()).clamp(0.0, 1.0);
    let sine = normal.dot((b.position_world - a.position_world).normalize_or_zero()).abs();
    luminance_of(b.albedo) * cosine.powi(1 << NORMAL_EXPONENT_LOG2) * (-sine / PLANE_SINE).exp()
}
