//! The part of a ray that a search needs.

use glam::Vec3;

use crate::layout::{Hit, NO_TRIANGLE, PathRay};

/// A ray whose hits have t in (t_min, t_max].
#[derive(Clone, Copy, Debug)]
pub struct SearchRay {
    /// World units.
    pub origin: Vec3,
    pub t_min: f32,
    /// About unit length.
    pub direction: Vec3,
    pub t_max: f32,
    /// The triangle that the ray never hits, or `NO_TRIANGLE`.
    pub source_triangle: u32,
    /// Seed of the random decisions by which a path's ray passes through blended triangles.
    pub alpha_seed: u32,
}

impl From<&PathRay> for SearchRay {
    fn from(ray: &PathRay) -> Self {
        let &PathRay { origin, direction, t_max, source_triangle, .. } = ray;
        Self { origin, t_min: 0.0, direction, t_max, source_triangle, alpha_seed: 0 }
    }
}

impl SearchRay {
    /// The hit before anything is hit: no triangle, at `t_max`.
    pub fn miss(&self) -> Hit {
        Hit { t: self.t_max, triangle_ix: NO_TRIANGLE, u: 0.0, v: 0.0 }
    }
}
