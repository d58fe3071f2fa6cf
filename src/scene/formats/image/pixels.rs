//! Pixels of decoders as pixels of images: four channels of 8 bits or of half-precision floats.

use ::image::DynamicImage;

use crate::scene::model::{Pixels, error::Checked, texture::half_bits};

/// Returns decoded pixels with four channels. Grey is spread to red, green and blue, and opacity is 1 where there is
/// none. `is_premultiplied`: the colours have been multiplied by the opacity, and are divided by it.
pub(super) fn of_dynamic(decoded: DynamicImage, is_premultiplied: bool) -> Checked<Pixels> {
    let short = |value: u16| f32::from(value) / 65_535.0;
    Ok(match decoded {
        DynamicImage::ImageLuma8(it) => Pixels::Bytes(it.iter().map(|&l| [l, l, l, 255]).collect()),
        DynamicImage::ImageLumaA8(it) => {
            Pixels::Bytes(it.as_raw().as_chunks().0.iter().map(|&[l, a]| [l, l, l, a]).collect())
        }
        DynamicImage::ImageRgb8(it) => {
            Pixels::Bytes(it.as_raw().as_chunks().0.iter().map(|&[r, g, b]| [r, g, b, 255]).collect())
        }
        DynamicImage::ImageRgba8(it) => Pixels::Bytes(it.as_raw().as_chunks().0.to_vec()),
        DynamicImage::ImageLuma16(it) => halves(it.iter().map(|&l| [l; 3].map(short)).map(opaque)),
        DynamicImage::ImageLumaA16(it) => {
            halves(it.as_raw().as_chunks().0.iter().map(|&[l, a]| [l, l, l, a].map(short)))
        }
        DynamicImage::ImageRgb16(it) => {
            halves(it.as_raw().as_chunks::<3>().0.iter().map(|rgb| rgb.map(short)).map(opaque))
        }
        DynamicImage::ImageRgba16(it) => halves(it.as_raw().as_chunks::<4>().0.iter().map(|rgba| rgba.map(short))),
        DynamicImage::ImageRgb32F(it) => halves(it.as_raw().as_chunks().0.iter().copied().map(opaque)),
        DynamicImage::ImageRgba32F(it) => {
            let divided = |rgba| if is_premultiplied { unmultiplied(rgba) } else { rgba };
            halves(it.as_raw().as_chunks().0.iter().copied().map(divided))
        }
        other => return Err(format!("has colours of the type {:?}, which is not read", other.color())),
    })
}

/// Returns pixels of half-precision floats, all of which are finite.
pub(super) fn halves(pixels: impl Iterator<Item = [f32; 4]>) -> Pixels {
    Pixels::Halves(pixels.map(|rgba| rgba.map(half_bits)).collect())
}

fn opaque([r, g, b]: [f32; 3]) -> [f32; 4] {
    [r, g, b, 1.0]
}

/// Divides the colour by the opacity. The colour of light without a surface, whose opacity is 0, stays.
fn unmultiplied([r, g, b, a]: [f32; 4]) -> [f32; 4] {
    if a > 0.0 { [r / a, g / a, b / a, a] } else { [r, g, b, a] }
}
