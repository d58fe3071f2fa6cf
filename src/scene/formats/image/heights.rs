//! Normal maps from bump maps.

use rayon::prelude::*;

use crate::scene::model::{Channel, Image, Pixels};

/// Returns the normal map of a bump map, which repeats.
///
/// The height of the surface is `scale` times the image's value in a channel, in units in which the image is 1 wide and
/// 1 high. Its slopes follow from the differences between the next and the previous pixel, along a row and along a
/// column. As in a texture of normals, x is along u and y along decreasing v, and each channel c stands for 2 c - 1.
pub(crate) fn normals_of_heights(image: &Image, channel: Channel, scale: f32) -> Image {
    let (width, height) = (image.width as usize, image.height as usize);
    let value = |x: usize, y: usize| channel.of(image.pixels.get(y * width + x));
    let half_widths = [0.5 * scale * width as f32, 0.5 * scale * height as f32];
    let normal = |x: usize, y: usize| {
        let (left, right) = (value((x + width - 1) % width, y), value((x + 1) % width, y));
        let (above, below) = (value(x, (y + height - 1) % height), value(x, (y + 1) % height));
        let slope = [(right - left) * half_widths[0], (above - below) * half_widths[1]].map(finite);
        let length = (slope[0] * slope[0] + slope[1] * slope[1] + 1.0).sqrt();
        let stored = [-slope[0], -slope[1], 1.0].map(|c| (127.5 * (c / length) + 127.5).round() as u8);
        [stored[0], stored[1], stored[2], 255]
    };
    let mut pixels = vec![[0; 4]; width * height];
    pixels.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        row.iter_mut().enumerate().for_each(|(x, pixel)| *pixel = normal(x, y));
    });
    let name = format!("{} (normals)", image.name);
    Image { name, width: image.width, height: image.height, pixels: Pixels::Bytes(pixels), is_linear: false }
}

/// Bounds a slope such that its square is finite. NaN becomes 0.
fn finite(slope: f32) -> f32 {
    if slope.is_nan() { 0.0 } else { slope.clamp(-1e9, 1e9) }
}
