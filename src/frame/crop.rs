//! Rectangular parts of a picture.

use std::{borrow::Cow, fmt, str::FromStr};

use bytemuck::{Pod, allocation::zeroed_vec};
use rayon::prelude::*;

use super::{Denoise, RenderOptions};
use crate::layout::EDGE_BORDER;

/// A rectangle of at least one pixel: the pixels (x, y) of a picture with `x0 <= x < x1` and `y0 <= y < y1`, counted
/// from the upper left corner. Crops, windows and bands are such rectangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crop {
    /// The first column.
    pub x0: u32,
    /// The first row.
    pub y0: u32,
    /// The column after the last one.
    pub x1: u32,
    /// The row after the last one.
    pub y1: u32,
}

impl Crop {
    /// Returns the crop that is the whole picture.
    pub fn whole(width: u32, height: u32) -> Self {
        Self { x0: 0, y0: 0, x1: width, y1: height }
    }

    /// Number of columns; 0 if there are none.
    pub fn width(&self) -> u32 {
        self.x1.saturating_sub(self.x0)
    }

    /// Number of rows; 0 if there are none.
    pub fn height(&self) -> u32 {
        self.y1.saturating_sub(self.y0)
    }

    /// Returns the crop with `border` more pixels on each side, clipped to a picture of `width` x `height` pixels.
    fn grown(&self, border: u32, width: u32, height: u32) -> Self {
        Self {
            x0: self.x0.saturating_sub(border),
            y0: self.y0.saturating_sub(border),
            x1: self.x1.saturating_add(border).min(width),
            y1: self.y1.saturating_add(border).min(height),
        }
    }

    /// Copies the pixels of `crop` out of those of this rectangle, which must contain it. `pixels`: the pixels of
    /// this rectangle, rows from the top.
    pub(crate) fn cut<'a, T: Pod + Send + Sync + 'a>(&self, pixels: impl Into<Cow<'a, [T]>>, crop: &Crop) -> Vec<T> {
        let pixels = pixels.into();
        if self == crop {
            return pixels.into_owned();
        }
        let (left, width) = ((crop.x0 - self.x0) as usize, crop.width() as usize);
        let mut part = zeroed_vec(width * crop.height() as usize);
        let rows = pixels.par_chunks_exact(self.width() as usize).skip((crop.y0 - self.y0) as usize);
        let parts = part.par_chunks_exact_mut(width);
        parts.zip(rows).for_each(|(part, row)| part.copy_from_slice(&row[left..left + width]));
        part
    }

    /// Copies the pixels of `crop` to their places in those of this rectangle, which must contain it. `pixels`: the
    /// pixels of this rectangle, rows from the top.
    pub(crate) fn place<T: Copy + Send + Sync>(&self, pixels: &mut [T], crop: &Crop, part: &[T]) {
        let (left, width) = ((crop.x0 - self.x0) as usize, crop.width() as usize);
        let rows = pixels.par_chunks_exact_mut(self.width() as usize).skip((crop.y0 - self.y0) as usize);
        rows.zip(part.par_chunks_exact(width)).for_each(|(row, part)| row[left..left + width].copy_from_slice(part));
    }
}

impl RenderOptions {
    /// Returns the crop or, without one, the whole picture. Noise tiles count as the column that they are drawn as.
    pub fn crop_or_whole(&self) -> Crop {
        match &self.noise_tiles {
            Some(tiles) => tiles.window(),
            None => self.crop.unwrap_or(Crop::whole(self.width, self.height)),
        }
    }

    /// Returns the window, the part of the picture to be rendered: the crop and the border around it that the noise
    /// filter reads.
    pub fn window(&self) -> Crop {
        match &self.noise_tiles {
            Some(tiles) => tiles.window(),
            None => self.crop_or_whole().grown(self.border(), self.width, self.height),
        }
    }

    /// Returns the width of the border around the crop that the noise filter reads, pixels.
    pub(crate) fn border(&self) -> u32 {
        match self.noise_filter() {
            Denoise::Off => 0,
            Denoise::Paper { .. } => 1,
            Denoise::Edge => EDGE_BORDER,
        }
    }
}

impl FromStr for Crop {
    type Err = &'static str;

    fn from_str(word: &str) -> Result<Self, Self::Err> {
        let numbers: Option<Vec<u32>> = word.split(',').map(|number| number.trim().parse().ok()).collect();
        match numbers.as_deref() {
            Some(&[x0, y0, x1, y1]) if x0 < x1 && y0 < y1 => Ok(Self { x0, y0, x1, y1 }),
            Some([_, _, _, _]) => Err("x0 must be less than x1, and y0 less than y1"),
            _ => Err("expected four whole numbers x0,y0,x1,y1"),
        }
    }
}

impl fmt::Display for Crop {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{},{},{},{}", self.x0, self.y0, self.x1, self.y1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Integrator;

    #[test]
    fn words() {
        let crop = Crop { x0: 1, y0: 2, x1: 30, y1: 4 };
        assert_eq!("1,2,30,4".parse(), Ok(crop));
        assert_eq!(crop.to_string().parse(), Ok(crop));
        for word in ["", "1,2,3", "1,2,3,4,5", "1,2,1,4", "3,2,1,4", "1,4,3,4", "-1,0,1,1", "0,0,1.5,1", "a,b,c,d"] {
            assert!(word.parse::<Crop>().is_err(), "{word}");
        }
    }

    #[test]
    fn the_filter_needs_a_border_inside_the_picture() {
        let crop = Some(Crop { x0: 0, y0: 3, x1: 5, y1: 8 });
        let options = RenderOptions { width: 9, height: 8, crop, ..RenderOptions::default() };
        assert_eq!(options.window(), Crop { x0: 0, y0: 2, x1: 6, y1: 8 });
        let options = RenderOptions { denoise: Denoise::Off, ..options };
        assert_eq!(options.window(), options.crop_or_whole());
        let crop = Some(Crop { x0: 400, y0: 10, x1: 410, y1: 20 });
        let (integrator, denoise) = (Integrator::Path, Denoise::Edge);
        let options = RenderOptions { width: 480, height: 300, crop, denoise, ..RenderOptions::default() };
        assert_eq!(options.window(), options.crop_or_whole(), "of Whitted's rays, nothing is filtered");
        let options = RenderOptions { integrator, ..options };
        assert_eq!(options.window(), Crop { x0: 335, y0: 0, x1: 475, y1: 85 });
    }

    #[test]
    fn a_part_is_cut_out() {
        let window = Crop { x0: 10, y0: 20, x1: 13, y1: 23 };
        let pixels = [0, 1, 2, 3, 4, 5, 6, 7, 8];
        assert_eq!(window.cut(&pixels, &Crop { x0: 11, y0: 21, x1: 13, y1: 22 }), [4, 5]);
        assert_eq!(window.cut(&pixels, &Crop { x0: 10, y0: 22, x1: 11, y1: 23 }), [6]);
        assert_eq!(window.cut(&pixels, &window), pixels);
    }

    #[test]
    fn a_part_is_put_back() {
        let window = Crop { x0: 10, y0: 20, x1: 13, y1: 23 };
        let mut pixels = [0; 9];
        window.place(&mut pixels, &Crop { x0: 11, y0: 21, x1: 13, y1: 23 }, &[1, 2, 3, 4]);
        assert_eq!(pixels, [0, 0, 0, 0, 1, 2, 0, 3, 4]);
    }
}
