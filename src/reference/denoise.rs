//! Denoise (the paper's section 2.4): smooths pixels that differ strongly from their neighbours. Twin of
//! `denoise.comp`.

use glam::Vec4;
use rayon::prelude::*;

use super::display::luminance;
use crate::layout::Frame;

/// Writes `pixel_filtered`. If the luminance differences of a pixel to its four neighbours add up to more than the
/// threshold, the result is the mean of the five; else it is the pixel itself.
pub fn denoise(frame: &Frame, pixel_radiance: &[[f32; 4]], pixel_filtered: &mut [[f32; 4]]) {
    let (width, height) = (frame.width as usize, frame.height as usize);
    pixel_filtered.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        for (x, filtered) in row.iter_mut().enumerate() {
            // At the border, the pixel itself replaces a missing neighbour.
            let (left, right) = (x.max(1) - 1, (x + 1).min(width - 1));
            let (above, below) = (y.max(1) - 1, (y + 1).min(height - 1));
            let at = |x: usize, y: usize| Vec4::from(pixel_radiance[y * width + x]);
            *filtered = filter(frame, at(x, y), [at(left, y), at(right, y), at(x, above), at(x, below)]).to_array();
        }
    });
}

fn filter(frame: &Frame, centre: Vec4, neighbours: [Vec4; 4]) -> Vec4 {
    let luminance = |pixel: Vec4| luminance(pixel.truncate(), frame.exposure);
    let mut difference = 0.0;
    let mut sum = centre;
    for neighbour in neighbours {
        difference += (luminance(neighbour) - luminance(centre)).abs();
        sum += neighbour;
    }
    if difference > frame.denoise_threshold { sum / 5.0 } else { centre }
}
