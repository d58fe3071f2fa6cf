//! Textures: images, and how a material uses them.

use glam::{Affine2, Vec2};
use half::f16;
use serde::Deserialize;

/// An image that textures show, decoded.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Name of the file, or of the image within its file, for messages.
    pub name: String,
    /// Width, pixels; at least 1.
    pub width: u32,
    /// Height, pixels; at least 1.
    pub height: u32,
    /// `width * height` pixels, rows from the top.
    pub pixels: Pixels,
    /// Whether colours are linear, whatever the textures that show them say. Files of floats are (HDR, EXR).
    pub is_linear: bool,
}

impl Image {
    /// Returns the encoding of the colours as a texture with the encoding `wanted` shows them.
    pub(crate) fn encoding(&self, wanted: Encoding) -> Encoding {
        if self.is_linear { Encoding::Linear } else { wanted }
    }

    /// Returns whether some pixel is not opaque. This looks at all pixels.
    pub(crate) fn is_see_through(&self) -> bool {
        /// 1 as a half-precision float.
        const ONE: u16 = 0x3c00;
        match &self.pixels {
            Pixels::Bytes(pixels) => pixels.iter().any(|pixel| pixel[3] != u8::MAX),
            Pixels::Halves(pixels) => pixels.iter().any(|pixel| pixel[3] != ONE),
        }
    }
}

/// The pixels of an image: red, green, blue and opacity, not premultiplied.
#[derive(Clone, Debug, PartialEq)]
pub enum Pixels {
    /// 8 bits a channel, 255 for 1. The [`Encoding`] of a texture says whether colours are linear.
    Bytes(Vec<[u8; 4]>),
    /// Bits of half-precision floats, linear. Images of 16 bits or of floats have them.
    Halves(Vec<[u16; 4]>),
}

impl Pixels {
    /// Returns the number of pixels.
    pub fn len(&self) -> usize {
        match self {
            Self::Bytes(pixels) => pixels.len(),
            Self::Halves(pixels) => pixels.len(),
        }
    }

    /// Returns whether there are no pixels.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns a pixel: 1 for a byte of 255, without regard to the encoding.
    pub(crate) fn get(&self, ix: usize) -> [f32; 4] {
        match self {
            Self::Bytes(pixels) => pixels[ix].map(|byte| f32::from(byte) / 255.0),
            Self::Halves(pixels) => pixels[ix].map(|bits| f16::from_bits(bits).to_f32()),
        }
    }
}

/// An image as a material uses it.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Index into the scene's images.
    pub image_ix: u32,
    /// How the bytes of the image's colours stand for light. Opacity is always linear.
    pub encoding: Encoding,
    /// The channel that a texture of one number reads. A texture of a colour ignores it.
    pub channel: Channel,
    /// Which of the mesh's sets of texture coordinates it uses, 0 or 1.
    pub uv_set: u32,
    /// Transform of texture coordinates before the image is looked up. (0, 0) is the upper left corner of the image,
    /// and (1, 1) the lower right one.
    pub transform: Affine2,
    /// What the image shows outside of 0 to 1, along u and along v.
    pub wrap: [Wrap; 2],
    /// Whether pixels are blended with their neighbours. If not, a texture shows squares of one colour.
    pub is_smooth: bool,
}

/// Encoding of an image's colours.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Hash)]
#[serde(rename_all = "snake_case")]
pub enum Encoding {
    /// sRGB (IEC 61966-2-1), for colours.
    #[default]
    Srgb,
    /// The numbers are linear, for normals, roughness and other data.
    Linear,
}

/// Channel of an image.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Hash)]
#[serde(rename_all = "snake_case")]
pub enum Channel {
    /// Red.
    #[default]
    Red,
    /// Green.
    Green,
    /// Blue.
    Blue,
    /// Opacity.
    Alpha,
    /// Relative luminance of the colour (ITU-R BT.709).
    Luminance,
}

impl Channel {
    /// All channels, in the order of their numbers.
    pub(crate) const ALL: [Self; 5] = [Self::Red, Self::Green, Self::Blue, Self::Alpha, Self::Luminance];

    /// Returns the number that a pixel has in the channel.
    pub(crate) fn of(self, [r, g, b, a]: [f32; 4]) -> f32 {
        match self {
            Self::Red => r,
            Self::Green => g,
            Self::Blue => b,
            Self::Alpha => a,
            Self::Luminance => 0.2126 * r + 0.7152 * g + 0.0722 * b,
        }
    }
}

/// Continuation of an image outside of 0 to 1.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
pub enum Wrap {
    /// The image repeats.
    #[default]
    Repeat,
    /// The image repeats, and every second copy is mirrored.
    Mirror,
    /// The pixels of the border continue.
    Clamp,
}

impl Texture {
    /// Returns the texture of an image with sRGB colours, which repeats and uses the first texture coordinates.
    pub fn of_image(image_ix: u32) -> Self {
        Self {
            image_ix,
            encoding: Encoding::Srgb,
            channel: Channel::Red,
            uv_set: 0,
            transform: Affine2::IDENTITY,
            wrap: [Wrap::Repeat; 2],
            is_smooth: true,
        }
    }

    /// Returns the texture of an image with linear numbers, of which a texture of one number reads `channel`.
    pub fn of_data(image_ix: u32, channel: Channel) -> Self {
        Self { encoding: Encoding::Linear, channel, ..Self::of_image(image_ix) }
    }

    /// Returns the texture with its coordinates scaled, then moved.
    pub fn placed(self, scale: Vec2, offset: Vec2) -> Self {
        Self { transform: Affine2::from_translation(offset) * Affine2::from_scale(scale), ..self }
    }
}

/// Returns the linear value of an sRGB one (IEC 61966-2-1). Values outside of 0 to 1 are clamped, and NaN
/// becomes 0.
pub(crate) fn linear_of_srgb(value: f32) -> f32 {
    let value = if value > 0.0 { value.min(1.0) } else { 0.0 };
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

/// Returns the bits of a half-precision number. A number that is too large becomes the largest one, and NaN becomes 0.
pub(crate) fn half_bits(value: f32) -> u16 {
    const MOST: f32 = 65_504.0;
    f16::from_f32(if value.is_nan() { 0.0 } else { value.clamp(-MOST, MOST) }).to_bits()
}
