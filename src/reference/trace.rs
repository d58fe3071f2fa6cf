//! Trace (the paper's section 2.3): the closest hit of each ray. Twin of `trace.comp`.

use rayon::prelude::*;

use super::{
    RAYS_PER_TASK,
    inputs::KernelInputs,
    search_ray::SearchRay,
    traverser::{Tracer, Traverser},
};
use crate::{
    accel::kdtree::Traversal,
    layout::{Hit, NO_TRIANGLE, PathRay},
};

/// Writes `hits`, one for each ray. Returns the number of rays that hit something.
pub fn trace(inputs: &KernelInputs, traversal: Traversal, rays: &[PathRay], hits: &mut [Hit]) -> u32 {
    trace_by(inputs, || Traverser::new(inputs, traversal), rays, hits)
}

/// Does what [`trace`] does, by tracers that `new_tracer` makes, at least one for each thread that works.
pub fn trace_by<T: Tracer>(
    inputs: &KernelInputs,
    new_tracer: impl Fn() -> T + Sync + Send,
    rays: &[PathRay],
    hits: &mut [Hit],
) -> u32 {
    rays.par_chunks(RAYS_PER_TASK)
        .zip(hits.par_chunks_mut(RAYS_PER_TASK))
        .map_init(new_tracer, |tracer, (rays, hits)| {
            let mut n_hits = 0;
            let search_rays = rays.iter().map(SearchRay::from);
            tracer.trace_all::<false, _>(inputs, hits.iter_mut().zip(search_rays), |hit, found| {
                *hit = found;
                n_hits += u32::from(found.triangle_ix != NO_TRIANGLE);
            });
            n_hits
        })
        .sum()
}
