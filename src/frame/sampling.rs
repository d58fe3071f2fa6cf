//! Positions of samples in their pixels.
//!
//! The rasterizer tests the same position in all pixels. So a frame is one sample of each pixel, all with the same
//! offset. Samples are distributed as the reconstruction filter is (M. Ernst, M. Stamminger, G. Greiner, Filter
//! Importance Sampling, 2006), so that all have the same weight and a pixel is their mean.

use glam::{DVec2, dvec2};

/// 2^32 / g and 2^32 / g^2, where g^3 = g + 1: the step of the R2 sequence (M. Roberts, The Unreasonable
/// Effectiveness of Quasirandom Sequences, 2018) in units of 2^-32.
const R2_STEP: [u32; 2] = [3_242_174_889, 2_447_445_414];

/// Returns the sample's offset from the centre of its pixel, px, -1 to 1 on each axis. The density of offsets is a
/// tent filter of radius 1 px. Sample 0 is at the centre.
pub fn sample_offset(sample_ix: u32) -> DVec2 {
    let [x, y] = R2_STEP.map(|step| tent(quasirandom(sample_ix, step)));
    dvec2(x, y)
}

/// Returns the base-2 logarithm of the number of samples that the next frame of paths draws, at most `most_log2`, if
/// `n_before` of `n_samples` samples are drawn. So all frames draw as many as they can, except for the last few.
pub fn samples_log2(n_before: u32, n_samples: u32, most_log2: u32) -> u32 {
    let n_left = n_samples.saturating_sub(n_before).max(1);
    n_left.ilog2().min(n_before.trailing_zeros()).min(most_log2)
}

/// Returns an element of the sequence, above 0 and below 1; 1/2 for index 0. The sequence repeats after 2^32
/// elements.
fn quasirandom(ix: u32, step: u32) -> f64 {
    let bits = (1_u32 << 31).wrapping_add(ix.wrapping_mul(step));
    f64::from(bits.max(1)) / (1_u64 << 32) as f64
}

/// Returns the inverse cumulative distribution of a tent over -1 to 1: the position that has the share `u` of the
/// tent's area to its left.
fn tent(u: f64) -> f64 {
    if u < 0.5 { (2.0 * u).sqrt() - 1.0 } else { 1.0 - (2.0 * (1.0 - u)).sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the share of a tent's area to the left of `x`.
    fn left_of(x: f64) -> f64 {
        0.5 + x - x * x.abs() / 2.0
    }

    #[test]
    fn the_first_sample_is_the_centre() {
        assert_eq!(sample_offset(0), DVec2::ZERO);
    }

    #[test]
    fn the_steps_are_the_plastic_numbers() {
        let g = 1.324_717_957_244_746_f64;
        assert!((g * g * g - g - 1.0).abs() < 1e-15);
        for (step, power) in R2_STEP.into_iter().zip([g, g * g]) {
            assert!((f64::from(step) - (1_u64 << 32) as f64 / power).abs() <= 0.5);
        }
    }

    #[test]
    fn offsets_lie_as_the_filter_weighs_them() {
        for u in [0.0, 1e-9, 0.1, 0.5, 0.77, 1.0] {
            assert!((left_of(tent(u)) - u).abs() < 1e-15);
        }
        // A tent has mean 0 and variance 1/6 on each axis, and its axes are independent.
        let n = 4096;
        let mean = |f: &dyn Fn(DVec2) -> f64| (0..n).map(|i| f(sample_offset(i))).sum::<f64>() / f64::from(n);
        assert!(mean(&|p| p.x).abs() < 1e-3 && mean(&|p| p.y).abs() < 1e-3);
        assert!((mean(&|p| p.x * p.x) - 1.0 / 6.0).abs() < 1e-3 && (mean(&|p| p.y * p.y) - 1.0 / 6.0).abs() < 1e-3);
        assert!(mean(&|p| p.x * p.y).abs() < 1e-3);
    }

    /// The first n samples are spread evenly, for any n: the share of samples below a coordinate differs from the
    /// tent's share by less than 3 / n, which random samples would exceed.
    #[test]
    fn few_samples_are_spread_evenly() {
        for n in [16, 64, 256, 1024] {
            let worst = |axis: &dyn Fn(DVec2) -> f64| {
                let off = |x: f64| {
                    let share = (0..n).filter(|&i| axis(sample_offset(i)) < x).count() as f64 / f64::from(n);
                    (share - left_of(x)).abs()
                };
                (-10..=10).map(|i| off(f64::from(i) / 10.0 + 0.03)).fold(0.0, f64::max)
            };
            let bound = 3.0 / f64::from(n);
            assert!(worst(&|p| p.x) < bound && worst(&|p| p.y) < bound, "{n}: {} {}", worst(&|p| p.x), worst(&|p| p.y));
        }
    }
}
