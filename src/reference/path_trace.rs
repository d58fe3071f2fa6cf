//! Path trace: the closest hits of paths, and the shadow rays to lights. Twin of `path_trace.comp`.

use glam::Vec3;
use rayon::prelude::*;

use super::{
    RAYS_PER_TASK,
    alpha_test::alpha_seed_of,
    inputs::KernelInputs,
    live_paths::{PathSlice, path_slices},
    paths::{key_of_path, pixel_of_path},
    search_ray::SearchRay,
    traverser::{Tracer, Traverser},
};
use crate::{
    accel::kdtree::Traversal,
    layout::{Batch, Hit, NO_TRIANGLE, PathRay, PathState, SHADOW_RAY_NONE, ShadowRay},
};

/// Returns the ray of a path in the form in which it is traced.
pub(crate) fn search_ray_of(
    inputs: &KernelInputs,
    batch: &Batch,
    path_ix: u32,
    ray: &PathRay,
    is_shadow_ray: bool,
) -> SearchRay {
    let mut search_ray = SearchRay::from(ray);
    // No other scene needs it.
    if inputs.lets_rays_pass() {
        let key = key_of_path(inputs, path_ix, pixel_of_path(inputs.frame(), batch, path_ix));
        search_ray.alpha_seed = alpha_seed_of(key, batch.depth, is_shadow_ray);
    }
    search_ray
}

/// Writes the closest hits of the paths `live`, which are in ascending order, to `hits`. Returns how many of them hit
/// something.
pub fn closest_hits(
    inputs: &KernelInputs,
    batch: &Batch,
    traversal: Traversal,
    (live, rays): (&[u32], &[PathRay]),
    hits: &mut [Hit],
) -> u32 {
    closest_hits_by(inputs, batch, || Traverser::new(inputs, traversal), (live, rays), hits)
}

/// Does what [`closest_hits`] does, by tracers that `new_tracer` makes, at least one for each thread that works.
pub fn closest_hits_by<T: Tracer>(
    inputs: &KernelInputs,
    batch: &Batch,
    new_tracer: impl Fn() -> T + Sync + Send,
    (live, rays): (&[u32], &[PathRay]),
    hits: &mut [Hit],
) -> u32 {
    let inputs = &inputs.with_stochastic_alpha();
    let trace = |tracer: &mut T, live: &[u32], mut hits: PathSlice<Hit>| {
        let mut n_hits = 0;
        let search_ray = |path_ix| search_ray_of(inputs, batch, path_ix, &rays[path_ix as usize], false);
        let search_rays = live.iter().map(|&path_ix| (path_ix, search_ray(path_ix)));
        tracer.trace_all::<false, _>(inputs, search_rays, |path_ix, closest| {
            n_hits += u32::from(closest.triangle_ix != NO_TRIANGLE);
            *hits.of_path(path_ix) = closest;
        });
        n_hits
    };
    let chunks = live.par_chunks(RAYS_PER_TASK).zip(path_slices(hits, live, RAYS_PER_TASK));
    chunks.map_init(new_tracer, |tracer, (live, hits)| trace(tracer, live, hits)).sum()
}

/// Tests the shadow rays of the paths `with_shadow_ray`, which are in ascending order. Light that arrives is added to
/// the paths' states, and the shadow rays are removed.
pub fn shadow_rays(
    inputs: &KernelInputs,
    batch: &Batch,
    traversal: Traversal,
    with_shadow_ray: &[u32],
    of_paths: (&mut [ShadowRay], &mut [PathState]),
) {
    shadow_rays_by(inputs, batch, || Traverser::new(inputs, traversal), with_shadow_ray, of_paths);
}

/// Does what [`shadow_rays`] does, by tracers that `new_tracer` makes, at least one for each thread that works.
pub fn shadow_rays_by<T: Tracer>(
    inputs: &KernelInputs,
    batch: &Batch,
    new_tracer: impl Fn() -> T + Sync + Send,
    with_shadow_ray: &[u32],
    (shadow_rays, states): (&mut [ShadowRay], &mut [PathState]),
) {
    let inputs = &inputs.with_stochastic_alpha();
    let test =
        |tracer: &mut T, list: &[u32], mut shadow_rays: PathSlice<ShadowRay>, mut states: PathSlice<PathState>| {
            let search_ray = |&path_ix: &u32| {
                let ray = ray_of(shadow_rays.of_path(path_ix));
                (path_ix, search_ray_of(inputs, batch, path_ix, &ray, true))
            };
            let search_rays: Vec<_> = list.iter().map(search_ray).collect();
            tracer.trace_all::<true, _>(inputs, search_rays.into_iter(), |path_ix, hit| {
                let shadow_ray = shadow_rays.of_path(path_ix);
                shadow_ray.state = SHADOW_RAY_NONE;
                if hit.triangle_ix == NO_TRIANGLE {
                    states.of_path(path_ix).radiance += shadow_ray.light;
                }
            });
        };
    let of_paths =
        (path_slices(shadow_rays, with_shadow_ray, RAYS_PER_TASK), path_slices(states, with_shadow_ray, RAYS_PER_TASK));
    let chunks = with_shadow_ray.par_chunks(RAYS_PER_TASK).zip(of_paths);
    let test_chunk = |tracer: &mut T, (list, (shadow_rays, states))| test(tracer, list, shadow_rays, states);
    chunks.for_each_init(new_tracer, test_chunk);
}

/// Returns the ray of a shadow ray, without its pixel.
pub(crate) fn ray_of(shadow_ray: &ShadowRay) -> PathRay {
    PathRay {
        origin: shadow_ray.origin,
        pixel_ix: 0,
        direction: shadow_ray.direction,
        source_triangle: shadow_ray.source_triangle,
        throughput: Vec3::ZERO,
        t_max: shadow_ray.t_max,
    }
}
