//! Image files in memory, decoded to pixels. The content says which format a file has.
//!
//! The files may be hostile. Each is measured by its header, and all of them together must fit, before any pixel is
//! decoded.

mod dds;
mod facts;
mod heights;
mod ktx2;
mod pixels;
#[cfg(test)]
mod tests;

use std::{
    borrow::Cow,
    collections::BTreeSet,
    io::Cursor,
    panic::{AssertUnwindSafe, catch_unwind},
};

use ::image::{ColorType, DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use glam::Vec3;
use rayon::prelude::*;

pub(crate) use self::{facts::Examined, heights::normals_of_heights};
use crate::{
    scene::model::{Image, error::Checked},
    util::{
        memory,
        progress::{Progress, Work},
        text::{one_line, short_line},
    },
};

/// The most pixels along a side of an image, the limit of many GPUs for their own textures. An image has thus at most
/// 2^28 pixels.
const MAX_SIDE: u32 = 16_384;
/// The most pixels of all images of a scene. Kernels find a texel by an index of 32 bits, and the smaller copies of an
/// image add a third to its texels.
pub(crate) const MAX_PIXELS: u64 = 1 << 31;
/// Bytes that a decoder may allocate beside its pixels, such as for a colour profile, which is compressed.
const MAX_EXTRA_BYTES: u64 = 16 << 20;
/// How many times the size of its own pixels a decoder may hold at once: JPEG's coefficients and their pixels, a copy
/// in another order, a buffer that grows.
const WORKING_COPIES: u64 = 3;

/// An image file in memory.
pub(crate) struct Encoded<'a> {
    /// The file's name, or the image's name within its file, for messages. Its ending tells TGA, which has no mark.
    pub name: String,
    /// The file's content.
    pub bytes: Cow<'a, [u8]>,
}

/// What the header of an image file says.
#[derive(Clone, Copy, Debug)]
struct Header {
    format: Format,
    width: u32,
    height: u32,
    /// Size of a pixel of the decoder's own.
    decoder_bytes: u64,
    /// Size of a pixel of the [`Image`].
    pixel_bytes: u64,
    /// Whether the colours are floats, which are linear.
    is_linear: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Format {
    /// A format of the crate `image`.
    Common(ImageFormat),
    Dds,
    Ktx2,
}

impl Header {
    fn n_pixels(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }
}

/// Decodes image files on the current rayon pool, in their order. Of several frames, array layers or mips, the first
/// counts. An orientation that the file's metadata demands and a colour profile are ignored, as glTF requires.
///
/// An error is one line that begins with the image's name. If all images together, with `n_pixels` that the scene has
/// already, are too large, no image is decoded.
pub(crate) fn decode_all(images: Vec<Encoded>, n_pixels: u64, progress: &Progress) -> Vec<Checked<Image>> {
    let meter = progress.begin(Work::Images, images.len() as u64);
    let headers: Vec<_> = images.par_iter().map(|image| named(&image.name, || header_of(image))).collect();
    let sum = check_sum(headers.iter().flatten(), n_pixels);
    let cut: BTreeSet<_> = images.iter().filter(|it| is_cut_jpeg(&it.bytes)).map(|it| short_line(&it.name)).collect();
    if let Some(first) = cut.first() {
        let more = if cut.len() > 1 { format!(" and {} more", cut.len() - 1) } else { String::new() };
        tracing::warn!("image `{first}`{more}: has no end: what is missing of its picture is grey");
    }
    let decode_one = |(image, header): (Encoded, Checked<Header>)| {
        let decoded =
            header.and_then(|header| named(&image.name, || sum.clone().and_then(|()| decode(&image, &header))));
        meter.add(1);
        decoded
    };
    images.into_par_iter().zip(headers).map(decode_one).collect()
}

/// Returns whether an image's header can be read.
pub(crate) fn has_header(image: &Encoded) -> bool {
    named(&image.name, || header_of(image)).is_ok()
}

/// Decodes an image of floats, HDR or EXR. Returns its size and its colours, row by row, as they are in the file: they
/// may be negative, infinite or NaN.
pub(crate) fn decode_colours(image: &Encoded) -> Checked<([u32; 2], Vec<Vec3>)> {
    let decoded = named(&image.name, || {
        let header = header_of(image)?;
        let Format::Common(format @ (ImageFormat::Hdr | ImageFormat::OpenExr)) = header.format else {
            return Err("is neither HDR nor EXR".to_owned());
        };
        check_sum([header].iter(), 0)?;
        let decoder = decoder_of(format, &image.bytes)?;
        Ok(DynamicImage::from_decoder(decoder).map_err(|error| error.to_string())?.into_rgb32f())
    })?;
    let size = [decoded.width(), decoded.height()];
    Ok((size, decoded.as_raw().as_chunks().0.iter().copied().map(Vec3::from_array).collect()))
}

/// Does one step for an image, and names the image in the step's error. A decoder's panic becomes an error: a fault in
/// one of the decoders must not end the process because of a file.
fn named<T>(name: &str, step: impl FnOnce() -> Checked<T>) -> Checked<T> {
    let result = catch_unwind(AssertUnwindSafe(step)).unwrap_or_else(|_| Err("its decoder failed".to_owned()));
    result.map_err(|what| one_line(&format!("image `{name}`: {what}")))
}

/// Checks that all images together are not too many pixels and fit into memory. `n_before`: the number of pixels that
/// there are already.
fn check_sum<'a>(headers: impl Iterator<Item = &'a Header> + Clone, n_before: u64) -> Checked<()> {
    let n_pixels = headers.clone().map(Header::n_pixels).fold(n_before, u64::saturating_add);
    if n_pixels > MAX_PIXELS {
        return Err(format!("the scene's images have {n_pixels} pixels, more than {MAX_PIXELS}"));
    }
    let decoded: u64 = headers.clone().map(|header| header.n_pixels() * header.pixel_bytes).sum();
    let working = headers.map(|header| header.n_pixels() * header.decoder_bytes * WORKING_COPIES);
    // Each thread decodes one image at a time.
    let at_once = working.clone().max().unwrap_or(0).saturating_mul(rayon::current_num_threads() as u64);
    let needed = decoded + at_once.min(working.sum());
    Ok(memory::require("decoding the scene's images", needed)?)
}

/// Reads an image's header and checks the image's size.
fn header_of(image: &Encoded) -> Checked<Header> {
    let header = match format_of(image)? {
        Format::Dds => dds::header_of(&image.bytes)?,
        Format::Ktx2 => ktx2::header_of(&image.bytes)?,
        Format::Common(format) => {
            if format == ImageFormat::OpenExr {
                check_exr(&image.bytes)?;
            }
            let decoder = decoder_of(format, &image.bytes)?;
            let (width, height) = decoder.dimensions();
            let (colour, decoder_bytes) = (decoder.color_type(), decoder.color_type().bytes_per_pixel().into());
            let is_bytes = colour.bytes_per_pixel() == colour.channel_count();
            let pixel_bytes = if is_bytes { 4 } else { 8 };
            let is_linear = matches!(colour, ColorType::Rgb32F | ColorType::Rgba32F);
            Header { format: Format::Common(format), width, height, decoder_bytes, pixel_bytes, is_linear }
        }
    };
    let Header { width, height, .. } = header;
    if width == 0 || height == 0 || width.max(height) > MAX_SIDE {
        return Err(format!("has {width} x {height} pixels, not 1 to {MAX_SIDE} a side"));
    }
    Ok(header)
}

/// Returns the format of an image file.
fn format_of(Encoded { name, bytes }: &Encoded) -> Checked<Format> {
    use ImageFormat::{Bmp, Gif, Hdr, Jpeg, OpenExr, Png, Tga, Tiff, WebP};
    if bytes.starts_with(b"DDS ") {
        return Ok(Format::Dds);
    }
    if bytes.starts_with(ktx2::MARK) {
        return Ok(Format::Ktx2);
    }
    match ::image::guess_format(bytes) {
        Ok(format @ (Png | Jpeg | Bmp | WebP | Tiff | Gif | Hdr | OpenExr)) => Ok(Format::Common(format)),
        _ if name.to_ascii_lowercase().ends_with(".tga") => Ok(Format::Common(Tga)),
        _ => Err(foreign(bytes)
            .unwrap_or("is none of PNG, JPEG, TGA, BMP, WebP, TIFF, GIF, HDR, EXR, DDS and KTX2")
            .to_owned()),
    }
}

/// Returns whether a JPEG file has no mark of its end: mostly it is cut off within its picture, whose rest its decoder
/// fills with grey. A thumbnail in its header has such a mark, too, so that counts only behind the header.
fn is_cut_jpeg(bytes: &[u8]) -> bool {
    let mut rest = match bytes {
        [0xff, 0xd8, rest @ ..] => rest,
        _ => return false,
    };
    while let [0xff, marker, high, low, ..] = *rest {
        if marker == 0xda {
            return !rest.windows(2).rev().any(|pair| pair == [0xff, 0xd9]);
        }
        rest = rest.get(2 + usize::from(u16::from_be_bytes([high, low]))..).unwrap_or_default();
    }
    false
}

/// Returns what an image file is whose format is not read, if its first bytes tell.
fn foreign(bytes: &[u8]) -> Option<&'static str> {
    const FOREIGN: [(usize, &[u8], &str); 5] = [
        (0, b"\xabKTX", "is KTX of an older version than 2, which is not read: save it as PNG"),
        (0, b"8BPS", "is an image of Photoshop, which is not read: save it as PNG"),
        (4, b"ftyp", "is AVIF or HEIF, which is not read: save it as PNG"),
        (0, b"<svg", "is SVG, which has no pixels: save it as PNG"),
        (0, b"<?xml", "is XML, such as SVG, which has no pixels: save it as PNG"),
    ];
    let is_there =
        |(at, first, _): &&(usize, &[u8], &str)| bytes.get(*at..).is_some_and(|rest| rest.starts_with(first));
    FOREIGN.iter().find(is_there).map(|(.., what)| *what)
}

/// The most pixels of an EXR file's tile that is larger than its layer. The decoder allocates whole tiles.
const MAX_TILE_PIXELS: usize = 1 << 20;

/// Checks the sizes of an EXR file's layers and tiles. Layers may be larger than the window that is shown, and blocks
/// of their rows are decoded even so.
fn check_exr(bytes: &[u8]) -> Checked<()> {
    let meta = exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(|e| e.to_string())?;
    let is_large = |layer: &exr::meta::header::Header| layer.layer_size.0.max(layer.layer_size.1) > MAX_SIDE as usize;
    if let Some(layer) = meta.headers.iter().find(|layer| is_large(layer)) {
        return Err(format!("has a layer of {} x {} pixels", layer.layer_size.0, layer.layer_size.1));
    }
    for layer in &meta.headers {
        if let exr::meta::BlockDescription::Tiles(tiles) = layer.blocks {
            let (tile, most) = (tiles.tile_size, layer.layer_size.area().max(MAX_TILE_PIXELS));
            if tile.0.checked_mul(tile.1).is_none_or(|n_pixels| n_pixels > most) {
                return Err(format!("has tiles of {} x {} pixels, larger than its layer", tile.0, tile.1));
            }
        }
        // A block is read whole, with all channels that the layer has.
        memory::require("reading its blocks", layer.max_block_byte_size() as u64)?;
    }
    Ok(())
}

fn decoder_of(format: ImageFormat, bytes: &[u8]) -> Checked<impl ImageDecoder> {
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(MAX_EXTRA_BYTES);
    reader.limits(limits.clone());
    let failed = |error: ::image::ImageError| error.to_string();
    let mut decoder = reader.into_decoder().map_err(failed)?;
    if matches!(format, ImageFormat::Tiff | ImageFormat::Gif) {
        // The limits of these decoders include the memory of the picture, and of what it is decoded from.
        limits.max_alloc = Some(decoder.total_bytes().saturating_mul(2).saturating_add(MAX_EXTRA_BYTES));
        decoder.set_limits(limits).map_err(failed)?;
    }
    Ok(decoder)
}

/// Decodes an image whose size has been checked.
fn decode(image: &Encoded, header: &Header) -> Checked<Image> {
    let pixels = match header.format {
        Format::Dds => dds::decode(&image.bytes)?,
        Format::Ktx2 => ktx2::decode(&image.bytes)?,
        Format::Common(format) => {
            let decoder = decoder_of(format, &image.bytes)?;
            let decoded = DynamicImage::from_decoder(decoder).map_err(|error| error.to_string())?;
            pixels::of_dynamic(decoded, format == ImageFormat::OpenExr)?
        }
    };
    Ok(Image {
        name: image.name.clone(),
        width: header.width,
        height: header.height,
        pixels,
        is_linear: header.is_linear,
    })
}
