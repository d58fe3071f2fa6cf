//! What the rays of a pixel cost: how many there are, and how many nodes, and triangles of leaves, they read. The kernels count in
//! passing; here rays go through the tree once more, so that uncounted ones cost nothing. Brute force tests every triangle
//! here, where a kernel ends at a shadow ray's first hit.

use rayon::prelude::*;

use super::table::ReadCounts;
use crate::reference::{
    RAYS_PER_TASK,
    inputs::KernelInputs,
    shadow::shadow_segment,
    traverser::{Tracer, Traverser},
};
use crate::{
    accel::kdtree::Traversal,
    layout::{Feature, Hit, NO_TRIANGLE, PathRay},
};

/// Primary rays whose triangles the rasterizer found: one test each.
pub fn count_rasterized(rays: &[PathRay], hits: &[Hit], pixel_features: &mut [Feature]) {
    for (ray, hit) in rays.iter().zip(hits) {
        let feature = &mut pixel_features[ray.pixel_ix as usize];
        feature.n_rays = 1;
        feature.n_steps = (hit.triangle_ix != NO_TRIANGLE).into();
    }
}

/// Rays whose closest hit was found through the tree.
pub fn count_closest(inputs: &KernelInputs, traversal: Traversal, rays: &[PathRay], pixel_features: &mut [Feature]) {
    let steps: Vec<_> = (rays.par_iter().with_min_len(RAYS_PER_TASK))
        .map_init(|| Traverser::new(inputs, traversal), |traverser, ray| steps_of::<false>(inputs, traverser, ray))
        .collect();
    for (ray, n_steps) in rays.iter().zip(steps) {
        add(pixel_features, ray, n_steps);
    }
}

/// Segments from the hits to all lights that their surfaces face.
pub fn count_shadow(
    inputs: &KernelInputs,
    traversal: Traversal,
    rays: &[PathRay],
    hits: &[Hit],
    pixel_features: &mut [Feature],
) {
    for light in inputs.lights {
        let steps: Vec<_> = (rays.par_iter().zip(hits).with_min_len(RAYS_PER_TASK))
            .map_init(
                || Traverser::new(inputs, traversal),
                |traverser, (ray, hit)| {
                    let is_hit = hit.triangle_ix != NO_TRIANGLE;
                    let segment = is_hit.then(|| shadow_segment(inputs, ray, hit, light)).flatten()?;
                    Some(steps_of::<true>(inputs, traverser, &segment))
                },
            )
            .collect();
        for (ray, n_steps) in rays.iter().zip(steps) {
            if let Some(n_steps) = n_steps {
                add(pixel_features, ray, n_steps);
            }
        }
    }
}

fn steps_of<const ANY: bool>(inputs: &KernelInputs, traverser: &mut Traverser, ray: &PathRay) -> u32 {
    if matches!(traverser, Traverser::Brute) {
        return inputs.triangles.len() as u32;
    }
    let counts = ReadCounts::default();
    traverser.traverse::<ANY>(&inputs.counted(&counts), &ray.into());
    (counts.n_nodes.get() + counts.n_triangles.get()) as u32
}

fn add(pixel_features: &mut [Feature], ray: &PathRay, n_steps: u32) {
    let feature = &mut pixel_features[ray.pixel_ix as usize];
    feature.n_rays += 1;
    feature.n_steps += n_steps;
}
