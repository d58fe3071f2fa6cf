//! What the traversal is told of a ray.

use glam::Vec3;

use crate::layout::{Hit, NO_TRIANGLE, PathRay};

/// A ray that is to be traced in (t_min, t_max].
#[derive(Clone, Copy, Debug)]
pub struct SearchRay {
    pub origin: Vec3,
    pub t_min: f32,
    /// Of about unit length.
    pub direction: Vec3,
    pub t_max: f32,
    /// Which it does not hit.
    pub source_triangle: u32,
}

impl From<&PathRay> for SearchRay {
    fn from(ray: &PathRay) -> Self {
        let &PathRay { origin, direction, t_max, source_triangle, .. } = ray;
        Self { origin, t_min: 0.0, direction, t_max, source_triangle }
    }
}

impl SearchRay {
    /// What is there before anything is hit.
    pub fn miss(&self) -> Hit {
        Hit { t: self.t_max, triangle_ix: NO_TRIANGLE, u: 0.0, v: 0.0 }
    }
}
