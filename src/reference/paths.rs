//! The paths of a batch. Twin of `rays/paths.glsl`.

use glam::UVec2;

use super::{
    camera::pixel_of,
    inputs::KernelInputs,
    noise_tiles::{first_sample_of, picture_pixel_of},
    sampler::{SampleKey, sample_key},
};
use crate::layout::{Batch, Frame};

/// The path of a pixel and of a sample of the frame. `place`: how many pixels of the batch come before the pixel.
pub fn path_of(frame: &Frame, place: u32, sample_ix: u32) -> u32 {
    (place << frame.samples_log2) + sample_ix
}

/// The index of a path's sample among those of the frame.
pub fn sample_of_path(frame: &Frame, path_ix: u32) -> u32 {
    path_ix % (1 << frame.samples_log2)
}

/// The place in the batch of a path's pixel.
pub fn place_of_path(frame: &Frame, path_ix: u32) -> u32 {
    path_ix >> frame.samples_log2
}

/// The window's pixel at a place in the batch.
pub fn pixel_at(frame: &Frame, batch: &Batch, place: u32) -> UVec2 {
    pixel_of(batch.first_pixel + place, frame.width, frame.height)
}

/// The window's pixel of a path.
pub fn pixel_of_path(frame: &Frame, batch: &Batch, path_ix: u32) -> UVec2 {
    pixel_at(frame, batch, place_of_path(frame, path_ix))
}

/// What the random numbers of a path depend on. `pixel`: the window's pixel.
pub fn key_of_path(inputs: &KernelInputs, path_ix: u32, pixel: UVec2) -> SampleKey {
    let frame = inputs.frame();
    let picture_pixel = picture_pixel_of(frame, inputs.noise_tiles, pixel);
    sample_key(picture_pixel, first_sample_of(frame, inputs.noise_tiles, pixel) + sample_of_path(frame, path_ix))
}
