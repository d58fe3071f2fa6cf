//! Heat maps: counts shown as colours, beside a scale that says which count each colour is.

use std::{convert::Infallible, path::Path};

use embedded_graphics::{
    Drawable, Pixel,
    geometry::{OriginDimensions, Point, Size},
    mono_font::{MonoTextStyle, ascii::FONT_6X13},
    pixelcolor::{Rgb888, RgbColor},
    prelude::DrawTarget,
    text::{Alignment, Baseline, Text, TextStyle, TextStyleBuilder},
};
use image::{ImageFormat, Rgb, RgbImage};

use super::{OutputError, write};

/// A heat map: one count for each pixel.
pub struct HeatMap<'a> {
    /// What is counted.
    pub title: &'a str,
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Counts, `width * height` of them, row by row from the top.
    pub values: Vec<u32>,
}

const BACKGROUND: Rgb<u8> = Rgb([24, 24, 24]);
/// Width of the space around each part of the picture, pixels.
const MARGIN: u32 = 8;
/// Height of a line of text, pixels.
const LINE: u32 = 16;
/// Width of the colour bar, pixels.
const BAR_WIDTH: u32 = 16;
/// Least height of the colour bar, pixels.
const LEAST_BAR_HEIGHT: u32 = 120;
/// Width of the space for the numbers beside the bar, pixels.
const LABEL_WIDTH: u32 = 60;
/// Share of the pixels whose counts the scale covers. If it covered all, a few large counts would leave all others
/// dark.
const SHARE_BELOW_TOP: f64 = 0.995;

impl HeatMap<'_> {
    /// Writes a PNG with the map, the scale to its right and a heading above both.
    ///
    /// # Errors
    /// Fails as [`write()`] does.
    pub fn write(&self, path: &Path) -> Result<(), OutputError> {
        let mut file = std::io::Cursor::new(Vec::new());
        self.draw().write_to(&mut file, ImageFormat::Png).map_err(|source| OutputError::encode(path, source))?;
        write(path, &file.into_inner())
    }

    fn draw(&self) -> RgbImage {
        let most = self.values.iter().copied().max().unwrap_or(0);
        let scale = Scale::of(&self.values);
        let heading = format!("{}: mean {:.1}, most {most}", self.title, mean(&self.values));
        let bar_height = self.height.max(LEAST_BAR_HEIGHT);
        let (left, top) = (MARGIN, MARGIN + LINE + MARGIN);
        let bar_left = left + self.width + MARGIN;
        let heading_width = heading.len() as u32 * FONT_6X13.character_size.width;
        let width = (bar_left + BAR_WIDTH + LABEL_WIDTH).max(left + heading_width) + MARGIN;
        let mut canvas = Canvas(RgbImage::from_pixel(width, top + bar_height + MARGIN, BACKGROUND));

        canvas.text(&heading, left, MARGIN, Baseline::Top);
        for (i, value) in (0..).zip(&self.values) {
            let colour = scale.colour(f64::from(*value));
            canvas.0.put_pixel(left + i % self.width, top + i / self.width, colour);
        }
        for y in 0..bar_height {
            let value = scale.top as f64 * (1.0 - (f64::from(y) + 0.5) / f64::from(bar_height));
            (0..BAR_WIDTH).for_each(|x| canvas.0.put_pixel(bar_left + x, top + y, scale.colour(value)));
        }
        for tick in scale.ticks() {
            let y = top + bar_height - 1 - (u64::from(bar_height - 1) * tick / scale.top) as u32;
            (0..4).for_each(|x| canvas.0.put_pixel(bar_left + BAR_WIDTH + x, y, Rgb([255; 3])));
            let more = if tick == scale.top && u64::from(most) > tick { "+" } else { "" };
            canvas.text(&format!("{tick}{more}"), bar_left + BAR_WIDTH + 7, y, Baseline::Middle);
        }
        canvas.0
    }
}

fn mean(values: &[u32]) -> f64 {
    values.iter().map(|value| f64::from(*value)).sum::<f64>() / (values.len() as f64).max(1.0)
}

/// A linear scale from 0 to `top`, with a tick every `step`.
#[derive(Debug, PartialEq)]
struct Scale {
    top: u64,
    step: u64,
}

impl Scale {
    /// Makes a scale that covers all values but the very few largest, in about five steps of a round number.
    fn of(values: &[u32]) -> Self {
        let mut sorted = values.to_vec();
        let rank = (values.len() as f64 * SHARE_BELOW_TOP) as usize;
        let reach = match sorted.len() {
            0 => 1,
            n => u64::from(*sorted.select_nth_unstable(rank.min(n - 1)).1),
        };
        let step = round_number(reach.div_ceil(5).max(1));
        Self { top: reach.max(1).div_ceil(step) * step, step }
    }

    fn ticks(&self) -> impl Iterator<Item = u64> {
        (0..=self.top).step_by(self.step as usize)
    }

    fn colour(&self, value: f64) -> Rgb<u8> {
        viridis((value / self.top as f64).min(1.0))
    }
}

/// Returns the least of 1, 2, 5, 10, 20, 50, ... that is not below `least`.
fn round_number(least: u64) -> u64 {
    let decades = (0..18).map(|exponent| 10_u64.pow(exponent));
    let mut numbers = decades.flat_map(|ten| [1, 2, 5].map(|n| n * ten));
    numbers.find(|number| *number >= least).expect("counts have fewer digits")
}

/// Returns the colour of `x`, from 0 to 1, in the perceptually even colour map viridis (S. van der Walt, N. Smith,
/// 2015). The polynomials are those that M. Zucker fitted to it (shadertoy.com/view/WlfXRN, 2019).
fn viridis(x: f64) -> Rgb<u8> {
    const COEFFICIENTS: [[f64; 3]; 7] = [
        [0.277_727_327, 0.005_407_345, 0.334_099_805],
        [0.105_093_043, 1.404_613_530, 1.384_590_163],
        [-0.330_861_829, 0.214_847_559, 0.095_095_163],
        [-4.634_230_499, -5.799_100_973, -19.332_440_956],
        [6.228_269_936, 14.179_933_367, 56.690_552_601],
        [4.776_384_998, -13.745_145_378, -65.353_032_633],
        [-5.435_455_856, 4.645_852_612, 26.312_435_250],
    ];
    let channel = |i: usize| COEFFICIENTS.iter().rev().fold(0.0, |sum, term| sum * x + term[i]);
    Rgb([0, 1, 2].map(|i| (channel(i).clamp(0.0, 1.0) * 255.0 + 0.5) as u8))
}

/// The picture as a target that text can be drawn on.
struct Canvas(RgbImage);

impl Canvas {
    fn text(&mut self, text: &str, x: u32, y: u32, baseline: Baseline) {
        let white = MonoTextStyle::new(&FONT_6X13, Rgb888::WHITE);
        let style: TextStyle = TextStyleBuilder::new().alignment(Alignment::Left).baseline(baseline).build();
        let at = Point::new(x as i32, y as i32);
        match Text::with_text_style(text, at, white, style).draw(self) {
            Ok(_) => {}
            Err(impossible) => match impossible {},
        }
    }
}

impl OriginDimensions for Canvas {
    fn size(&self) -> Size {
        Size::new(self.0.width(), self.0.height())
    }
}

impl DrawTarget for Canvas {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(&mut self, pixels: I) -> Result<(), Infallible> {
        for Pixel(at, colour) in pixels {
            let (Ok(x), Ok(y)) = (u32::try_from(at.x), u32::try_from(at.y)) else { continue };
            if let Some(pixel) = self.0.get_pixel_mut_checked(x, y) {
                *pixel = Rgb([colour.r(), colour.g(), colour.b()]);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The expected colours are the first, middle and last rows of the published table.
    #[test]
    fn colours_are_viridis() {
        for (x, expected) in [(0.0, [68, 1, 84]), (0.5, [33, 145, 140]), (1.0, [253, 231, 37])] {
            let Rgb(found) = viridis(x);
            let off = found.iter().zip(&expected).map(|(a, b)| a.abs_diff(*b)).max();
            assert!(off <= Some(5), "{found:?} for {expected:?}");
        }
    }

    #[test]
    fn scales_end_and_step_at_round_numbers() {
        let upto = |n: u32| Scale::of(&(0..n).collect::<Vec<_>>());
        assert_eq!(upto(1000), Scale { top: 1000, step: 200 });
        assert_eq!(upto(90), Scale { top: 100, step: 20 });
        assert_eq!(upto(4), Scale { top: 3, step: 1 });
        for none in [vec![], vec![0; 9]] {
            assert_eq!(Scale::of(&none), Scale { top: 1, step: 1 });
        }
        assert_eq!(upto(90).ticks().collect::<Vec<_>>(), [0, 20, 40, 60, 80, 100]);
        // One large value in a thousand does not stretch the scale.
        let mut outlier = vec![10; 1000];
        outlier[7] = 1_000_000;
        assert_eq!(Scale::of(&outlier), Scale { top: 10, step: 2 });
        assert_eq!(Scale::of(&[u32::MAX]).step, 1_000_000_000);
    }

    #[test]
    fn every_value_has_its_colour_beside_its_number() {
        let values: Vec<u32> = (0..100).map(|i| i % 11).collect();
        let map = HeatMap { title: "steps", width: 10, height: 10, values: values.clone() };
        let image = map.draw();
        for (i, value) in (0..).zip(values) {
            let pixel = *image.get_pixel(MARGIN + i % 10, 2 * MARGIN + LINE + i / 10);
            assert_eq!(pixel, viridis(f64::from(value) / 10.0));
        }
        let bar = MARGIN + 10 + MARGIN;
        let column: Vec<_> = (0..LEAST_BAR_HEIGHT).map(|y| *image.get_pixel(bar, 2 * MARGIN + LINE + y)).collect();
        assert_eq!(*column.last().unwrap(), viridis(0.5 / 120.0));
        assert_eq!(column[0], viridis(1.0 - 0.5 / 120.0));
        // White digits are beside each tick.
        let white = |x: u32, y: u32| *image.get_pixel(x, y) == Rgb([255; 3]);
        for tick in 0..=5 {
            let y = 2 * MARGIN + LINE + 119 - 119 * tick / 5;
            let near = (y.saturating_sub(5)..y + 5).flat_map(|y| (bar + 20..bar + 40).map(move |x| (x, y)));
            assert!(near.filter(|&(x, y)| white(x, y)).count() > 5, "{tick}");
        }
    }

    #[test]
    fn a_map_of_the_largest_counts_is_drawn() {
        let map = HeatMap { title: "steps", width: 1, height: 2, values: vec![u32::MAX, 0] };
        assert!(map.draw().width() > 80);
    }
}
