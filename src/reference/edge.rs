//! What the passes of the noise filter `edge` have in common. Twin of `picture/edge.glsl`.

use glam::Vec3;

use super::noise::luminance_of;
use crate::layout::Auxiliary;

/// The albedo below which a colour of a surface counts as black.
pub const LEAST_ALBEDO: f32 = 1e-4;
/// Plane-distance falloff: the weight is 1 / e where the neighbour is seen at this sine above the pixel's tangent
/// plane.
const PLANE_SINE: f32 = 0.2;
/// The squared distance of two mean normals at which the weight has fallen to 1 / e.
const NORMAL_DISTANCE: f32 = 0.0625;
/// What is subtracted from this distance if the pixel's own normals differ, as a multiple of their variance.
const NORMAL_VARIANCES: f32 = 3.0;

/// The light that surfaces scatter to the camera, divided by their albedo. `radiance`: of the pixel.
pub fn light_on(radiance: Vec3, aux: &Auxiliary) -> Vec3 {
    let scattered = (radiance - aux.seen).max(Vec3::ZERO);
    let light = scattered / aux.albedo.max(Vec3::splat(LEAST_ALBEDO));
    Vec3::select(aux.albedo.cmpgt(Vec3::splat(LEAST_ALBEDO)), light, Vec3::ZERO)
}

/// How much the light of pixel `b` tells of that on the surface of pixel `a`, from what both show. Pixels of low albedo
/// tell less, because the division by the albedo increases their noise.
pub fn surface_weight(a: &Auxiliary, b: &Auxiliary) -> f32 {
    if a.n_hits == 0 || b.n_hits == 0 {
        return 0.0;
    }
    let own_variance = (1.0 - a.normal_world.length_squared()).max(0.0);
    let turned = (a.normal_world.distance_squared(b.normal_world) - NORMAL_VARIANCES * own_variance).max(0.0);
    let direction = (b.position_world - a.position_world).normalize_or_zero();
    let sine = a.normal_world.normalize_or_zero().dot(direction).abs();
    luminance_of(b.albedo) * (-turned / NORMAL_DISTANCE - sine / PLANE_SINE).exp()
}
