//! Each format is encoded here and decoded to known pixels; then files are cut off and spoilt.

use ::image::{GrayImage, ImageBuffer, ImageEncoder, Rgb32FImage, RgbImage, Rgba, Rgba32FImage, RgbaImage};
use half::f16;

use super::*;
use crate::scene::model::{Channel, Pixels};

/// Encodes an image in a format.
fn encoded(image: impl Into<DynamicImage>, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image.into().write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

fn decoded(name: &str, bytes: Vec<u8>) -> Checked<Image> {
    decode_all(vec![Encoded { name: name.to_owned(), bytes: bytes.into() }], 0, &Progress::default()).remove(0)
}

fn bytes_of(image: &Image) -> &[[u8; 4]] {
    match &image.pixels {
        Pixels::Bytes(pixels) => pixels,
        Pixels::Halves(_) => panic!("{} has halves", image.name),
    }
}

fn floats_of(image: &Image) -> Vec<[f32; 4]> {
    match &image.pixels {
        Pixels::Halves(pixels) => pixels.iter().map(|it| it.map(|bits| f16::from_bits(bits).to_f32())).collect(),
        Pixels::Bytes(_) => panic!("{} has bytes", image.name),
    }
}

/// 3 x 2 pixels, each of which differs from all others.
fn with_alpha() -> RgbaImage {
    RgbaImage::from_fn(3, 2, |x, y| {
        Rgba([(10 + 70 * x) as u8, (20 + 90 * y) as u8, (x * y) as u8, (50 + 60 * x) as u8])
    })
}

fn pixels(image: &RgbaImage) -> Vec<[u8; 4]> {
    image.pixels().map(|pixel| pixel.0).collect()
}

/// A DDS file: `DDS_HEADER` with a pixel format of eight words, then data.
fn dds(size: [u32; 2], pixel_format: [u32; 8], data: &[u8]) -> Vec<u8> {
    let mut words = vec![124, 0x1007, size[1], size[0], 0, 0, 0];
    words.extend([0; 11]);
    words.extend(pixel_format);
    words.extend([0x1000, 0, 0, 0, 0]);
    let words = words.into_iter().flat_map(u32::to_le_bytes);
    b"DDS ".iter().copied().chain(words).chain(data.iter().copied()).collect()
}

/// A file of each format with its name.
fn files() -> Vec<(&'static str, Vec<u8>)> {
    let rgba = with_alpha;
    let floats = Rgba32FImage::from_fn(9, 7, |x, y| Rgba([x as f32, y as f32, 0.5, 1.0]));
    let photo = RgbImage::from_fn(24, 17, |x, y| ::image::Rgb([(8 * x) as u8, (9 * y) as u8, 128]));
    let rgb_float = Rgb32FImage::from_fn(9, 7, |x, y| ::image::Rgb([x as f32, y as f32, 0.25]));
    let dxt = |fourcc: &[u8; 4]| [32, 4, u32::from_le_bytes(*fourcc), 0, 0, 0, 0, 0];
    let blocks: Vec<u8> = (0..16 * 4).map(|i| (i * 37) as u8).collect();
    vec![
        ("a.png", encoded(rgba(), ImageFormat::Png)),
        ("a.bmp", encoded(rgba(), ImageFormat::Bmp)),
        ("a.TGA", encoded(rgba(), ImageFormat::Tga)),
        ("a.webp", encoded(rgba(), ImageFormat::WebP)),
        ("a.jpg", encoded(photo, ImageFormat::Jpeg)),
        ("a.tif", encoded(rgba(), ImageFormat::Tiff)),
        ("a.gif", encoded(rgba(), ImageFormat::Gif)),
        ("a.hdr", encoded(rgb_float, ImageFormat::Hdr)),
        ("a.exr", encoded(floats, ImageFormat::OpenExr)),
        ("a.dds", dds([8, 8], dxt(b"DXT1"), &blocks)),
        ("b.dds", dds([8, 8], dxt(b"DXT5"), &blocks)),
        ("c.dds", dds([5, 3], [32, 0x40, 0, 16, 0xf800, 0x7e0, 0x1f, 0], &blocks)),
    ]
}

#[test]
fn lossless_formats_keep_their_pixels() {
    for format in [ImageFormat::Png, ImageFormat::Bmp, ImageFormat::WebP, ImageFormat::Tiff, ImageFormat::Tga] {
        // The content decides, except for TGA.
        let name = if format == ImageFormat::Tga { "dir/IMAGE.Tga" } else { "image.jpeg" };
        let image = decoded(name, encoded(with_alpha(), format)).unwrap();
        assert_eq!((image.width, image.height, &*image.name), (3, 2, name));
        assert_eq!(bytes_of(&image), pixels(&with_alpha()), "{format:?}");
    }
}

/// The first of several pictures counts. A picture may be larger than what a decoder may allocate beside it.
#[test]
fn gif_and_tiff_are_read() {
    let mut bytes = Vec::new();
    let frame = |grey: u8| ::image::Frame::new(RgbaImage::from_pixel(5, 4, Rgba([grey, 0, 0, 255])));
    ::image::codecs::gif::GifEncoder::new(&mut bytes).encode_frames([frame(200), frame(9)]).unwrap();
    let image = decoded("a", bytes).unwrap();
    assert_eq!((image.width, image.height, bytes_of(&image)), (5, 4, &[[200, 0, 0, 255]; 20][..]));
    let side = 2100;
    assert!(4 * u64::from(side) * u64::from(side) > MAX_EXTRA_BYTES);
    let large = RgbaImage::from_pixel(side, side, Rgba([10, 20, 30, 255]));
    for format in [ImageFormat::Tiff, ImageFormat::Gif] {
        let image = decoded("a", encoded(large.clone(), format)).unwrap_or_else(|error| panic!("{format:?}: {error}"));
        assert_eq!((image.width, bytes_of(&image)[7]), (side, [10, 20, 30, 255]), "{format:?}");
    }
    let words = [7_u16, 65535];
    let grey = ImageBuffer::<::image::Luma<u16>, _>::from_raw(2, 1, words.to_vec()).unwrap();
    assert_eq!(floats_of(&decoded("a", encoded(grey, ImageFormat::Tiff)).unwrap())[1][0], 1.0);
    let floats = Rgb32FImage::from_pixel(2, 1, ::image::Rgb([4.0, 0.5, 0.25]));
    let image = decoded("a", encoded(floats, ImageFormat::Tiff)).unwrap();
    assert_eq!((floats_of(&image)[0], image.is_linear), ([4.0, 0.5, 0.25, 1.0], true));
}

/// A strip that says that it is large is not read, however small the picture is.
#[test]
fn strips_of_tiff_files_are_limited() {
    let mut bytes = encoded(with_alpha(), ImageFormat::Tiff);
    // The entry of the directory: the strips' numbers of bytes, one number of 32 bits.
    let entry = [0x17, 0x01, 4, 0, 1, 0, 0, 0];
    let at = bytes.windows(8).position(|part| part == entry).expect("one strip") + entry.len();
    bytes[at..at + 4].copy_from_slice(&(1_u32 << 30).to_le_bytes());
    let error = decoded("a", bytes).unwrap_err();
    assert!(error.to_lowercase().contains("limit"), "{error}");
}

#[test]
fn other_formats_are_called_by_their_names() {
    for (bytes, what) in [
        (&b"\xabKTX 11\xbb\r\n\x1a\n"[..], "KTX"),
        (b"8BPS\0", "Photoshop"),
        (b"\0\0\0\x1cftypavif", "AVIF"),
        (b"<svg ", "SVG"),
    ] {
        assert!(decoded("a", bytes.to_vec()).unwrap_err().contains(what), "{what}");
    }
}

#[test]
fn grey_is_spread_and_opaque() {
    let grey = GrayImage::from_raw(2, 1, vec![7, 200]).unwrap();
    let image = decoded("grey", encoded(grey, ImageFormat::Png)).unwrap();
    assert_eq!(bytes_of(&image), [[7, 7, 7, 255], [200, 200, 200, 255]]);
    let grey = ::image::GrayAlphaImage::from_raw(1, 1, vec![7, 9]).unwrap();
    assert_eq!(bytes_of(&decoded("grey", encoded(grey, ImageFormat::Png)).unwrap()), [[7, 7, 7, 9]]);
}

#[test]
fn jpeg_shows_its_colour() {
    let orange = RgbImage::from_pixel(16, 16, ::image::Rgb([200, 100, 50]));
    let image = decoded("a", encoded(orange, ImageFormat::Jpeg)).unwrap();
    let is_near = |p: &[u8; 4]| p.iter().zip([200, 100, 50, 255]).all(|(a, b)| a.abs_diff(b) <= 3);
    assert!(bytes_of(&image).len() == 256 && bytes_of(&image).iter().all(is_near), "{:?}", image.pixels);
}

#[test]
fn a_jpeg_that_is_cut_off_is_noticed() {
    let photo = RgbImage::from_fn(64, 64, |x, y| ::image::Rgb([(x * y) as u8, x as u8, y as u8]));
    let whole = encoded(photo, ImageFormat::Jpeg);
    let with_thumbnail = [&whole[..2], b"\xff\xe1\0\x08\xff\xd8\0\0\xff\xd9", &whole[2..]].concat();
    for jpeg in [&whole, &with_thumbnail] {
        assert!(!is_cut_jpeg(jpeg) && !is_cut_jpeg(&[jpeg, &b"more"[..]].concat()));
        assert!(is_cut_jpeg(&jpeg[..jpeg.len() * 2 / 3]) && is_cut_jpeg(&jpeg[..jpeg.len() - 1]));
    }
    assert!(!is_cut_jpeg(&encoded(RgbImage::new(1, 1), ImageFormat::Png)));
}

#[test]
fn sixteen_bits_are_more_than_eight() {
    let values = [0_u16, 1000, 1001, 32768, 65535];
    let grey = ImageBuffer::<::image::Luma<u16>, _>::from_raw(5, 1, values.to_vec()).unwrap();
    let floats = floats_of(&decoded("a", encoded(grey, ImageFormat::Png)).unwrap());
    for (value, [r, g, b, a]) in values.into_iter().zip(floats) {
        assert!((r - f32::from(value) / 65535.0).abs() <= r / 2048.0 && (r, r, 1.0) == (g, b, a), "{value}: {r}");
    }
    let colour = ImageBuffer::<Rgba<u16>, _>::from_raw(1, 1, vec![65535, 0, 32768, 1000]).unwrap();
    let [r, g, _, a] = floats_of(&decoded("a", encoded(colour, ImageFormat::Png)).unwrap())[0];
    assert!((r, g) == (1.0, 0.0) && (a - 1000.0 / 65535.0).abs() < 1e-5);
}

#[test]
fn floats_are_bounded_and_straight() {
    let hdr = Rgb32FImage::from_raw(2, 1, vec![1.0, 0.5, 0.25, 8.0, 4.0, 2.0]).unwrap();
    let floats = floats_of(&decoded("a", encoded(hdr, ImageFormat::Hdr)).unwrap());
    assert_eq!(floats, [[1.0, 0.5, 0.25, 1.0], [8.0, 4.0, 2.0, 1.0]]);
    let pixels = vec![1e9, -1e9, f32::NAN, 1.0, 0.5, 0.25, 0.125, 0.5, 3.0, 2.0, 1.0, 0.0];
    let exr = Rgba32FImage::from_raw(3, 1, pixels).unwrap();
    let floats = floats_of(&decoded("a", encoded(exr, ImageFormat::OpenExr)).unwrap());
    // EXR's colours are multiplied by the opacity.
    assert_eq!(floats, [[65504.0, -65504.0, 0.0, 1.0], [1.0, 0.5, 0.25, 0.5], [3.0, 2.0, 1.0, 0.0]]);
}

/// BC1: red 31 and blue 31 as ends, and the row of indices 0, 1, 2, 3: red, blue, two thirds and one third of red.
#[test]
fn dds_blocks_are_decoded() {
    let block = [0x00, 0xf8, 0x1f, 0x00, 0xe4, 0xe4, 0xe4, 0xe4];
    let format = [32, 4, u32::from_le_bytes(*b"DXT1"), 0, 0, 0, 0, 0];
    let image = decoded("a", dds([3, 2], format, &block)).unwrap();
    let row = [[255, 0, 0, 255], [0, 0, 255, 255], [170, 0, 85, 255]];
    assert_eq!(bytes_of(&image), [row, row].concat());
    // BC5 has x and y of normals. z follows: here (0, 0, 1), up to the rounding of 128.
    let flat = [[128, 128, 0, 0, 0, 0, 0, 0]; 2].concat();
    let format = [32, 4, u32::from_le_bytes(*b"ATI2"), 0, 0, 0, 0, 0];
    assert_eq!(bytes_of(&decoded("a", dds([1, 1], format, &flat)).unwrap()), [[128, 128, 255, 255]]);
}

#[test]
fn dds_without_compression_is_decoded() {
    let data = [1, 2, 3, 4, 5, 6, 7, 8];
    let bgra = [32, 0x41, 0, 32, 0xff_0000, 0xff00, 0xff, 0xff00_0000];
    assert_eq!(bytes_of(&decoded("a", dds([2, 1], bgra, &data)).unwrap()), [[3, 2, 1, 4], [7, 6, 5, 8]]);
    let rgba = [32, 0x41, 0, 32, 0xff, 0xff00, 0xff_0000, 0xff00_0000];
    assert_eq!(bytes_of(&decoded("a", dds([2, 1], rgba, &data)).unwrap()), [[1, 2, 3, 4], [5, 6, 7, 8]]);
    let bgrx = [32, 0x40, 0, 32, 0xff_0000, 0xff00, 0xff, 0];
    assert_eq!(bytes_of(&decoded("a", dds([2, 1], bgrx, &data)).unwrap()), [[3, 2, 1, 255], [7, 6, 5, 255]]);
    let grey = [32, 0x2_0000, 0, 8, 0xff, 0, 0, 0];
    assert_eq!(bytes_of(&decoded("a", dds([1, 1], grey, &[9])).unwrap()), [[9, 9, 9, 255]]);
    let rgb565 = [32, 0x40, 0, 16, 0xf800, 0x7e0, 0x1f, 0];
    assert_eq!(bytes_of(&decoded("a", dds([1, 1], rgb565, &[0xff, 0x07])).unwrap()), [[0, 255, 255, 255]]);
}

/// A header of version 10 names a format by its number; 10 is `R16G16B16A16_FLOAT`.
#[test]
fn dds_halves_are_kept() {
    let halves = [1.5, -2.0, 0.25, 1.0].map(|x: f32| f16::from_f32(x).to_le_bytes()).concat();
    let extension = [10_u32, 3, 0, 1, 0].into_iter().flat_map(u32::to_le_bytes).collect::<Vec<_>>();
    let format = [32, 4, u32::from_le_bytes(*b"DX10"), 0, 0, 0, 0, 0];
    let image = decoded("a", dds([1, 1], format, &[extension, halves].concat())).unwrap();
    assert_eq!(floats_of(&image), [[1.5, -2.0, 0.25, 1.0]]);
}

#[test]
fn a_moving_image_shows_its_first_frame() {
    let still = encoded(RgbaImage::from_pixel(1, 1, Rgba([9, 8, 7, 255])), ImageFormat::Png);
    // An animation control chunk with two frames, the first of which is the image itself.
    let chunk = |kind: &[u8; 4], data: &[u8]| {
        let body = [&kind[..], data].concat();
        [&(data.len() as u32).to_be_bytes()[..], &body, &crc32fast::hash(&body).to_be_bytes()].concat()
    };
    let control = |number: u32| {
        let size: Vec<u8> = [number, 1, 1, 0, 0].into_iter().flat_map(u32::to_be_bytes).collect();
        chunk(b"fcTL", &[&size[..], &[0, 1, 0, 1, 0, 0]].concat())
    };
    let (head, rest) = still.split_at(8 + 25);
    let (data, end) = rest.split_at(rest.len() - 12);
    let second = [&2_u32.to_be_bytes()[..], &data[8..data.len() - 4]].concat();
    let animation = chunk(b"acTL", &[0, 0, 0, 2, 0, 0, 0, 0]);
    let moving = [head, &animation, &control(0), data, &control(1), &chunk(b"fdAT", &second), end].concat();
    assert_eq!(bytes_of(&decoded("a", moving).unwrap()), [[9, 8, 7, 255]]);
}

/// The file would need 14 GiB.
#[test]
fn a_bomb_is_refused_by_its_header() {
    let mut bytes = Vec::new();
    let encoder = ::image::codecs::png::PngEncoder::new(&mut bytes);
    encoder.write_image(&[0; 4], 1, 1, ::image::ExtendedColorType::Rgba8).unwrap();
    for at in [16, 20] {
        bytes[at..at + 4].copy_from_slice(&60_000_u32.to_be_bytes());
    }
    let crc = crc32fast::hash(&bytes[12..29]).to_be_bytes();
    bytes[29..33].copy_from_slice(&crc);
    let error = decoded("a.png", bytes).unwrap_err();
    assert_eq!(error, "image `a.png`: has 60000 x 60000 pixels, not 1 to 16384 a side");
    let format = [32, 4, u32::from_le_bytes(*b"DXT1"), 0, 0, 0, 0, 0];
    let error = decoded("a.dds", dds([16_385, 1], format, &[0; 8])).unwrap_err();
    assert!(error.ends_with("has 16385 x 1 pixels, not 1 to 16384 a side"), "{error}");
    let header = |n| {
        vec![
            Header {
                format: Format::Dds,
                width: 1 << 14,
                height: 1 << 14,
                decoder_bytes: 0,
                pixel_bytes: 0,
                is_linear: false
            };
            n
        ]
    };
    assert_eq!(check_sum(header(8).iter(), 0), Ok(()));
    for (n, n_before) in [(9, 0), (8, 1), (1, u64::MAX)] {
        assert!(check_sum(header(n).iter(), n_before).unwrap_err().contains("more than 2147483648"));
    }
}

#[test]
fn an_error_is_one_line_and_leaves_the_others() {
    let good = Encoded { name: "good".to_owned(), bytes: encoded(with_alpha(), ImageFormat::Png).into() };
    let bad = Encoded { name: "b\nad".to_owned(), bytes: b"qoif\0\0"[..].into() };
    let results = decode_all(vec![bad, good], 0, &Progress::default());
    let error = results[0].as_ref().unwrap_err();
    assert_eq!(error, "image `b ad`: is none of PNG, JPEG, TGA, BMP, WebP, TIFF, GIF, HDR, EXR, DDS and KTX2");
    assert_eq!(bytes_of(results[1].as_ref().unwrap()), pixels(&with_alpha()));
}

/// Cuts off each file of each format at 32 places, and spoils each of them in 100 ways. None is allowed to panic, not
/// even into the error that a panic becomes.
#[test]
fn spoilt_files_are_errors_or_images() {
    let check = |name: &str, bytes: Vec<u8>, how: String| {
        if let Err(error) = decoded(name, bytes) {
            assert!(!error.contains("its decoder failed"), "{name}, {how}: {error}");
        }
    };
    let mut random = 1_u64;
    let mut next = |end: usize| {
        random = random.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (random >> 33) as usize % end
    };
    for (name, bytes) in files() {
        decoded(name, bytes.clone()).unwrap();
        for i in 0..32 {
            let end = bytes.len() * i / 32;
            check(name, bytes[..end].to_vec(), format!("cut off at {end}"));
        }
        for i in 0..100 {
            let mut spoilt = bytes.clone();
            for _ in 0..=i % 4 {
                let end = if i % 2 == 0 { spoilt.len() } else { spoilt.len().min(160) };
                let at = next(end);
                spoilt[at] = next(256) as u8;
            }
            check(name, spoilt, format!("spoilt the {i}th way"));
        }
    }
}

/// The height rises by 1/8 from column to column, so by 8 over the image's width of 64 at a scale of 1. At a scale of
/// 0.25 the slope is 2, and the normal is (-2, 0, 1) / sqrt 5.
#[test]
fn a_ramp_tilts_the_normal() {
    let ramp = |of: fn(usize, usize) -> usize| {
        let bits = |i: usize| f16::from_f32(of(i % 64, i / 64) as f32 / 8.0).to_bits();
        let pixels = Pixels::Halves((0..64 * 64).map(|i| [0, bits(i), 0, 0]).collect());
        Image { name: "ramp".to_owned(), width: 64, height: 64, pixels, is_linear: false }
    };
    let stored = |c: f32| (127.5 * c / 5_f32.sqrt() + 127.5).round() as u8;
    let along_u = normals_of_heights(&ramp(|x, _| x), Channel::Green, 0.25);
    let down = normals_of_heights(&ramp(|_, y| y), Channel::Green, 0.25);
    for at in [1, 30, 62] {
        assert_eq!(bytes_of(&along_u)[64 * at + at], [stored(-2.0), 128, stored(1.0), 255]);
        // Rising downwards means falling along y, so the normal tilts towards y.
        assert_eq!(bytes_of(&down)[64 * at + at], [128, stored(2.0), stored(1.0), 255]);
    }
    // The image repeats: between the last column and the first one, the height falls by 63/8 - 1/8 in two steps.
    assert!(bytes_of(&along_u)[0][0] > 250);
    assert_eq!(bytes_of(&normals_of_heights(&along_u, Channel::Alpha, 5.0))[9], [128, 128, 255, 255]);
}

/// A tile is allocated whole before its first byte is read.
#[test]
fn exr_tiles_beyond_their_layer_are_refused() {
    let file = include_bytes!("../../../../tests/corpus/image/huge_tiles.exr");
    let error = decoded("a.exr", file.to_vec()).unwrap_err();
    assert!(error.contains("has tiles of 11993152 x 64 pixels, larger than its layer"), "{error}");
}
