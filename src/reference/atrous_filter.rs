//! Edge filter: one iteration of the noise filter `edge`, an edge-avoiding à-trous wavelet transform that is guided by
//! variance. Twin of `atrous_filter.comp`, which names the papers.

use glam::{Vec4, Vec4Swizzles};
use rayon::prelude::*;

use super::{edge::surface_weight, noise::luminance_of};
use crate::layout::{AtrousIteration, Auxiliary, Frame, N_ATROUS_ITERATIONS};

/// How many standard deviations of noise the luminances of two pixels of one sample may differ until the weight has
/// fallen to 1 / e.
const DEVIATIONS: f32 = 8.0;
/// The power of the number of samples by which these deviations are multiplied.
const DEVIATIONS_POWER: f32 = -0.4;
/// The factor on these deviations for perfectly glossy surfaces.
const GLOSSY_DEVIATIONS: f32 = 0.25;
/// The variance of another pixel counts up to this multiple of the pixel's own, which is 1 for perfectly glossy
/// surfaces.
const MOST_OF_OTHER: f32 = 4.0;
/// A variance that is less than any noise of interest. It keeps quotients finite where there is no noise at all.
const LEAST_VARIANCE: f32 = 1e-16;
/// The weights of the five pixels in a row: a B-spline.
const SPLINE: [f32; 3] = [0.375, 0.25, 0.0625];

/// The pixels that an iteration reads.
struct Source<'a> {
    size: [i32; 2],
    /// Standard deviations of noise that the luminances of two pixels may differ.
    deviations: f32,
    iteration_ix: u32,
    aux: &'a [Auxiliary],
    light: &'a [[f32; 4]],
}

/// Takes an iteration. `pixel_filtered`: two halves, each as long as the window has pixels. Even iterations read the
/// second half and write the first one.
pub fn atrous_filter(
    frame: &Frame,
    iteration: &AtrousIteration,
    pixel_aux: &[Auxiliary],
    pixel_filtered: &mut [[f32; 4]],
) {
    let width = frame.width as usize;
    let n_pixels = width * frame.height as usize;
    let (first, second) = pixel_filtered[..2 * n_pixels].split_at_mut(n_pixels);
    let (from, to) = if iteration.iteration_ix.is_multiple_of(2) { (second, first) } else { (first, second) };
    let size = [frame.width as i32, frame.height as i32];
    let deviations = DEVIATIONS * (frame.n_samples as f32).powf(DEVIATIONS_POWER);
    let source = Source { size, deviations, iteration_ix: iteration.iteration_ix, aux: pixel_aux, light: from };
    to.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        for (x, light) in row.iter_mut().enumerate() {
            *light = source.filtered(x as i32, y as i32).to_array();
        }
    });
}

/// GLSL's `mix`.
fn mix(a: f32, b: f32, weight: f32) -> f32 {
    a * (1.0 - weight) + b * weight
}

impl Source<'_> {
    fn filtered(&self, x: i32, y: i32) -> Vec4 {
        let light = self.mean_around(x, y);
        if self.iteration_ix + 1 < N_ATROUS_ITERATIONS {
            return light;
        }
        let aux = &self.aux[self.index_of(x, y).expect("a pixel of the window")];
        (light.xyz() * aux.albedo + aux.seen).extend(1.0)
    }

    /// Returns the pixel's index, or none outside of the window.
    fn index_of(&self, x: i32, y: i32) -> Option<usize> {
        let [width, height] = self.size;
        ((0..width).contains(&x) && (0..height).contains(&y)).then_some((y * width + x) as usize)
    }

    /// Returns the variance of the light at a pixel, as the mean of 3 x 3 pixels that show a surface.
    fn variance_at(&self, x: i32, y: i32) -> f32 {
        let (mut weights, mut variance) = (0.0, 0.0);
        for (dx, dy) in (-1..=1_i32).flat_map(|dy| (-1..=1_i32).map(move |dx| (dx, dy))) {
            let Some(other_ix) = self.index_of(x + dx, y + dy).filter(|&ix| self.aux[ix].n_hits > 0) else {
                continue;
            };
            let weight = ((2 - dx.abs()) * (2 - dy.abs())) as f32;
            weights += weight;
            variance += weight * self.light[other_ix][3];
        }
        if weights > 0.0 { variance / weights } else { 0.0 }
    }

    /// Returns the mean of the light, and the variance of its luminance.
    fn mean_around(&self, x: i32, y: i32) -> Vec4 {
        let pixel_ix = self.index_of(x, y).expect("a pixel of the window");
        let (aux, light) = (&self.aux[pixel_ix], Vec4::from(self.light[pixel_ix]));
        let deviations = self.deviations * mix(1.0, GLOSSY_DEVIATIONS, aux.gloss);
        let variance = self.variance_at(x, y);
        let most = mix(MOST_OF_OTHER, 1.0, aux.gloss) * variance;
        let luminance = luminance_of(light.xyz());
        let (mut weights, mut sum) = (0.0, Vec4::ZERO);
        for (dx, dy) in (-2..=2_i32).flat_map(|dy| (-2..=2_i32).map(move |dx| (dx, dy))) {
            let Some(other_ix) = self.index_of(x + (dx << self.iteration_ix), y + (dy << self.iteration_ix)) else {
                continue;
            };
            let found = Vec4::from(self.light[other_ix]);
            let spline = SPLINE[dx.unsigned_abs() as usize] * SPLINE[dy.unsigned_abs() as usize];
            let mut weight = spline * surface_weight(aux, &self.aux[other_ix]);
            let tolerance = deviations * (variance + most.min(found.w) + LEAST_VARIANCE).sqrt();
            weight *= (-(luminance_of(found.xyz()) - luminance).abs() / tolerance).exp();
            weights += weight;
            sum += (weight * found.xyz()).extend(weight * weight * found.w);
        }
        if weights > 0.0 { sum.with_w(sum.w / weights) / weights } else { light }
    }
}
