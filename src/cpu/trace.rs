//! Trace (the paper's section 2.3): each ray's closest hit through the kd-tree. Twin of `trace.comp`.

use rayon::prelude::*;

use super::{RAYS_PER_TASK, bindings::Bindings, probe::Probe, traverser::Traverser};
use crate::{
    accel::kdtree::Traversal,
    layout::{Hit, NO_TRIANGLE, Ray},
};

/// Writes `hits`, one a ray; returns how many are hits.
pub fn trace(bindings: &Bindings, traversal: Traversal, rays: &[Ray], hits: &mut [Hit]) -> u32 {
    rays.par_chunks(RAYS_PER_TASK)
        .zip(hits.par_chunks_mut(RAYS_PER_TASK))
        .map_init(
            || Traverser::new(traversal),
            |traverser, (rays, hits)| {
                let mut n_hits = 0;
                let probes = rays.iter().map(Probe::from);
                traverser.traverse_all::<false, _>(bindings, hits.iter_mut().zip(probes), |hit, found| {
                    *hit = found;
                    n_hits += u32::from(found.triangle_ix != NO_TRIANGLE);
                });
                n_hits
            },
        )
        .sum()
}
