//! Primary hit (the paper's section 2.2): the camera's rays, and their hits on the triangles that visibility found.
//! Twin of `primary_hit.comp`.

use glam::{UVec2, Vec3};
use rayon::prelude::*;

use super::{
    RAYS_PER_TASK,
    camera::{camera_direction, camera_origin, pixel_of},
    inputs::KernelInputs,
    triangle::Shear,
};
use crate::layout::{Frame, Hit, NO_TRIANGLE, PathRay};

/// The camera ray through a pixel's sample.
pub fn camera_ray(frame: &Frame, pixel: UVec2) -> PathRay {
    PathRay {
        origin: camera_origin(frame, pixel),
        pixel_ix: pixel.y * frame.width + pixel.x,
        direction: camera_direction(frame, pixel),
        source_triangle: NO_TRIANGLE,
        throughput: Vec3::ONE,
        t_max: f32::INFINITY,
    }
}

/// Fills `rays` with the camera rays of the pixels from index `first_pixel` on, in the queue's order ([`pixel_of`]).
pub fn primary_rays(frame: &Frame, first_pixel: u32, rays: &mut [PathRay]) {
    rays.par_chunks_mut(RAYS_PER_TASK).enumerate().for_each(|(task, rays)| {
        for (order, ray) in (first_pixel + (task * RAYS_PER_TASK) as u32..).zip(rays) {
            *ray = camera_ray(frame, pixel_of(order, frame.width, frame.height));
        }
    });
}

/// Writes `hits`, one for each ray, from `triangle_ids` (one for each pixel, rows from the top). Returns the number
/// of rays that hit something.
pub fn primary_hit(inputs: &KernelInputs, triangle_ids: &[u32], rays: &[PathRay], hits: &mut [Hit]) -> u32 {
    let of_task = |(rays, hits): (&[PathRay], &mut [Hit])| {
        let mut n_hits = 0;
        for (ray, hit) in rays.iter().zip(hits) {
            let triangle_ix = triangle_ids[ray.pixel_ix as usize];
            *hit = Hit { t: f32::INFINITY, triangle_ix: NO_TRIANGLE, u: 0.0, v: 0.0 };
            if triangle_ix != NO_TRIANGLE {
                let shear = Shear::of(ray.origin.to_array(), ray.direction.to_array());
                *hit = shear.clamp_to_triangle(&inputs.triangle(triangle_ix), triangle_ix);
                n_hits += 1;
            }
        }
        n_hits
    };
    rays.par_chunks(RAYS_PER_TASK).zip(hits.par_chunks_mut(RAYS_PER_TASK)).map(of_task).sum()
}
