//! Path resolve: the sums of the radiance of each pixel's paths, and of their squared luminance. Twin of
//! `path_resolve.comp`.

use glam::Vec4;

use super::{camera::pixel_ix_of, noise::squared_luminance, paths::pixel_of_path};
use crate::layout::{Batch, Frame, MOST_SAMPLES_LOG2, PathState};

/// Writes the pixels of the batch: the sum of the frame's samples, and in the fourth component that of their squared
/// luminances, added in a binary tree.
pub fn path_resolve(frame: &Frame, batch: &Batch, states: &[PathState], pixel_radiance: &mut [[f32; 4]]) {
    for pixel in 0..batch.n_pixels {
        let mut sums = [Vec4::ZERO; MOST_SAMPLES_LOG2 as usize + 1];
        for sample_ix in 0..1 << frame.samples_log2 {
            let radiance = states[(sample_ix * batch.n_pixels + pixel) as usize].radiance;
            let mut sum = radiance.extend(squared_luminance(radiance));
            let mut level = 0;
            while sample_ix >> level & 1 != 0 {
                sum += sums[level];
                level += 1;
            }
            sums[level] = sum;
        }
        let pixel_ix = pixel_ix_of(frame, pixel_of_path(frame, batch, pixel));
        pixel_radiance[pixel_ix as usize] = sums[frame.samples_log2 as usize].to_array();
    }
}
