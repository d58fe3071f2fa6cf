//! Path begin: the camera rays of a batch's paths. Twin of `path_begin.comp`.

use rayon::prelude::*;

use super::{
    inputs::KernelInputs,
    path_camera::path_camera_ray,
    paths::{key_of_path, pixel_of_path},
    sampler::random_pair,
};
use crate::layout::{Batch, PathRay};

/// Writes the camera ray of each path.
pub fn path_begin(inputs: &KernelInputs, batch: &Batch, rays: &mut [PathRay]) {
    rays.par_iter_mut().enumerate().for_each(|(path_ix, ray)| {
        let pixel = pixel_of_path(inputs.frame(), batch, path_ix as u32);
        let key = key_of_path(inputs, path_ix as u32, pixel);
        *ray = path_camera_ray(inputs, pixel, random_pair(key, 0), random_pair(key, 1));
    });
}
