//! The random numbers of sixteen paths together. They are those of the reference's
//! [sampler](crate::reference::sampler), bit for bit.

use fearless_simd::{Simd, f32x16, prelude::*, u32x16};

use super::lanes::LANES;
use crate::reference::sampler::{SampleKey, mixed as mixed_alone};

/// The sample keys of sixteen paths.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub struct KeysSoa {
    pub pixel: [u32; LANES],
    pub sample_ix: [u32; LANES],
}

/// A pair of random numbers for each of sixteen paths.
pub type PairsSoa = [[f32; LANES]; 2];

impl KeysSoa {
    #[inline(always)]
    pub fn set(&mut self, lane: usize, key: SampleKey) {
        self.pixel[lane] = key.pixel;
        self.sample_ix[lane] = key.sample_ix;
    }
}

#[inline(always)]
fn mixed<S: Simd>(mut x: u32x16<S>) -> u32x16<S> {
    x ^= x >> 16;
    x *= 0x7feb_352d;
    x ^= x >> 15;
    x *= 0x846c_a68b;
    x ^ (x >> 16)
}

#[inline(always)]
fn flipped_by_lower_bits<S: Simd>(mut x: u32x16<S>, seed: u32x16<S>) -> u32x16<S> {
    x ^= x * 0x3d20_adea;
    x += seed;
    x *= (seed >> 16) | 1;
    x ^= x * 0x0552_6c56;
    x ^ (x * 0x53a2_2864)
}

#[inline(always)]
fn second_coordinate_reversed<S: Simd>(mut x: u32x16<S>) -> u32x16<S> {
    x ^= (x >> 1) & 0x5555_5555;
    x ^= (x >> 2) & 0x3333_3333;
    x ^= (x >> 4) & 0x0f0f_0f0f;
    x ^= (x >> 8) & 0x00ff_00ff;
    x ^ (x >> 16)
}

/// Reverses the order of bits.
#[inline(always)]
fn reversed<S: Simd>(mut x: u32x16<S>) -> u32x16<S> {
    x = ((x >> 1) & 0x5555_5555) | ((x & 0x5555_5555) << 1);
    x = ((x >> 2) & 0x3333_3333) | ((x & 0x3333_3333) << 2);
    x = ((x >> 4) & 0x0f0f_0f0f) | ((x & 0x0f0f_0f0f) << 4);
    x = ((x >> 8) & 0x00ff_00ff) | ((x & 0x00ff_00ff) << 8);
    (x >> 16) | (x << 16)
}

#[inline(always)]
fn unit_number<S: Simd>(digits: u32x16<S>) -> [f32; LANES] {
    let numbers: f32x16<S> = digits.simd.cvt_f32_u32x16(digits >> 8);
    (numbers * (1.0 / (1 << 24) as f32)).to_array()
}

/// Returns the pairs of random numbers at `N` places of each path, from `first_place` on.
#[inline(always)]
pub fn random_pairs<S: Simd, const N: usize>(simd: S, keys: &KeysSoa, first_place: u32) -> [PairsSoa; N] {
    let pixel = u32x16::load_array_ref(simd, &keys.pixel);
    let sample_ix = reversed(u32x16::load_array_ref(simd, &keys.sample_ix));
    let mut pairs = [[[0.0; LANES]; 2]; N];
    for (place, pair) in (first_place..).zip(&mut pairs) {
        let seed = mixed(pixel ^ mixed_alone(place.wrapping_add(0x632b_e5ab)));
        let shuffled = reversed(flipped_by_lower_bits(sample_ix, seed));
        let x = flipped_by_lower_bits(shuffled, mixed(seed ^ 0x68bc_21eb));
        let y = flipped_by_lower_bits(second_coordinate_reversed(shuffled), mixed(seed ^ 0x02e5_be93));
        *pair = [unit_number(reversed(x)), unit_number(reversed(y))];
    }
    pairs
}

#[cfg(test)]
mod tests {
    use fearless_simd::{Level, dispatch};

    use super::*;
    use crate::reference::sampler::random_pair;

    #[test]
    fn random_numbers_are_those_of_the_reference() {
        for first in [0, 1, 77, u32::MAX - 15] {
            let key = |lane: usize| {
                let n = mixed_alone(first.wrapping_add(lane as u32));
                SampleKey { pixel: n, sample_ix: if lane < 8 { lane as u32 } else { mixed_alone(n) } }
            };
            let mut keys = KeysSoa::default();
            (0..LANES).for_each(|lane| keys.set(lane, key(lane)));
            for first_place in [0, 2, 4097] {
                for simd_level in [Level::new(), Level::baseline()] {
                    let pairs: [_; 3] = dispatch!(simd_level, simd => random_pairs(simd, &keys, first_place));
                    for (place, [x, y]) in (first_place..).zip(&pairs) {
                        for lane in 0..LANES {
                            assert_eq!(random_pair(key(lane), place).to_array(), [x[lane], y[lane]]);
                        }
                    }
                }
            }
        }
    }
}
