//! All hits: the hits of each given ray, in the order of t and then of the triangles' indices, those of one instance
//! after those of another. Twin of `all_hits.comp`.

use rayon::prelude::*;

use super::{
    RAYS_PER_TASK,
    cast::{scaled, scales_of},
    inputs::KernelInputs,
    instances::visit_instances,
    search_ray::SearchRay,
    traversal_ray::{TraversalRay, min, near_scene, t_from_origin},
    traverser::Traverser,
};
use crate::{
    accel::kdtree::Traversal,
    layout::{Hit, NO_TRIANGLE, Ray},
};

/// Calls `visit` with the hits of a ray. Without instances, the first false that it returns ends that.
fn visit_hits(inputs: &KernelInputs, tracer: &mut Traverser, ray: &SearchRay, mut visit: impl FnMut(Hit) -> bool) {
    let Some(instanced) = &inputs.instanced else { return visit_structure(inputs, tracer, ray, visit) };
    visit_instances(inputs, instanced, ray, |geometry, local, inv_scale| {
        let in_world = |hit: Hit| Hit { t: min(hit.t / inv_scale, ray.t_max), ..geometry.in_world(&hit) };
        visit_structure(geometry, tracer, local, |hit| visit(in_world(hit)));
    });
}

/// Calls `visit` with the hits of a ray in one structure, until it returns false.
fn visit_structure(inputs: &KernelInputs, tracer: &mut Traverser, ray: &SearchRay, mut visit: impl FnMut(Hit) -> bool) {
    let (mut near, t_start) = near_scene(inputs, ray);
    let mut last_triangle = NO_TRIANGLE;
    loop {
        let mut behind_last = TraversalRay::new(inputs, &near);
        behind_last.hit_filter.last_triangle = last_triangle;
        let mut best = near.miss();
        tracer.search::<false>(inputs, &behind_last, &mut best);
        let hit = Hit { t: t_from_origin(best.t, t_start, ray.t_max), ..best };
        if best.triangle_ix == NO_TRIANGLE || !visit(hit) {
            return;
        }
        (near.t_min, last_triangle) = (best.t, best.triangle_ix);
    }
}

/// Appends up to `most` hits of a ray, which with instances is above their number.
fn append_hits(inputs: &KernelInputs, tracer: &mut Traverser, ray: &Ray, most: usize, hits: &mut Vec<Hit>) {
    let ([scale, _], end) = (scales_of(ray.direction), hits.len().saturating_add(most));
    if most > 0 {
        visit_hits(inputs, tracer, &scaled(ray), |hit| {
            hits.push(Hit { t: hit.t * scale, ..hit });
            hits.len() < end
        });
    }
}

/// Returns the number of each ray's hits.
pub fn count_hits(inputs: &KernelInputs, traversal: Traversal, rays: &[Ray]) -> Vec<u32> {
    let count = |tracer: &mut Traverser, ray: &Ray| {
        let mut n_hits = 0;
        visit_hits(inputs, tracer, &scaled(ray), |_| {
            n_hits += 1;
            true
        });
        n_hits
    };
    // `FEW` in python/src/scene.rs relies on it that so few rays are not divided among threads.
    rays.par_iter().with_min_len(64).map_init(|| Traverser::new(inputs, traversal), count).collect()
}

/// Returns the hits of all rays one after the other, at most `most` of each ray, and where those of each ray end. With
/// instances, all hits of a ray are listed.
pub fn list_hits(inputs: &KernelInputs, traversal: Traversal, rays: &[Ray], most: usize) -> (Vec<usize>, Vec<Hit>) {
    let most = if inputs.instanced.is_some() { usize::MAX } else { most };
    let list = |tracer: &mut Traverser, rays: &[Ray]| {
        let mut hits = Vec::new();
        let append = |ray| {
            append_hits(inputs, tracer, ray, most, &mut hits);
            hits.len()
        };
        (rays.iter().map(append).collect::<Vec<_>>(), hits)
    };
    let tasks = rays.par_chunks(RAYS_PER_TASK).map_init(|| Traverser::new(inputs, traversal), list);
    let (mut ends, mut all) = (Vec::with_capacity(rays.len()), Vec::new());
    for (ends_of_task, hits) in tasks.collect::<Vec<_>>() {
        ends.extend(ends_of_task.iter().map(|end| all.len() + end));
        all.extend(hits);
    }
    (ends, all)
}
