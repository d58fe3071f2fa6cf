//! Films in one file: animated PNG, GIF, and YUV4MPEG2, which programs that encode videos read.

use std::{
    io::{self, Seek, Write},
    path::{Path, PathBuf},
    sync::{Arc, Mutex, PoisonError},
};

use image::{
    Delay, Frame, ImageError, RgbaImage,
    codecs::gif::{GifEncoder, Repeat},
};
use tempfile::SpooledTempFile;

use super::{OutputError, spool, write_with};
use crate::frame::Picture;

/// Speed at which the 256 colours of a GIF's frame are chosen, 1 (best) to 30.
const GIF_SPEED: i32 = 10;

/// Format of a film in one file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilmFormat {
    /// Animated PNG: 8 bits a channel, without loss.
    Png,
    /// GIF: 256 colours a frame, and times in hundredths of a second.
    Gif,
    /// YUV4MPEG2: 8 bits, three full planes (C444), BT.709 in the limited range.
    Y4m,
}

impl FilmFormat {
    /// Returns the format that a file's ending names, in upper or lower case. `-`, standard output, is YUV4MPEG2.
    pub fn of(path: &Path) -> Option<Self> {
        if path == Path::new("-") {
            return Some(Self::Y4m);
        }
        let is = |ending: &str| path.extension().is_some_and(|other| other.eq_ignore_ascii_case(ending));
        [("png", Self::Png), ("gif", Self::Gif), ("y4m", Self::Y4m)]
            .into_iter()
            .find_map(|(ending, format)| is(ending).then_some(format))
    }
}

/// A film that is written to one file, whole or not at all; to standard output frame by frame.
pub struct FilmFile {
    path: PathBuf,
    /// Where frames are kept until the file is written.
    spool: Spool,
    encoder: Encoder,
    size: (u32, u32),
}

enum Encoder {
    Png(png::Writer<Spool>),
    Gif { encoder: Box<GifEncoder<Spool>>, delay: Delay },
    Y4m { writes_at_once: bool },
}

/// A spool that an encoder and the film share.
#[derive(Clone)]
struct Spool(Arc<Mutex<SpooledTempFile>>);

impl Write for Spool {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).flush()
    }
}

impl FilmFile {
    /// Begins a film of `n_frames` pictures of a width and height, pixels. `fps`: frames a second.
    ///
    /// # Errors
    /// No film can be written to this path, or of this size.
    pub fn new(path: &Path, size: (u32, u32), fps: f64, n_frames: u32) -> Result<Self, OutputError> {
        let unknown = || OutputError::UnknownEnding { path: path.to_owned() };
        let format = FilmFormat::of(path).ok_or_else(unknown)?;
        let writes_at_once = path == Path::new("-");
        let spooled = if writes_at_once { SpooledTempFile::new(0) } else { spool(path)? };
        let mut spool = Spool(Arc::new(Mutex::new(spooled)));
        let failed = |source: ImageError| OutputError::encode(path, source);
        let (n, per) = ratio(fps);
        let encoder = match format {
            FilmFormat::Png => {
                Encoder::Png(png_writer(&spool, size, (n, per), n_frames).map_err(|e| failed(of_png(e)))?)
            }
            FilmFormat::Gif => {
                let mut encoder = Box::new(GifEncoder::new_with_speed(spool.clone(), GIF_SPEED));
                encoder.set_repeat(Repeat::Infinite).map_err(failed)?;
                Encoder::Gif { encoder, delay: Delay::from_numer_denom_ms(1000 * per, n) }
            }
            FilmFormat::Y4m => {
                let (width, height) = size;
                let header = format!("YUV4MPEG2 W{width} H{height} F{n}:{per} Ip A1:1 C444 XCOLORRANGE=LIMITED\n");
                let mut output: Box<dyn Write> =
                    if writes_at_once { Box::new(io::stdout()) } else { Box::new(&mut spool) };
                output.write_all(header.as_bytes()).map_err(|source| write_error(path, source))?;
                drop(output);
                Encoder::Y4m { writes_at_once }
            }
        };
        Ok(Self { path: path.to_owned(), spool, encoder, size })
    }

    /// Appends a picture as a display shows it.
    ///
    /// # Errors
    /// The picture has another size, the disk is full, or a write fails.
    pub fn push(&mut self, picture: &Picture) -> Result<(), OutputError> {
        let (width, height) = self.size;
        if (picture.width, picture.height) != self.size {
            let (other_width, other_height) = (picture.width, picture.height);
            let what = format!("a frame has {other_width}x{other_height} pixels, not {width}x{height}");
            return Err(write_error(&self.path, io::Error::other(what)));
        }
        let Self { path, spool, encoder, .. } = self;
        match encoder {
            Encoder::Png(writer) => {
                let rgb: Vec<u8> = picture.display.iter().flat_map(|&[r, g, b, _]| [r, g, b]).collect();
                writer.write_image_data(&rgb).map_err(|error| OutputError::encode(path, of_png(error)))
            }
            Encoder::Gif { encoder, delay } => {
                let image = RgbaImage::from_raw(width, height, picture.display.as_flattened().to_vec());
                let frame = Frame::from_parts(image.expect("a pixel for each place"), 0, 0, *delay);
                encoder.encode_frame(frame).map_err(|error| OutputError::encode(path, error))
            }
            Encoder::Y4m { writes_at_once } => {
                let mut bytes = b"FRAME\n".to_vec();
                bytes.extend(planes(&picture.display));
                let written = if *writes_at_once { io::stdout().write_all(&bytes) } else { spool.write_all(&bytes) };
                written.map_err(|source| write_error(path, source))
            }
        }
    }

    /// Writes the file, after the last picture.
    ///
    /// # Errors
    /// There are too few pictures, the disk is full, or a write fails.
    pub fn finish(self) -> Result<(), OutputError> {
        let Self { path, spool, encoder, .. } = self;
        match encoder {
            Encoder::Png(writer) => writer.finish().map_err(|error| OutputError::encode(&path, of_png(error)))?,
            Encoder::Y4m { writes_at_once: true } => {
                return io::stdout().flush().map_err(|source| write_error(&path, source));
            }
            Encoder::Gif { .. } | Encoder::Y4m { .. } => drop(encoder),
        }
        write_with(&path, |file| {
            let mut spool = spool.0.lock().unwrap_or_else(PoisonError::into_inner);
            spool.rewind()?;
            io::copy(&mut *spool, file).map(drop)
        })
    }
}

fn write_error(path: &Path, source: io::Error) -> OutputError {
    OutputError::Write { path: path.to_owned(), source }
}

fn of_png(error: png::EncodingError) -> ImageError {
    match error {
        png::EncodingError::IoError(error) => ImageError::IoError(error),
        other => ImageError::IoError(io::Error::other(other)),
    }
}

fn png_writer(
    spool: &Spool,
    (width, height): (u32, u32),
    (n, per): (u32, u32),
    n_frames: u32,
) -> Result<png::Writer<Spool>, png::EncodingError> {
    let mut encoder = png::Encoder::new(spool.clone(), width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    encoder.set_animated(n_frames, 0)?;
    // Both numbers have 16 bits.
    let halvings = u32::BITS - (n.max(per) >> 16).leading_zeros();
    encoder.set_frame_delay((per >> halvings) as u16, (n >> halvings).max(1) as u16)?;
    encoder.write_header()
}

/// Returns frames a second as a ratio of whole numbers.
fn ratio(fps: f64) -> (u32, u32) {
    let n = (fps.clamp(1e-3, 1e6) * 1000.0).round() as u32;
    let (mut a, mut b) = (n, 1000);
    while b > 0 {
        (a, b) = (b, a % b);
    }
    (n / a, 1000 / a)
}

/// Returns the planes Y, Cb and Cr of sRGB pixels, by BT.709 in the limited range: 16 to 235, and 16 to 240.
fn planes(pixels: &[[u8; 4]]) -> Vec<u8> {
    const RED: f32 = 0.2126;
    const BLUE: f32 = 0.0722;
    const GREEN: f32 = 1.0 - RED - BLUE;
    let luma = |[r, g, b, _]: &[u8; 4]| RED * f32::from(*r) + GREEN * f32::from(*g) + BLUE * f32::from(*b);
    let chroma = |part: f32, luma: f32, share: f32| 128.0 + (part - luma) / (2.0 * (1.0 - share)) * (224.0 / 255.0);
    let y = pixels.iter().map(|pixel| 16.0 + luma(pixel) * (219.0 / 255.0));
    let cb = pixels.iter().map(|pixel| chroma(f32::from(pixel[2]), luma(pixel), BLUE));
    let cr = pixels.iter().map(|pixel| chroma(f32::from(pixel[0]), luma(pixel), RED));
    y.chain(cb).chain(cr).map(|value| value.round() as u8).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Decodes planes as the standard does, and compares.
    #[test]
    fn planes_are_decoded_to_the_same_colours() {
        let values = [0_u8, 1, 17, 64, 128, 200, 254, 255];
        let pixels: Vec<[u8; 4]> = values
            .into_iter()
            .flat_map(|r| values.into_iter().flat_map(move |g| values.into_iter().map(move |b| [r, g, b, 255])))
            .collect();
        let planes = planes(&pixels);
        let n = pixels.len();
        for (ix, pixel) in pixels.iter().enumerate() {
            let y = (f32::from(planes[ix]) - 16.0) * 255.0 / 219.0;
            let [cb, cr] = [n, 2 * n].map(|from| (f32::from(planes[from + ix]) - 128.0) * 255.0 / 224.0);
            let decoded = [y + 1.5748 * cr, y - 0.187_324 * cb - 0.468_124 * cr, y + 1.8556 * cb];
            for (decoded, &expected) in decoded.iter().zip(pixel) {
                assert!((decoded - f32::from(expected)).abs() <= 2.0, "{pixel:?}: {decoded}");
            }
        }
    }

    #[test]
    fn rates_are_ratios() {
        assert_eq!([ratio(24.0), ratio(29.97), ratio(12.5), ratio(0.5)], [(24, 1), (2997, 100), (25, 2), (1, 2)]);
    }
}
