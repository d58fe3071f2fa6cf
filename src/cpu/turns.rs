//! Sines and cosines of sixteen angles in turns, which are those of the [reference](crate::reference::turns), bit for
//! bit.

use std::f32::consts::FRAC_PI_2;

use fearless_simd::{Simd, f32x16, prelude::*};

use crate::reference::turns::sin_cos_near_zero;

/// Does what the reference's `sin_cos_of_turns` does for each angle.
#[inline(always)]
pub fn sin_cos_of_turns<S: Simd>(turns: f32x16<S>) -> (f32x16<S>, f32x16<S>) {
    let quarters = turns * 4.0;
    let nearest = (quarters + 0.5).floor();
    let (sine, cosine) = sin_cos_near_zero((quarters - nearest) * FRAC_PI_2);
    let quadrant = nearest - (nearest * 0.25).floor() * 4.0;
    let is_odd = quadrant.simd_eq(1.0) | quadrant.simd_eq(3.0);
    let (sine, cosine) = (is_odd.select(cosine, sine), is_odd.select(sine, cosine));
    let negates_cosine = quadrant.simd_eq(1.0) | quadrant.simd_eq(2.0);
    (quadrant.simd_ge(2.0).select(-sine, sine), negates_cosine.select(-cosine, cosine))
}

#[cfg(test)]
mod tests {
    use fearless_simd::{Level, dispatch};

    use super::*;
    use crate::{cpu::lanes::LANES, reference::turns};

    #[test]
    fn sines_and_cosines_are_those_of_the_reference() {
        for i in -9000..9000 {
            let turns: [f32; LANES] = std::array::from_fn(|lane| (LANES as i32 * i + lane as i32) as f32 / 44_444.0);
            for simd_level in [Level::new(), Level::baseline()] {
                let (sines, cosines) = dispatch!(simd_level, simd => {
                    let (sines, cosines) = sin_cos_of_turns(f32x16::load_array_ref(simd, &turns));
                    (sines.to_array(), cosines.to_array())
                });
                for (turns, found) in turns.iter().zip(sines.iter().zip(&cosines)) {
                    let (sine, cosine) = turns::sin_cos_of_turns(*turns);
                    assert_eq!((found.0.to_bits(), found.1.to_bits()), (sine.to_bits(), cosine.to_bits()), "{turns}");
                }
            }
        }
    }
}
