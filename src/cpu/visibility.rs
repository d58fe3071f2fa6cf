//! Visibility (the paper's section 2.2): the triangle that each pixel shows. The kernels rasterize; here the camera's
//! rays go through the kd-tree, which is what the rasterizer's answer means.

use rayon::prelude::*;

use super::{RAYS_PER_TASK, bindings::Bindings, kdtree::Traverser, primary_hit::camera_ray};
use crate::frame::Traversal;

/// Writes `triangle_ids` (`width * height`, rows from the top): the nearest triangle, or `NO_TRIANGLE`.
pub fn visibility(bindings: &Bindings, traversal: Traversal, triangle_ids: &mut [u32]) {
    let width = bindings.frame.width;
    triangle_ids.par_chunks_mut(RAYS_PER_TASK).enumerate().for_each_init(
        || Traverser::new(traversal),
        |traverser, (task, ids)| {
            for (pixel_ix, id) in (task * RAYS_PER_TASK..).zip(ids) {
                let pixel = glam::uvec2(pixel_ix as u32 % width, pixel_ix as u32 / width);
                *id = traverser.closest_hit(bindings, &camera_ray(bindings.frame, pixel)).triangle_ix;
            }
        },
    );
}
