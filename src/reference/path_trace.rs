//! Path trace: the closest hits of paths, and the segments to lights. Twin of `path_trace.comp`.

use glam::Vec3;
use rayon::prelude::*;

use super::{
    RAYS_PER_TASK,
    inputs::KernelInputs,
    search_ray::SearchRay,
    traverser::{Tracer, Traverser},
};
use crate::{
    accel::kdtree::Traversal,
    layout::{Hit, NO_TRIANGLE, PathRay, PathState, SEGMENT_NONE, Segment},
};

/// Writes the closest hits of the paths `live` to `hits`. Returns how many of them hit something.
pub fn closest_hits(
    inputs: &KernelInputs,
    traversal: Traversal,
    live: &[u32],
    rays: &[PathRay],
    hits: &mut [Hit],
) -> u32 {
    closest_hits_by::<Traverser>(inputs, traversal, live, rays, hits)
}

/// Does what [`closest_hits`] does, by the tracer `T`.
pub fn closest_hits_by<T: Tracer>(
    inputs: &KernelInputs,
    traversal: Traversal,
    live: &[u32],
    rays: &[PathRay],
    hits: &mut [Hit],
) -> u32 {
    let inputs = &inputs.through_veils_at_random();
    let mut found = vec![Hit::default(); live.len()];
    found.par_chunks_mut(RAYS_PER_TASK).zip(live.par_chunks(RAYS_PER_TASK)).for_each_init(
        || T::new(inputs, traversal),
        |traverser, (found, live)| {
            let search_rays = live.iter().map(|&path_ix| SearchRay::from(&rays[path_ix as usize]));
            traverser.trace_all::<false, _>(inputs, found.iter_mut().zip(search_rays), |hit, closest| *hit = closest);
        },
    );
    for (&path_ix, hit) in live.iter().zip(&found) {
        hits[path_ix as usize] = *hit;
    }
    found.iter().filter(|hit| hit.triangle_ix != NO_TRIANGLE).count() as u32
}

/// Tests the segments of the paths `live`, which were alive at the bounce before. Light that arrives is added to the
/// paths' states, and the segments are removed. Returns how many there were.
pub fn segments(
    inputs: &KernelInputs,
    traversal: Traversal,
    live: &[u32],
    segments: &mut [Segment],
    states: &mut [PathState],
) -> u32 {
    segments_by::<Traverser>(inputs, traversal, live, segments, states)
}

/// Does what [`segments`] does, by the tracer `T`.
pub fn segments_by<T: Tracer>(
    inputs: &KernelInputs,
    traversal: Traversal,
    live: &[u32],
    segments: &mut [Segment],
    states: &mut [PathState],
) -> u32 {
    let inputs = &inputs.through_veils_at_random();
    let waiting: Vec<u32> =
        live.iter().copied().filter(|&path_ix| segments[path_ix as usize].state != SEGMENT_NONE).collect();
    let mut arrives = vec![false; waiting.len()];
    arrives.par_chunks_mut(RAYS_PER_TASK).zip(waiting.par_chunks(RAYS_PER_TASK)).for_each_init(
        || T::new(inputs, traversal),
        |traverser, (arrives, waiting)| {
            let search_rays = waiting.iter().map(|&path_ix| SearchRay::from(&ray_of(&segments[path_ix as usize])));
            traverser.trace_all::<true, _>(inputs, arrives.iter_mut().zip(search_rays), |arrives, hit| {
                *arrives = hit.triangle_ix == NO_TRIANGLE;
            });
        },
    );
    for (&path_ix, arrives) in waiting.iter().zip(&arrives) {
        let segment = &mut segments[path_ix as usize];
        segment.state = SEGMENT_NONE;
        if *arrives {
            states[path_ix as usize].radiance += segment.light;
        }
    }
    waiting.len() as u32
}

fn ray_of(segment: &Segment) -> PathRay {
    PathRay {
        origin: segment.origin,
        pixel_ix: 0,
        direction: segment.direction,
        source_triangle: segment.source_triangle,
        throughput: Vec3::ZERO,
        t_max: segment.t_max,
    }
}
