//! Path resolve: the sums of the radiance of each pixel's paths, and of their squared luminance. Twin of
//! `path_resolve.comp`.

use super::{
    camera::pixel_ix_of,
    noise::squared_luminance,
    paths::{path_of, pixel_at},
    sample_sums::sum_of_samples,
};
use crate::layout::{Batch, Frame, PathState};

/// Writes the pixels of the batch: the sum of the frame's samples, and in the fourth component that of their squared
/// luminances, added in a binary tree.
pub fn path_resolve(frame: &Frame, batch: &Batch, states: &[PathState], pixel_radiance: &mut [[f32; 4]]) {
    for place in 0..batch.n_pixels {
        let sum = sum_of_samples(frame.samples_log2, |sample_ix| {
            let radiance = states[path_of(frame, place, sample_ix) as usize].radiance;
            radiance.extend(squared_luminance(radiance))
        });
        let pixel_ix = pixel_ix_of(frame, pixel_at(frame, batch, place));
        pixel_radiance[pixel_ix as usize] = sum.to_array();
    }
}
