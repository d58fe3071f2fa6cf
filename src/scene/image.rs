//! Images of textures, decoded.

use half::f16;
use image::{DynamicImage, ImageReader, Limits};
use rayon::prelude::*;

use super::texture::{Image, Pixels};

/// An image as its file holds it.
pub(super) struct Encoded {
    /// Name of the file, or of the image within its file, for messages.
    pub name: String,
    /// Content of the file.
    pub bytes: Vec<u8>,
}

/// Decodes images in parallel. The error of each is a message for people.
pub(super) fn decode_all(images: Vec<Encoded>) -> Vec<Result<Image, String>> {
    images.into_par_iter().map(decode).collect()
}

fn decode(image: Encoded) -> Result<Image, String> {
    let reader = ImageReader::new(std::io::Cursor::new(image.bytes));
    let mut reader = reader.with_guessed_format().map_err(|e| e.to_string())?;
    reader.limits(Limits::default());
    let decoded = reader.decode().map_err(|e| e.to_string())?;
    let (width, height) = (decoded.width(), decoded.height());
    let pixels = match decoded {
        DynamicImage::ImageLuma8(_)
        | DynamicImage::ImageLumaA8(_)
        | DynamicImage::ImageRgb8(_)
        | DynamicImage::ImageRgba8(_) => Pixels::Bytes(decoded.into_rgba8().pixels().map(|p| p.0).collect()),
        deep => {
            let halves = |p: &image::Rgba<f32>| p.0.map(|x| f16::from_f32(x).to_bits());
            Pixels::Halves(deep.into_rgba32f().pixels().map(halves).collect())
        }
    };
    Ok(Image { name: image.name, width, height, pixels })
}
