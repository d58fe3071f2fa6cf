//! Demodulate: the light on the surface that each pixel shows, apart from the surface's albedo, and the variance of
//! this light. Twin of `demodulate.comp`.

use glam::{Vec3, Vec4, Vec4Swizzles};
use rayon::prelude::*;

use super::{
    edge::{LEAST_ALBEDO, light_on, surface_weight},
    noise::{luminance_of, variance_of_mean},
};
use crate::layout::{Auxiliary, Frame};

/// The radius of the square in which the variance is estimated, pixels.
const RADIUS: usize = 3;

/// The pixels that the pass reads.
struct Pixels<'a> {
    frame: &'a Frame,
    radiance: &'a [[f32; 4]],
    aux: &'a [Auxiliary],
}

/// Writes the second half of `pixel_filtered`: the light of each pixel, and the variance of its luminance.
pub fn demodulate(
    frame: &Frame,
    pixel_radiance: &[[f32; 4]],
    pixel_aux: &[Auxiliary],
    pixel_filtered: &mut [[f32; 4]],
) {
    let width = frame.width as usize;
    let pixels = Pixels { frame, radiance: pixel_radiance, aux: pixel_aux };
    let light = &mut pixel_filtered[width * frame.height as usize..];
    light.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        for (x, light) in row.iter_mut().enumerate() {
            *light = pixels.light_at(x, y).to_array();
        }
    });
}

impl Pixels<'_> {
    fn light_at(&self, x: usize, y: usize) -> Vec4 {
        let pixel_ix = y * self.frame.width as usize + x;
        let (radiance, aux) = (Vec4::from(self.radiance[pixel_ix]), &self.aux[pixel_ix]);
        let has_variance = self.frame.n_samples > 1;
        let variance = if has_variance { self.variance_of_samples(radiance, aux) } else { self.variance_around(x, y) };
        light_on(radiance.xyz(), aux).extend(variance)
    }

    /// Returns the variance of the light, as the pixels of the same surface around show it.
    fn variance_around(&self, x: usize, y: usize) -> f32 {
        let (width, height) = (self.frame.width as usize, self.frame.height as usize);
        let aux = &self.aux[y * width + x];
        let mut sums = Vec3::ZERO;
        for other_y in y.saturating_sub(RADIUS)..=(y + RADIUS).min(height - 1) {
            for other_x in x.saturating_sub(RADIUS)..=(x + RADIUS).min(width - 1) {
                let other_ix = other_y * width + other_x;
                let other = &self.aux[other_ix];
                let luminance = luminance_of(light_on(Vec4::from(self.radiance[other_ix]).xyz(), other));
                sums += surface_weight(aux, other) * Vec3::new(1.0, luminance, luminance * luminance);
            }
        }
        if sums.x > 0.0 { (sums.z / sums.x - (sums.y / sums.x).powi(2)).max(0.0) } else { 0.0 }
    }

    /// Returns the variance of the light, as the pixel's own samples show it. There are at least two of them.
    fn variance_of_samples(&self, radiance: Vec4, aux: &Auxiliary) -> f32 {
        let albedo = luminance_of(aux.albedo);
        if albedo <= LEAST_ALBEDO {
            return 0.0;
        }
        let scattered = (radiance.xyz() - aux.seen).max(Vec3::ZERO).extend(radiance.w - aux.seen_squared);
        variance_of_mean(scattered.to_array(), self.frame.n_samples) / (albedo * albedo)
    }
}
