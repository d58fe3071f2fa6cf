//! Path trace: the closest hits of paths, and the segments to lights. Twin of `path_trace.comp`.

use glam::Vec3;
use rayon::prelude::*;

use super::{
    RAYS_PER_TASK,
    inputs::KernelInputs,
    live_paths::{Part, parts},
    search_ray::SearchRay,
    traverser::{Tracer, Traverser},
};
use crate::{
    accel::kdtree::Traversal,
    layout::{Hit, NO_TRIANGLE, PathRay, PathState, SEGMENT_NONE, Segment},
};

/// Writes the closest hits of the paths `live`, which are in ascending order, to `hits`. Returns how many of them hit
/// something.
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
    let trace = |tracer: &mut T, live: &[u32], mut hits: Part<Hit>| {
        let mut n_hits = 0;
        let search_rays = live.iter().map(|&path_ix| (path_ix, SearchRay::from(&rays[path_ix as usize])));
        tracer.trace_all::<false, _>(inputs, search_rays, |path_ix, closest| {
            n_hits += u32::from(closest.triangle_ix != NO_TRIANGLE);
            *hits.of_path(path_ix) = closest;
        });
        n_hits
    };
    let chunks = live.par_chunks(RAYS_PER_TASK).zip(parts(hits, live, RAYS_PER_TASK));
    chunks.map_init(|| T::new(inputs, traversal), |tracer, (live, hits)| trace(tracer, live, hits)).sum()
}

/// Tests the segments of the paths `live`, which were alive at the bounce before and are in ascending order. Light that
/// arrives is added to the paths' states, and the segments are removed. Returns how many there were.
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
    let test = |tracer: &mut T, live: &[u32], mut segments: Part<Segment>, mut states: Part<PathState>| {
        let mut waiting = Vec::with_capacity(live.len());
        for &path_ix in live {
            let segment = segments.of_path(path_ix);
            if segment.state != SEGMENT_NONE {
                waiting.push((path_ix, SearchRay::from(&ray_of(segment))));
            }
        }
        let n_segments = waiting.len() as u32;
        tracer.trace_all::<true, _>(inputs, waiting.into_iter(), |path_ix, hit| {
            let segment = segments.of_path(path_ix);
            segment.state = SEGMENT_NONE;
            if hit.triangle_ix == NO_TRIANGLE {
                states.of_path(path_ix).radiance += segment.light;
            }
        });
        n_segments
    };
    let of_paths = (parts(segments, live, RAYS_PER_TASK), parts(states, live, RAYS_PER_TASK));
    let chunks = live.par_chunks(RAYS_PER_TASK).zip(of_paths);
    let n_segments = |tracer: &mut T, (live, (segments, states))| test(tracer, live, segments, states);
    chunks.map_init(|| T::new(inputs, traversal), n_segments).sum()
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
