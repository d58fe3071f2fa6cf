//! Trace (the paper's section 2.3): each ray's closest hit through the kd-tree. Twin of `trace.comp`.

use rayon::prelude::*;

use super::{
    RAYS_PER_TASK,
    bindings::Bindings,
    probe::Probe,
    traverser::{Tracer, Traverser},
};
use crate::{
    accel::kdtree::Traversal,
    layout::{Hit, NO_TRIANGLE, Ray},
};

/// Writes `hits`, one a ray; returns how many are hits.
pub fn trace(bindings: &Bindings, traversal: Traversal, rays: &[Ray], hits: &mut [Hit]) -> u32 {
    trace_by::<Traverser>(bindings, traversal, rays, hits)
}

/// Does what [`trace`] does, by another tracer.
pub fn trace_by<T: Tracer>(bindings: &Bindings, traversal: Traversal, rays: &[Ray], hits: &mut [Hit]) -> u32 {
    rays.par_chunks(RAYS_PER_TASK)
        .zip(hits.par_chunks_mut(RAYS_PER_TASK))
        .map_init(
            || T::new(traversal),
            |traverser, (rays, hits)| {
                let mut n_hits = 0;
                let probes = rays.iter().map(Probe::from);
                traverser.trace_all::<false, _>(bindings, hits.iter_mut().zip(probes), |hit, found| {
                    *hit = found;
                    n_hits += u32::from(found.triangle_ix != NO_TRIANGLE);
                });
                n_hits
            },
        )
        .sum()
}
