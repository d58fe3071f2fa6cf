//! Random numbers of a path: Sobol points, scrambled by Owen's method. Twin of `sampler.glsl`, which says how they are
//! made.

use glam::{UVec2, Vec2, vec2};

/// What the random numbers of a path depend on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SampleKey {
    /// Hash of the pixel of the whole picture.
    pub pixel: u32,
    /// Index of the sample in its pixel.
    pub sample_ix: u32,
}

/// Mixes the bits of a number.
pub fn mixed(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// The key of a sample of a pixel of the whole picture.
pub fn sample_key(pixel: UVec2, sample_ix: u32) -> SampleKey {
    SampleKey { pixel: mixed(pixel.x ^ mixed(pixel.y.wrapping_add(0x9e37_79b9))), sample_ix }
}

/// Flips each bit by a hash of the bits below it.
fn flipped_by_lower_bits(mut x: u32, seed: u32) -> u32 {
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^ x.wrapping_mul(0x53a2_2864)
}

/// The second Sobol coordinate of a point of this index, with its bits reversed.
fn second_coordinate_reversed(mut x: u32) -> u32 {
    x ^= (x >> 1) & 0x5555_5555;
    x ^= (x >> 2) & 0x3333_3333;
    x ^= (x >> 4) & 0x0f0f_0f0f;
    x ^= (x >> 8) & 0x00ff_00ff;
    x ^ ((x >> 16) & 0x0000_ffff)
}

/// The number in [0, 1) with these binary digits, the first of them in the highest bit.
pub fn unit_number(digits: u32) -> f32 {
    (digits >> 8) as f32 * (1.0 / (1 << 24) as f32)
}

/// The pair of random numbers at a place of the path, each in [0, 1).
pub fn random_pair(key: SampleKey, place: u32) -> Vec2 {
    let seed = mixed(key.pixel ^ mixed(place.wrapping_add(0x632b_e5ab)));
    let shuffled = flipped_by_lower_bits(key.sample_ix.reverse_bits(), seed).reverse_bits();
    let x = flipped_by_lower_bits(shuffled, mixed(seed ^ 0x68bc_21eb));
    let y = flipped_by_lower_bits(second_coordinate_reversed(shuffled), mixed(seed ^ 0x02e5_be93));
    vec2(unit_number(x.reverse_bits()), unit_number(y.reverse_bits()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Direction numbers of the second Sobol dimension: each is the one before, xor itself shifted down by one.
    #[test]
    fn the_second_coordinate_is_that_of_sobol() {
        for ix in [0, 1, 2, 3, 4, 5, 6, 7, 100, 12_345, 0xffff_ffff, 0x8000_0001] {
            let (mut digits, mut direction) = (0_u32, 1_u32 << 31);
            for bit in 0..32 {
                if ix >> bit & 1 == 1 {
                    digits ^= direction;
                }
                direction ^= direction >> 1;
            }
            assert_eq!(second_coordinate_reversed(ix).reverse_bits(), digits, "{ix}");
        }
    }

    /// Whether every rectangle of area 2^-n, of all shapes, has one of 2^n points.
    fn is_net(points: &[Vec2]) -> bool {
        let n = points.len().ilog2();
        (0..=n).all(|log2| {
            let (columns, rows) = (1 << log2, 1 << (n - log2));
            let mut taken = vec![false; points.len()];
            points.iter().all(|point| {
                let (x, y) = ((point.x * columns as f32) as usize, (point.y * rows as f32) as usize);
                !std::mem::replace(&mut taken[y * columns + x], true)
            })
        })
    }

    #[test]
    fn aligned_samples_are_spread_evenly() {
        for (pixel, place) in [(UVec2::ZERO, 0), (UVec2::new(1023, 5), 3), (UVec2::new(7, 767), 1000)] {
            for (first, n) in [(0, 1), (0, 16), (16, 16), (64, 64), (1 << 20, 256), (0, 4096)] {
                let points: Vec<_> = (first..first + n).map(|i| random_pair(sample_key(pixel, i), place)).collect();
                assert!(is_net(&points), "{pixel} {place}: {first}..{}", first + n);
            }
        }
        // The test can fail: two equal points, and points of different pixels.
        assert!(!is_net(&[vec2(0.1, 0.1), vec2(0.2, 0.9)]));
        let strangers: Vec<_> = (0..64).map(|i| random_pair(sample_key(UVec2::new(i, 0), i), 0)).collect();
        assert!(!is_net(&strangers));
    }

    /// Pairs of different places, pixels and neighbouring samples are independent: their products have mean 1/4.
    #[test]
    fn pairs_are_independent() {
        let mean = |product: &dyn Fn(u32) -> f32| {
            let n = 1 << 14;
            (0..n).map(|i| f64::from(product(i))).sum::<f64>() / f64::from(n)
        };
        let at = |x, i, place| random_pair(sample_key(UVec2::new(x, 9), i), place);
        // The standard error of the mean of 2^14 products of independent numbers is 0.0017.
        let close = |mean: f64| (mean - 0.25).abs() < 0.0085;
        assert!(close(mean(&|i| at(3, i, 0).x * at(3, i, 1).x)));
        assert!(close(mean(&|i| at(3, i, 0).y * at(3, i, 1).y)));
        assert!(close(mean(&|i| at(i, 0, 0).x * at(i + 1, 0, 0).x)));
        assert!(close(mean(&|i| at(i, 1, 5).x * at(i, 1, 5).y)));
        assert!(!close(mean(&|i| at(3, i, 0).x * at(3, i, 0).x)), "a number and itself are not independent");
    }
}
