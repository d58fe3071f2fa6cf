//! Path accumulate: the mean of all samples. Twin of `path_accumulate.comp`, which describes the sums.

use glam::Vec4;

use crate::layout::Frame;

/// Adds the frame's sums `pixel_radiance` to `sums`, which grows if it has to, and replaces them by the means of all
/// samples.
pub fn path_accumulate(frame: &Frame, pixel_radiance: &mut [[f32; 4]], sums: &mut Vec<[f32; 4]>) {
    let n_earlier = frame.n_samples - (1 << frame.samples_log2);
    let n_joined = (n_earlier >> frame.samples_log2).trailing_ones();
    let n_kept = (n_earlier.count_ones() - n_joined) as usize;
    let stride = pixel_radiance.len();
    if sums.len() < (n_kept + 1) * stride {
        sums.resize((n_kept + 1) * stride, [0.0; 4]);
    }
    for (pixel_ix, radiance) in pixel_radiance.iter_mut().enumerate() {
        let mut sum = Vec4::from_array(*radiance);
        for place in (n_kept..n_kept + n_joined as usize).rev() {
            sum += Vec4::from_array(sums[place * stride + pixel_ix]);
        }
        sums[n_kept * stride + pixel_ix] = sum.to_array();
        for place in (0..n_kept).rev() {
            sum += Vec4::from_array(sums[place * stride + pixel_ix]);
        }
        *radiance = (sum * frame.samples_reciprocal).to_array();
    }
}
