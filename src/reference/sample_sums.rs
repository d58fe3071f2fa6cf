//! The sum of a pixel's samples of a frame, as a binary tree. Twin of `picture/sample_sums.glsl`.

use glam::Vec4;

use crate::layout::MOST_SAMPLES_LOG2;

/// Returns the sum of the values of `2^samples_log2` samples.
pub fn sum_of_samples(samples_log2: u32, value: impl Fn(u32) -> Vec4) -> Vec4 {
    let mut sums = [Vec4::ZERO; MOST_SAMPLES_LOG2 as usize + 1];
    for sample_ix in 0..1 << samples_log2 {
        let mut sum = value(sample_ix);
        let mut level = 0;
        while sample_ix >> level & 1 != 0 {
            sum += sums[level];
            level += 1;
        }
        sums[level] = sum;
    }
    sums[samples_log2 as usize]
}
