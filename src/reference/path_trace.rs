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
    closest_hits_by(inputs, || Traverser::new(inputs, traversal), live, rays, hits)
}

/// Does what [`closest_hits`] does, by tracers that `new_tracer` makes, at least one for each thread that works.
pub fn closest_hits_by<T: Tracer>(
    inputs: &KernelInputs,
    new_tracer: impl Fn() -> T + Sync + Send,
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
    chunks.map_init(new_tracer, |tracer, (live, hits)| trace(tracer, live, hits)).sum()
}

/// Tests the segments of the paths `with_segment`, which are in ascending order. Light that arrives is added to the
/// paths' states, and the segments are removed.
pub fn segments(
    inputs: &KernelInputs,
    traversal: Traversal,
    with_segment: &[u32],
    segments: &mut [Segment],
    states: &mut [PathState],
) {
    segments_by(inputs, || Traverser::new(inputs, traversal), with_segment, segments, states);
}

/// Does what [`segments`] does, by tracers that `new_tracer` makes, at least one for each thread that works.
pub fn segments_by<T: Tracer>(
    inputs: &KernelInputs,
    new_tracer: impl Fn() -> T + Sync + Send,
    with_segment: &[u32],
    segments: &mut [Segment],
    states: &mut [PathState],
) {
    let inputs = &inputs.through_veils_at_random();
    let test = |tracer: &mut T, list: &[u32], mut segments: Part<Segment>, mut states: Part<PathState>| {
        let search_ray = |&path_ix: &u32| (path_ix, SearchRay::from(&ray_of(segments.of_path(path_ix))));
        let search_rays: Vec<_> = list.iter().map(search_ray).collect();
        tracer.trace_all::<true, _>(inputs, search_rays.into_iter(), |path_ix, hit| {
            let segment = segments.of_path(path_ix);
            segment.state = SEGMENT_NONE;
            if hit.triangle_ix == NO_TRIANGLE {
                states.of_path(path_ix).radiance += segment.light;
            }
        });
    };
    let of_paths = (parts(segments, with_segment, RAYS_PER_TASK), parts(states, with_segment, RAYS_PER_TASK));
    let chunks = with_segment.par_chunks(RAYS_PER_TASK).zip(of_paths);
    let test_chunk = |tracer: &mut T, (list, (segments, states))| test(tracer, list, segments, states);
    chunks.for_each_init(new_tracer, test_chunk);
}

/// Returns the ray of a segment, without its pixel.
pub(crate) fn ray_of(segment: &Segment) -> PathRay {
    PathRay {
        origin: segment.origin,
        pixel_ix: 0,
        direction: segment.direction,
        source_triangle: segment.source_triangle,
        throughput: Vec3::ZERO,
        t_max: segment.t_max,
    }
}
