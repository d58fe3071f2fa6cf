//! Visibility (the paper's section 2.2): the triangle that each pixel shows. The device rasterizes; here the camera's
//! rays are traced, which defines what the rasterizer is to find.

use rayon::prelude::*;

use super::{
    RAYS_PER_TASK,
    inputs::KernelInputs,
    primary_hit::camera_ray,
    search_ray::SearchRay,
    traverser::{Tracer, Traverser},
};
use crate::accel::kdtree::Traversal;

/// Writes `triangle_ids` (`width * height`, rows from the top): the index of the nearest triangle, or `NO_TRIANGLE`.
pub fn visibility(inputs: &KernelInputs, traversal: Traversal, triangle_ids: &mut [u32]) {
    visibility_by(inputs, || Traverser::new(inputs, traversal), triangle_ids);
}

/// Does what [`visibility`] does, by tracers that `new_tracer` makes, at least one for each thread that works.
pub fn visibility_by<T: Tracer>(
    inputs: &KernelInputs,
    new_tracer: impl Fn() -> T + Sync + Send,
    triangle_ids: &mut [u32],
) {
    let (inputs, width) = (&inputs.of_camera(), inputs.frame().width);
    triangle_ids.par_chunks_mut(RAYS_PER_TASK).enumerate().for_each_init(new_tracer, |tracer, (task, ids)| {
        let search_rays = (task * RAYS_PER_TASK..).map(|pixel_ix| {
            let pixel = glam::uvec2(pixel_ix as u32 % width, pixel_ix as u32 / width);
            SearchRay::from(&camera_ray(inputs.frame(), pixel))
        });
        tracer.trace_all::<false, _>(inputs, ids.iter_mut().zip(search_rays), |id, hit| *id = hit.triangle_ix);
    });
}
