//! Sines and cosines of angles in turns. They are computed here, and not by the platform's library, so that sixteen
//! angles that are computed together (`cpu/turns.rs`) have the same bits as one. Kernels use the `sin` and `cos` of the
//! device.

use std::{
    f32::consts::FRAC_PI_2,
    ops::{Add, Mul},
};

/// Returns the sine and the cosine of an angle of at most about pi/4, in radians. They are Taylor series, which end
/// where the next term is below the rounding of a float. `T`: one float, or several that are computed together.
#[inline(always)]
pub fn sin_cos_near_zero<T>(angle: T) -> (T, T)
where
    T: Copy + Mul<Output = T> + Mul<f32, Output = T> + Add<f32, Output = T>,
{
    let squared = angle * angle;
    let of_sine = squared * (1.0 / 362_880.0) + -1.0 / 5040.0;
    let of_sine = squared * (squared * (squared * of_sine + 1.0 / 120.0) + -1.0 / 6.0) + 1.0;
    let of_cosine = squared * (1.0 / 40_320.0) + -1.0 / 720.0;
    let cosine = squared * (squared * (squared * of_cosine + 1.0 / 24.0) + -0.5) + 1.0;
    (angle * of_sine, cosine)
}

/// Returns the sine and the cosine of an angle in turns. Its magnitude must be below 2^20.
pub fn sin_cos_of_turns(turns: f32) -> (f32, f32) {
    let quarters = 4.0 * turns;
    let nearest = (quarters + 0.5).floor();
    let (sine, cosine) = sin_cos_near_zero((quarters - nearest) * FRAC_PI_2);
    let quadrant = nearest - 4.0 * (0.25 * nearest).floor();
    let is_odd = quadrant == 1.0 || quadrant == 3.0;
    let (sine, cosine) = if is_odd { (cosine, sine) } else { (sine, cosine) };
    let cosine = if quadrant == 1.0 || quadrant == 2.0 { -cosine } else { cosine };
    (if quadrant >= 2.0 { -sine } else { sine }, cosine)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    #[test]
    fn errors_are_as_small_as_roundings() {
        for i in -200_000..200_000 {
            let turns = i as f32 / 77_777.0;
            let (sine, cosine) = sin_cos_of_turns(turns);
            let (exact_sine, exact_cosine) = (TAU * f64::from(turns)).sin_cos();
            let error = (f64::from(sine) - exact_sine).abs().max((f64::from(cosine) - exact_cosine).abs());
            assert!(error < 1.2e-7, "{turns}: {error}");
        }
        // Sines of small angles keep all their digits.
        for turns in (1..100).map(|i| 0.8_f32.powi(i) / 8.0) {
            let exact = (TAU * f64::from(turns)).sin();
            assert!((f64::from(sin_cos_of_turns(turns).0) / exact - 1.0).abs() < 2e-7, "{turns}");
        }
        let exact = [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)];
        for (i, expected) in exact.into_iter().enumerate() {
            assert_eq!(sin_cos_of_turns(0.25 * i as f32), expected);
            assert_eq!(sin_cos_of_turns(0.25 * i as f32 - 1.0), expected);
        }
    }
}
