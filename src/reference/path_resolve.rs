//! Path resolve: the sum of the radiance of each pixel's paths. Twin of `path_resolve.comp`.

use glam::Vec3;

use super::{camera::pixel_ix_of, paths::pixel_of_path};
use crate::layout::{Batch, Frame, MOST_SAMPLES_LOG2, PathState};

/// Writes the pixels of the batch: the sum of the frame's samples, added in a binary tree.
pub fn path_resolve(frame: &Frame, batch: &Batch, states: &[PathState], pixel_radiance: &mut [[f32; 4]]) {
    for pixel in 0..batch.n_pixels {
        let mut sums = [Vec3::ZERO; MOST_SAMPLES_LOG2 as usize + 1];
        for sample_ix in 0..1 << frame.samples_log2 {
            let mut sum = states[(sample_ix * batch.n_pixels + pixel) as usize].radiance;
            let mut level = 0;
            while sample_ix >> level & 1 != 0 {
                sum += sums[level];
                level += 1;
            }
            sums[level] = sum;
        }
        let pixel_ix = pixel_ix_of(frame, pixel_of_path(frame, batch, pixel));
        pixel_radiance[pixel_ix as usize] = sums[frame.samples_log2 as usize].extend(1.0).to_array();
    }
}
