//! The cost of a pixel's rays: their number, and the number of nodes and of triangles of leaves that they read. The
//! kernels count while they trace. Here rays are traced a second time to be counted, so that tracing without counts
//! costs nothing. Brute force counts every triangle here, but a kernel ends at a shadow ray's first hit.

use rayon::prelude::*;

use super::table::ReadCounts;
use crate::reference::{
    RAYS_PER_TASK,
    inputs::KernelInputs,
    search_ray::SearchRay,
    shadow::shadow_ray_of,
    traverser::{Tracer, Traverser},
};
use crate::{
    accel::kdtree::Traversal,
    layout::{Hit, NO_TRIANGLE, PathRay, PixelAovs},
};

/// Counts primary rays whose triangles the rasterizer found: one test for each hit.
pub fn count_rasterized(rays: &[PathRay], hits: &[Hit], pixel_aovs: &mut [PixelAovs]) {
    for (ray, hit) in rays.iter().zip(hits) {
        let aovs = &mut pixel_aovs[ray.pixel_ix as usize];
        aovs.n_rays = 1;
        aovs.n_steps = (hit.triangle_ix != NO_TRIANGLE).into();
    }
}

/// Adds the cost of rays, with their pixels, whose closest hits, or with `ANY_HIT` any hits, are found by a search.
pub fn count_rays<const ANY_HIT: bool>(
    inputs: &KernelInputs,
    traversal: Traversal,
    rays: &[(u32, SearchRay)],
    pixel_aovs: &mut [PixelAovs],
) {
    let steps: Vec<_> = (rays.par_iter().with_min_len(RAYS_PER_TASK))
        .map_init(
            || Traverser::new(inputs, traversal),
            |traverser, (_, ray)| steps_of::<ANY_HIT>(inputs, traverser, ray),
        )
        .collect();
    for (&(pixel_ix, _), n_steps) in rays.iter().zip(steps) {
        add(pixel_aovs, pixel_ix, n_steps);
    }
}

/// Adds the cost of the shadow rays from the hits to all lights that the hits can show.
pub fn count_shadow(
    inputs: &KernelInputs,
    traversal: Traversal,
    rays: &[PathRay],
    hits: &[Hit],
    pixel_aovs: &mut [PixelAovs],
) {
    let inputs = &inputs.with_blended_tested();
    for light in inputs.lights {
        let steps: Vec<_> = (rays.par_iter().zip(hits).with_min_len(RAYS_PER_TASK))
            .map_init(
                || Traverser::new(inputs, traversal),
                |traverser, (ray, hit)| {
                    let is_hit = hit.triangle_ix != NO_TRIANGLE;
                    let shadow_ray = is_hit.then(|| shadow_ray_of(inputs, ray, hit, light)).flatten()?;
                    Some(steps_of::<true>(inputs, traverser, &(&shadow_ray).into()))
                },
            )
            .collect();
        for (ray, n_steps) in rays.iter().zip(steps) {
            if let Some(n_steps) = n_steps {
                add(pixel_aovs, ray.pixel_ix, n_steps);
            }
        }
    }
}

/// Returns the number of nodes and triangles that a ray reads.
fn steps_of<const ANY: bool>(inputs: &KernelInputs, traverser: &mut Traverser, ray: &SearchRay) -> u32 {
    if matches!(traverser, Traverser::Brute) && inputs.instanced.is_none() {
        return inputs.triangles.len() as u32;
    }
    let counts = ReadCounts::default();
    traverser.traverse::<ANY>(&inputs.counted(&counts), ray);
    (counts.n_nodes.get() + counts.n_triangles.get()) as u32
}

/// Adds a ray and its steps to its pixel.
fn add(pixel_aovs: &mut [PixelAovs], pixel_ix: u32, n_steps: u32) {
    let aovs = &mut pixel_aovs[pixel_ix as usize];
    aovs.n_rays += 1;
    aovs.n_steps += n_steps;
}
