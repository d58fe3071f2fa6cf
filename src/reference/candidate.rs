//! Candidates: triangles that a search comes to, against the nearest hit so far. Twin of `candidate.glsl`.

use super::{counting::table::ReadCounter, inputs::KernelInputs, search_ray::SearchRay, triangle::Shear};
use crate::layout::Hit;

/// What tells a ray's hits from what it passes by.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    pub shear: Shear,
    pub t_min: f32,
    pub source_triangle: u32,
}

impl Target {
    #[inline(always)]
    pub fn of(ray: &SearchRay) -> Self {
        let shear = Shear::of(ray.origin.to_array(), ray.direction.to_array());
        Self { shear, t_min: ray.t_min, source_triangle: ray.source_triangle }
    }
}

/// A triangle against the ray; of two hits at one t the lower index wins, whatever the order of triangles.
#[inline(always)]
pub fn intersect(inputs: &KernelInputs<impl ReadCounter>, target: &Target, triangle_ix: u32, best: &mut Hit) {
    let triangle = &inputs.triangles[triangle_ix as usize];
    let Some(hit) = target.shear.intersect_triangle(triangle, triangle_ix) else { return };
    let nearer = hit.t < best.t || (hit.t == best.t && triangle_ix < best.triangle_ix);
    let is_of_ray = hit.t > target.t_min && triangle_ix != target.source_triangle;
    if is_of_ray && nearer && inputs.is_accepted(triangle_ix) {
        *best = hit;
    }
}
