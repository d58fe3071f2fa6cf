//! Accumulate: averages the frame's sample with the earlier ones. Twin of `accumulate.comp`.

use glam::Vec4;
use rayon::prelude::*;

use crate::layout::{Bounce, Frame};

/// Adds the frame's sample, `pixel_radiance`, to the sums in `pixel_accumulated`, and replaces it by the mean of all
/// samples. Does nothing if a bounce overflowed, which the first of `bounces` says.
pub fn accumulate(
    frame: &Frame,
    bounces: &[Bounce],
    pixel_radiance: &mut [[f32; 4]],
    pixel_accumulated: &mut [[f32; 4]],
) {
    if bounces.first().is_some_and(|first| first.any_overflow != 0) {
        return;
    }
    pixel_radiance.par_iter_mut().zip(pixel_accumulated).with_min_len(1024).for_each(|(radiance, accumulated)| {
        let sum = Vec4::from(*accumulated) + Vec4::from(*radiance);
        *accumulated = sum.to_array();
        *radiance = (sum / frame.n_samples as f32).to_array();
    });
}
