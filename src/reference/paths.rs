//! The paths of a batch. Twin of `paths.glsl`.

use glam::UVec2;

use super::{
    camera::pixel_of,
    inputs::KernelInputs,
    noise_tiles::{first_sample_of, picture_pixel_of},
    sampler::{SampleKey, sample_key},
};
use crate::layout::{Batch, Frame};

/// The window's pixel of a path.
pub fn pixel_of_path(frame: &Frame, batch: &Batch, path_ix: u32) -> UVec2 {
    pixel_of(batch.first_pixel + path_ix % batch.n_pixels, frame.width, frame.height)
}

/// What the random numbers of a path depend on. `pixel`: the window's pixel.
pub fn key_of_path(inputs: &KernelInputs, batch: &Batch, path_ix: u32, pixel: UVec2) -> SampleKey {
    let frame = inputs.frame();
    let picture_pixel = picture_pixel_of(frame, inputs.noise_tiles, pixel);
    sample_key(picture_pixel, first_sample_of(frame, inputs.noise_tiles, pixel) + path_ix / batch.n_pixels)
}
