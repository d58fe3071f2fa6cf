//! Decoding of images.

use rayon::prelude::*;

use super::texture::{Channel, Image, Pixels};

/// An image as its file holds it.
pub(super) struct Encoded {
    /// Name of the file, or of the image within its file, for messages.
    pub name: String,
    /// Content of the file.
    pub bytes: Vec<u8>,
}

/// Decodes images, in the given order. The error says what is wrong with an image.
pub(super) fn decode_all(images: Vec<Encoded>) -> Vec<Result<Image, String>> {
    images.into_par_iter().map(decode).collect()
}

fn decode(Encoded { name, bytes }: Encoded) -> Result<Image, String> {
    let decoded = image::load_from_memory(&bytes).map_err(|error| error.to_string())?.into_rgba8();
    let (width, height) = decoded.dimensions();
    let pixels = Pixels::Bytes(decoded.into_raw().as_chunks().0.to_vec());
    Ok(Image { name, width, height, pixels })
}

/// Returns the normal map of a height map: `scale` is the height of the value 1, in pixels.
pub(super) fn normals_of_heights(image: &Image, channel: Channel, scale: f32) -> Image {
    let _ = channel;
    let (width, height) = (image.width as usize, image.height as usize);
    let at = |x: usize, y: usize| match &image.pixels {
        Pixels::Bytes(pixels) => f32::from(pixels[(y % height) * width + x % width][0]) / 255.0,
        Pixels::Halves(pixels) => half::f16::from_bits(pixels[(y % height) * width + x % width][0]).to_f32(),
    };
    let normal = |ix: usize| {
        let (x, y) = (ix % width, ix / width);
        let across = (at(x + 1, y) - at(x + width - 1, y)) / 2.0 * scale;
        let down = (at(x, y + 1) - at(x, y + height - 1)) / 2.0 * scale;
        let n = glam::Vec3::new(-across, down, 1.0).normalize() * 127.5 + 127.5;
        [n.x.round() as u8, n.y.round() as u8, n.z.round() as u8, 255]
    };
    let pixels = Pixels::Bytes((0..width * height).map(normal).collect());
    Image { pixels, ..image.clone() }
}
