//! A test of sampled directions against their pdf, for the tests of surfaces and of emitters.

use std::f32::consts::{PI, TAU};

use glam::{Vec3, vec3};

/// A deviation that a correct sampler exceeds once in 10^6 tests. The random numbers of tests are always the same.
pub const LARGEST_DEVIATION: f64 = 4.75;

/// Cells of the sphere of directions, equal in solid angle.
const N_COSINES: usize = 24;
const N_AZIMUTHS: usize = 24;

fn cell_of(direction: Vec3) -> usize {
    let row = ((direction.z + 1.0) / 2.0 * N_COSINES as f32) as usize;
    let column = ((direction.y.atan2(direction.x) / TAU + 0.5) * N_AZIMUTHS as f32) as usize;
    row.min(N_COSINES - 1) * N_AZIMUTHS + column.min(N_AZIMUTHS - 1)
}

/// Returns the integral of a pdf over each cell, by `n` x `n` points.
pub fn probabilities(n: usize, pdf: &dyn Fn(Vec3) -> f32) -> Vec<f64> {
    let point = |cell: usize, i: usize| {
        let (row, column) = (cell / N_AZIMUTHS, cell % N_AZIMUTHS);
        let part = |ix: usize, sub: usize, of: usize| (ix as f32 + (sub as f32 + 0.5) / n as f32) / of as f32;
        let z = 2.0 * part(row, i / n, N_COSINES) - 1.0;
        let azimuth = (part(column, i % n, N_AZIMUTHS) - 0.5) * TAU;
        let sine = (1.0 - z * z).sqrt();
        vec3(sine * azimuth.cos(), sine * azimuth.sin(), z)
    };
    let cell_angle = f64::from(4.0 * PI) / (N_COSINES * N_AZIMUTHS) as f64;
    let mean = |cell: usize| (0..n * n).map(|i| f64::from(pdf(point(cell, i)))).sum::<f64>() / (n * n) as f64;
    (0..N_COSINES * N_AZIMUTHS).map(|cell| mean(cell) * cell_angle).collect()
}

/// A generator of uniform numbers (SplitMix64; Steele et al., 2014).
pub struct Uniform(pub u64);

impl Uniform {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / (1 << 24) as f32
    }

    pub fn point(&mut self) -> Vec3 {
        vec3(self.next(), self.next(), self.next())
    }
}

/// Compares directions that are sampled with their pdf, by Pearson's chi-square test. Cells that expect fewer than
/// 10 samples are put together, and so are the delta samples and absorbed samples, which are the rest. Returns how many
/// standard deviations chi-square is above its mean, by the cube root that is normally distributed (Wilson, Hilferty,
/// 1931). `n`: the number of samples. `n_points`: the number of points along each side of a cell at which the pdf
/// is integrated.
pub fn chi_square(
    (n, n_points): (usize, usize),
    sample: &mut dyn FnMut() -> Option<Vec3>,
    pdf: &dyn Fn(Vec3) -> f32,
) -> f64 {
    let expected = probabilities(n_points, pdf);
    let mut counts = vec![0.0_f64; expected.len() + 1];
    for _ in 0..n {
        counts[sample().map_or(expected.len(), cell_of)] += 1.0;
    }
    let rest = (1.0 - expected.iter().sum::<f64>()).max(0.0);
    let expected: Vec<f64> = expected.into_iter().chain([rest]).collect();
    deviations(&counts, &expected)
}

/// Compares counts of samples with the probabilities of what was sampled, as [`chi_square`] does.
pub fn deviations(counts: &[f64], probabilities: &[f64]) -> f64 {
    let n: f64 = counts.iter().sum();
    let (mut chi, mut n_cells, mut few) = (0.0, 0.0, (0.0, 0.0));
    for (count, probability) in counts.iter().zip(probabilities) {
        let expected = probability * n;
        if expected < 10.0 {
            few = (few.0 + count, few.1 + expected);
        } else {
            chi += (count - expected).powi(2) / expected;
            n_cells += 1.0;
        }
    }
    chi += (few.0 - few.1).powi(2) / few.1.max(10.0);
    let k: f64 = n_cells;
    ((chi / k).cbrt() - (1.0 - 2.0 / (9.0 * k))) / (2.0 / (9.0 * k)).sqrt()
}
