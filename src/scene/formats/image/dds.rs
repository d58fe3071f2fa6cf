//! DDS files: block compression BC1 to BC7, and uncompressed pixels. Mip 0 of the first array layer is read.

use image_dds::{ImageFormat, Surface, dds_image_format, ddsfile::Dds};

use super::{Format, Header, pixels};
use crate::scene::model::{Pixels, error::Checked};

/// Bytes of the longest header: a mark, the header, and its extension.
const MAX_HEADER_BYTES: usize = 4 + 124 + 20;

/// How the pixels of a file are stored.
enum Storage {
    /// A format of the crate `image_dds`.
    Known(ImageFormat),
    /// Masks of an older file, which describe each channel's bits.
    Masks(Masks),
}

/// The bits of a pixel's channels, up to 32 in all.
struct Masks {
    /// Bytes of a pixel, 1 to 4.
    n_bytes: usize,
    /// Masks of red, green, blue and opacity. A mask of 0 means that there is no such channel.
    channels: [u32; 4],
}

/// Reads the header. The sizes are not checked.
pub(super) fn header_of(bytes: &[u8]) -> Checked<Header> {
    let dds = read(&bytes[..bytes.len().min(MAX_HEADER_BYTES)])?;
    let is_fine = matches!(storage_of(bytes, &dds)?, Storage::Known(format) if is_fine(format));
    let (decoder_bytes, pixel_bytes) = if is_fine { (16, 8) } else { (4, 4) };
    let (width, height) = (dds.get_width(), dds.get_height());
    Ok(Header { format: Format::Dds, width, height, decoder_bytes, pixel_bytes, is_linear: is_fine })
}

/// Decodes a file whose size has been checked.
pub(super) fn decode(bytes: &[u8]) -> Checked<Pixels> {
    let dds = read(bytes)?;
    let (width, height) = (dds.get_width(), dds.get_height());
    let format = match storage_of(bytes, &dds)? {
        Storage::Known(format) => format,
        Storage::Masks(masks) => return masks.pixels(&dds.data, width as usize * height as usize),
    };
    // The data begin with mip 0 of the first array layer.
    let surface = Surface { width, height, depth: 1, layers: 1, mipmaps: 1, image_format: format, data: &dds.data[..] };
    let is_two_channels = has_two_channels(format);
    if is_fine(format) {
        let decoded = surface.decode_rgbaf32().map_err(|error| error.to_string())?;
        let stored = if is_signed(format) { |x: f32| 0.5 * x + 0.5 } else { |x: f32| x };
        let pixel = |&[r, g, b, a]: &[f32; 4]| {
            let [r, g, b] = [r, g, b].map(stored);
            [r, g, if is_two_channels { third_of_unit(r, g) } else { b }, a]
        };
        return Ok(pixels::halves(decoded.data.as_chunks().0.iter().map(pixel)));
    }
    let decoded = surface.decode_rgba8().map_err(|error| error.to_string())?;
    let mut decoded = decoded.data.as_chunks().0.to_vec();
    if is_two_channels {
        let unit = |byte: u8| f32::from(byte) / 255.0;
        decoded.iter_mut().for_each(|it| it[2] = (third_of_unit(unit(it[0]), unit(it[1])) * 255.0).round() as u8);
    }
    Ok(Pixels::Bytes(decoded))
}

fn read(bytes: &[u8]) -> Checked<Dds> {
    Dds::read(bytes).map_err(|error| format!("has a wrong DDS header: {error}"))
}

fn storage_of(bytes: &[u8], dds: &Dds) -> Checked<Storage> {
    match dds_image_format(dds) {
        // The decoder takes them for unsigned ones.
        Ok(ImageFormat::BC6hRgbSfloat) => Err("has signed BC6H blocks, which are not read".to_owned()),
        Ok(format) => Ok(Storage::Known(format)),
        Err(_) => Masks::of_file(bytes).map(Storage::Masks).ok_or("has a DDS format that is not read".to_owned()),
    }
}

/// Whether channels have more than 8 bits.
fn is_fine(format: ImageFormat) -> bool {
    use ImageFormat as F;
    let is_float = matches!(format, F::R16Float | F::Rg16Float | F::Rgba16Float | F::R32Float | F::Rg32Float);
    let is_wide = matches!(format, F::Rgb32Float | F::Rgba32Float | F::BC6hRgbUfloat | F::BC6hRgbSfloat);
    is_float || is_wide || is_signed(format) || matches!(format, F::R16Unorm | F::Rg16Unorm | F::Rgba16Unorm)
}

/// Whether channels have 16 bits for -1 to 1, which images store as 0 to 1. (The decoder itself does so for 8 bits.)
fn is_signed(format: ImageFormat) -> bool {
    matches!(format, ImageFormat::R16Snorm | ImageFormat::Rg16Snorm | ImageFormat::Rgba16Snorm)
}

/// Whether an image has two channels of 0 to 1. Such images show x and y of normals.
fn has_two_channels(format: ImageFormat) -> bool {
    use ImageFormat as F;
    matches!(format, F::BC5RgUnorm | F::BC5RgSnorm | F::Rg8Unorm | F::Rg8Snorm | F::Rg16Unorm | F::Rg16Snorm)
}

/// Returns the third channel of an image of unit vectors, each channel c of which stands for 2 c - 1.
fn third_of_unit(r: f32, g: f32) -> f32 {
    let [x, y] = [2.0 * r - 1.0, 2.0 * g - 1.0];
    0.5 + 0.5 * (1.0 - x * x - y * y).max(0.0).sqrt()
}

impl Masks {
    /// Returns the masks that the header states, if it states any. The offsets are those of `DDS_PIXELFORMAT`.
    fn of_file(bytes: &[u8]) -> Option<Self> {
        let word = |ix: usize| Some(u32::from_le_bytes(bytes.get(76 + 4 * ix..)?.first_chunk().copied()?));
        let (flags, n_bits) = (word(1)?, word(3)?);
        let has = |flag: u32| flags & flag != 0;
        let [red, green, blue] = match (has(0x40), has(0x2_0000)) {
            (true, _) => [word(4)?, word(5)?, word(6)?],
            (false, true) => [word(4)?; 3],
            (false, false) => [0; 3],
        };
        let alpha = if has(0x1) || has(0x2) { word(7)? } else { 0 };
        let channels = [red, green, blue, alpha];
        let is_meant = matches!(n_bits, 8 | 16 | 24 | 32) && channels != [0; 4];
        is_meant.then_some(Self { n_bytes: n_bits as usize / 8, channels })
    }

    fn pixels(&self, data: &[u8], n_pixels: usize) -> Checked<Pixels> {
        let data = data.get(..n_pixels * self.n_bytes).ok_or("is cut off")?;
        let [red, green, blue, alpha] = self.channels;
        let pixel = |bytes: &[u8]| {
            let mut word = [0; 4];
            word[..bytes.len()].copy_from_slice(bytes);
            let word = u32::from_le_bytes(word);
            let opacity = if alpha == 0 { 255 } else { channel(word, alpha) };
            [channel(word, red), channel(word, green), channel(word, blue), opacity]
        };
        Ok(Pixels::Bytes(data.chunks_exact(self.n_bytes).map(pixel).collect()))
    }
}

/// Returns the bits under a mask, scaled so that all ones are 255. Without a mask they are 0.
fn channel(word: u32, mask: u32) -> u8 {
    if mask == 0 {
        return 0;
    }
    let shift = mask.trailing_zeros();
    let (value, largest) = (u64::from((word & mask) >> shift), u64::from(mask >> shift));
    ((255 * value + largest / 2) / largest) as u8
}
