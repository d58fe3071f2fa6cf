//! Candidates, which are the triangles that a search comes to, and their test against the nearest hit so far. Twin of
//! `search/candidate.glsl`.

use super::{counting::table::ReadCounter, inputs::KernelInputs, search_ray::SearchRay, triangle::Shear};
use crate::layout::{Hit, NO_TRIANGLE};

/// The part of a ray that the test of a triangle needs. A hit counts if its t is in (`t_min`, t of the nearest hit so
/// far] and it is not on `source_triangle`.
#[derive(Clone, Copy, Debug)]
pub struct HitFilter {
    pub shear: Shear,
    pub t_min: f32,
    pub source_triangle: u32,
    pub alpha_seed: u32,
    /// Of the hits at `t_min`, those on triangles of a higher index count, too. `NO_TRIANGLE`: none does.
    pub last_triangle: u32,
}

impl HitFilter {
    /// Prepares a ray for the tests of triangles.
    #[inline(always)]
    pub fn of(ray: &SearchRay) -> Self {
        let shear = Shear::of(ray.origin.to_array(), ray.direction.to_array());
        Self {
            shear,
            t_min: ray.t_min,
            source_triangle: ray.source_triangle,
            alpha_seed: ray.alpha_seed,
            last_triangle: NO_TRIANGLE,
        }
    }

    /// Keeps a hit in `best` if it counts and is nearer. Of two hits at the same t, the one with the lower triangle
    /// index wins, so the order of tests does not matter.
    #[inline(always)]
    pub fn keep_nearest(&self, inputs: &KernelInputs<impl ReadCounter>, hit: &Hit, best: &mut Hit) {
        let nearer = hit.t < best.t || (hit.t == best.t && hit.triangle_ix < best.triangle_ix);
        let follows = hit.t > self.t_min || (hit.t == self.t_min && hit.triangle_ix > self.last_triangle);
        let is_of_ray = follows && hit.triangle_ix != self.source_triangle;
        if is_of_ray && nearer && inputs.is_accepted(&self.shear, hit, self.alpha_seed) {
            *best = *hit;
        }
    }
}

/// Tests a triangle against the ray, and keeps its hit in `best` if it is nearer.
#[inline(always)]
pub fn intersect(inputs: &KernelInputs<impl ReadCounter>, hit_filter: &HitFilter, triangle_ix: u32, best: &mut Hit) {
    let triangle = &inputs.triangles[triangle_ix as usize];
    let Some(hit) = hit_filter.shear.intersect_triangle(triangle, triangle_ix) else { return };
    hit_filter.keep_nearest(inputs, &hit, best);
}
