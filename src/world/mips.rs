//! Mip levels of a texture: an image as kernels read it, and ever smaller copies of it for surfaces that are far away.
//!
//! Each mip level is half as wide and half as high as the mip level before it, rounded down. A texel is the mean of the
//! texels that lie under it, each weighted by its area. Where a side is odd, a texel covers between two and three
//! others along it. The mean is one of light, so colours are decoded before and encoded after.

use std::sync::LazyLock;

use half::f16;
use rayon::prelude::*;

use crate::{
    layout::SRGB_TABLE_SIZE,
    scene::{Encoding, Image, Pixels, half_bits},
};

/// The linear values of the bytes that sRGB encodes.
pub(super) static SRGB: LazyLock<[f32; SRGB_TABLE_SIZE as usize]> =
    LazyLock::new(|| std::array::from_fn(|byte| linear_of_srgb(byte as f64 / 255.0) as f32));

/// For each byte but the last, the linear value above which the next byte is nearer in sRGB.
static SRGB_BOUNDS: LazyLock<[f32; 255]> =
    LazyLock::new(|| std::array::from_fn(|byte| linear_of_srgb((byte as f64 + 0.5) / 255.0) as f32));

/// Decodes sRGB (IEC 61966-2-1).
fn linear_of_srgb(encoded: f64) -> f64 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// How words stand for a texel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Coding {
    /// A word of four bytes, of which the colours are encoded by sRGB.
    Srgb,
    /// A word of four bytes, all linear.
    Bytes,
    /// Two words of half-precision floats, all linear.
    Halves,
}

impl Coding {
    /// Returns the coding of an image's texels. Colours of 16 bits that are encoded by sRGB become linear.
    pub(super) fn of(image: &Image, encoding: Encoding) -> Self {
        match (&image.pixels, encoding) {
            (Pixels::Halves(_), _) => Self::Halves,
            (Pixels::Bytes(_), Encoding::Srgb) => Self::Srgb,
            (Pixels::Bytes(_), Encoding::Linear) => Self::Bytes,
        }
    }

    /// Returns the number of words of a texel.
    fn n_words(self) -> usize {
        if self == Self::Halves { 2 } else { 1 }
    }

    /// Returns a texel's linear colour and its opacity.
    fn decoded(self, words: &[u32]) -> [f32; 4] {
        match (self, words) {
            (Self::Halves, &[low, high]) => {
                [low, low >> 16, high, high >> 16].map(|bits| f16::from_bits(bits as u16).to_f32())
            }
            _ => {
                let [r, g, b, a] = words[0].to_le_bytes();
                let unit = |byte: u8| f32::from(byte) / 255.0;
                let colour = |byte: u8| if self == Self::Srgb { SRGB[usize::from(byte)] } else { unit(byte) };
                [colour(r), colour(g), colour(b), unit(a)]
            }
        }
    }

    /// Writes a texel to its words.
    fn encode(self, [r, g, b, a]: [f32; 4], words: &mut [u32]) {
        let unit = |value: f32| (value * 255.0).round() as u8;
        match self {
            Self::Halves => words.copy_from_slice(&packed([r, g, b, a])),
            Self::Bytes => words[0] = u32::from_le_bytes([r, g, b, a].map(unit)),
            Self::Srgb => {
                let byte = |value: f32| SRGB_BOUNDS.partition_point(|bound| *bound <= value) as u8;
                words[0] = u32::from_le_bytes([byte(r), byte(g), byte(b), unit(a)]);
            }
        }
    }
}

/// Which texels the mean colour of a smaller mip level is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Mean {
    /// All texels alike.
    OfAll,
    /// Each texel as much as it is opaque. Otherwise the hidden colour of transparent texels would bleed into the
    /// visible ones.
    OfSeen,
}

/// Returns half-precision floats in two words, red in the lowest bits. All of them are finite.
fn packed(texel: [f32; 4]) -> [u32; 2] {
    let [r, g, b, a] = texel.map(|value| u32::from(half_bits(value)));
    [r | g << 16, b | a << 16]
}

/// Returns the sizes of an image's mip levels, from that of the image down to one texel.
pub(super) fn sizes(width: u32, height: u32) -> impl Iterator<Item = [u32; 2]> + Clone {
    (0..=width.max(height).ilog2()).map(move |mip| [(width >> mip).max(1), (height >> mip).max(1)])
}

/// Returns the number of words of an image's mip levels, with the table before them.
pub(super) fn n_words(image: &Image, coding: Coding) -> u64 {
    let mips = sizes(image.width, image.height);
    let n_texels: u64 = mips.clone().map(|[width, height]| u64::from(width) * u64::from(height)).sum();
    mips.count() as u64 + n_texels * coding.n_words() as u64
}

/// Writes an image's mip levels to `words`, which [`n_words`] counts, after the table of where each begins.
/// `first_word`: index of the first one of these words in the array.
pub(super) fn write(image: &Image, encoding: Encoding, mean: Mean, words: &mut [u32], first_word: u32) {
    let coding = Coding::of(image, encoding);
    let sizes: Vec<_> = sizes(image.width, image.height).collect();
    let (table, mut rest) = words.split_at_mut(sizes.len());
    let mut begin = first_word + sizes.len() as u32;
    let mut before: Option<Mip> = None;
    for (size, entry) in sizes.into_iter().zip(table) {
        let (mip, after) = rest.split_at_mut(size[0] as usize * size[1] as usize * coding.n_words());
        match &before {
            None => write_pixels(image, encoding, mip),
            Some(before) => before.write_smaller(size, mip),
        }
        *entry = begin;
        begin += mip.len() as u32;
        before = Some(Mip { words: mip, size, coding, mean });
        rest = after;
    }
}

/// Writes mip 0.
fn write_pixels(image: &Image, encoding: Encoding, words: &mut [u32]) {
    match &image.pixels {
        Pixels::Bytes(pixels) => {
            words.par_iter_mut().zip(pixels).for_each(|(word, pixel)| *word = u32::from_le_bytes(*pixel));
        }
        Pixels::Halves(pixels) => words.par_chunks_exact_mut(2).zip(pixels).for_each(|(texel, pixel)| {
            let [r, g, b, a] = pixel.map(|bits| f16::from_bits(bits).to_f32());
            let colour = |value: f32| match encoding {
                Encoding::Srgb => linear_of_srgb(f64::from(value)) as f32,
                Encoding::Linear => value,
            };
            texel.copy_from_slice(&packed([colour(r), colour(g), colour(b), a]));
        }),
    }
}

/// A mip level that has been written.
struct Mip<'a> {
    words: &'a [u32],
    size: [u32; 2],
    coding: Coding,
    mean: Mean,
}

impl Mip<'_> {
    /// Writes the next mip level, of the given size.
    fn write_smaller(&self, size: [u32; 2], words: &mut [u32]) {
        let row_words = size[0] as usize * self.coding.n_words();
        let columns: Vec<_> = (0..size[0]).map(|x| Taps::new(x, self.size[0], size[0])).collect();
        words.par_chunks_exact_mut(row_words).enumerate().for_each(|(y, row)| {
            let rows = Taps::new(y as u32, self.size[1], size[1]);
            for (texel, columns) in row.chunks_exact_mut(self.coding.n_words()).zip(&columns) {
                self.coding.encode(self.mean(columns, &rows), texel);
            }
        });
    }

    /// Returns the mean of the texels under a texel of the next mip level.
    fn mean(&self, columns: &Taps, rows: &Taps) -> [f32; 4] {
        let (mut seen, mut all, mut opacity) = ([0.0; 3], [0.0; 3], 0.0);
        for (y, row_weight) in rows.iter() {
            for (x, column_weight) in columns.iter() {
                let n_words = self.coding.n_words();
                let word_ix = (y * self.size[0] as usize + x) * n_words;
                let [r, g, b, a] = self.coding.decoded(&self.words[word_ix..word_ix + n_words]);
                let area = row_weight * column_weight;
                // An opacity below 0 makes no sense, but floats can have it.
                let weight = area * a.max(0.0);
                for (i, c) in [r, g, b].into_iter().enumerate() {
                    seen[i] += weight * c;
                    all[i] += area * c;
                }
                opacity += weight;
            }
        }
        let [r, g, b] = match self.mean {
            Mean::OfSeen if opacity > 0.0 => seen.map(|sum| sum / opacity),
            _ => all,
        };
        [r, g, b, opacity]
    }
}

/// The texels under a texel of the next mip level along an axis, at most three, and how much of the latter each covers.
struct Taps {
    first: u32,
    weights: [f32; 3],
}

impl Taps {
    /// `ix`: index of the texel of the next mip level, which has `n_smaller` in place of `n`.
    fn new(ix: u32, n: u32, n_smaller: u32) -> Self {
        // Both mip levels have n * n_smaller units.
        let [n, n_smaller, ix] = [n, n_smaller, ix].map(u64::from);
        let (begin, end) = (ix * n, (ix + 1) * n);
        let first = begin / n_smaller;
        let covered = |i: u64| {
            let texel = [(first + i) * n_smaller, (first + i + 1) * n_smaller];
            end.min(texel[1]).saturating_sub(begin.max(texel[0])) as f32 / n as f32
        };
        Self { first: first as u32, weights: [0, 1, 2].map(covered) }
    }

    /// Returns indices of texels and their weights, whose sum is 1.
    fn iter(&self) -> impl Iterator<Item = (usize, f32)> {
        let weights = self.weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0);
        weights.map(|(i, weight)| (self.first as usize + i, *weight))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(width: u32, height: u32, pixels: Vec<[u8; 4]>) -> Image {
        Image { name: "image".to_owned(), width, height, pixels: Pixels::Bytes(pixels), is_linear: false }
    }

    /// Returns the mip levels of an image as bytes.
    fn mips(image: &Image, encoding: Encoding) -> Vec<Vec<[u8; 4]>> {
        mips_by(image, encoding, Mean::OfSeen)
    }

    fn mips_by(image: &Image, encoding: Encoding, mean: Mean) -> Vec<Vec<[u8; 4]>> {
        let mut words = vec![0; n_words(image, Coding::of(image, encoding)) as usize];
        write(image, encoding, mean, &mut words, 1000);
        let sizes: Vec<_> = sizes(image.width, image.height).map(|[w, h]| (w * h) as usize).collect();
        let mut begin = sizes.len();
        let of_mip = |(mip, n): (usize, &usize)| {
            assert_eq!(words[mip], 1000 + begin as u32);
            begin += n;
            words[begin - n..begin].iter().map(|word| word.to_le_bytes()).collect()
        };
        sizes.iter().enumerate().map(of_mip).collect()
    }

    /// The values are those of the standard: a byte of 10 is on the straight part, and 188 is nearest to one half.
    #[test]
    fn the_table_is_srgb() {
        assert_eq!((SRGB[0], SRGB[255]), (0.0, 1.0));
        assert!((SRGB[10] - 10.0 / 255.0 / 12.92).abs() < 1e-8);
        assert!((SRGB[11] - 0.003_346_535_8).abs() < 1e-7 && (SRGB[188] - 0.502_886).abs() < 1e-5);
        for byte in 0..=255 {
            let mut word = [0];
            Coding::Srgb.encode([SRGB[byte], 0.0, 2.0, 1.0], &mut word);
            assert_eq!(word[0].to_le_bytes(), [byte as u8, 0, 255, 255]);
        }
    }

    #[test]
    fn sizes_go_down_to_one() {
        let all = |width, height| sizes(width, height).collect::<Vec<_>>();
        assert_eq!(all(5, 2), [[5, 2], [2, 1], [1, 1]]);
        assert_eq!(all(1, 1), [[1, 1]]);
        assert_eq!(all(16384, 3).len(), 15);
        assert_eq!(n_words(&image(5, 2, Vec::new()), Coding::Halves), 3 + 2 * (10 + 2 + 1));
    }

    #[test]
    fn the_mean_is_one_of_light() {
        let checkers = (0..16).map(|i| [[0, 0, 0, 255], [255, 255, 255, 255]][(i + i / 4) % 2]).collect();
        let checkers = image(4, 4, checkers);
        assert_eq!(mips(&checkers, Encoding::Srgb)[1..], [vec![[188, 188, 188, 255]; 4], vec![[188, 188, 188, 255]]]);
        assert_eq!(mips(&checkers, Encoding::Linear)[1][0], [128, 128, 128, 255]);
    }

    /// Three texels become one, and five become two: 0.4, 0.4 and 0.2 of the first three, and the mirror image of it.
    #[test]
    fn odd_sides_are_weighted_by_area() {
        let greys = |values: &[u8]| values.iter().map(|v| [*v, *v, *v, 255]).collect::<Vec<_>>();
        let row = image(5, 1, greys(&[10, 20, 30, 40, 50]));
        assert_eq!(mips(&row, Encoding::Linear)[1..], [greys(&[18, 42]), greys(&[30])]);
        let column = image(1, 3, greys(&[10, 20, 60]));
        assert_eq!(mips(&column, Encoding::Linear)[1..], [greys(&[30])]);
    }

    #[test]
    fn what_cannot_be_seen_does_not_bleed() {
        let leaf = image(2, 1, vec![[10, 200, 30, 255], [255, 0, 255, 0]]);
        assert_eq!(mips(&leaf, Encoding::Srgb)[1], [[10, 200, 30, 128]]);
        let weighted = image(2, 1, vec![[100, 0, 0, 51], [200, 0, 0, 153]]);
        assert_eq!(mips(&weighted, Encoding::Linear)[1], [[175, 0, 0, 102]]);
        let unseen = image(2, 1, vec![[100, 0, 0, 0], [200, 0, 0, 0]]);
        assert_eq!(mips(&unseen, Encoding::Linear)[1], [[150, 0, 0, 0]]);
    }

    #[test]
    fn data_beside_opacity_is_averaged_plainly() {
        let roughness = image(2, 1, vec![[100, 0, 0, 0], [200, 0, 0, 255]]);
        assert_eq!(mips_by(&roughness, Encoding::Linear, Mean::OfAll)[1], [[150, 0, 0, 128]]);
    }
}
