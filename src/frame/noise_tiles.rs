//! Noise tiles: squares of a picture of paths that get samples until their noise is low. They are drawn together,
//! wherever they are, as a column of tiles that takes the place of the window.

use std::sync::Arc;

use glam::{UVec2, uvec2};

use super::{BadOptions, Crop, SampleRange};
use crate::layout::{MOST_NOISE_TILES, NOISE_TILE_SIZE};

/// A tile, and samples that each of its pixels gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoiseTileSamples {
    /// The place of the tile in the picture, in units of its side.
    pub place: UVec2,
    /// The samples: an aligned block.
    pub samples: SampleRange,
}

/// Tiles that are drawn together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NoiseTiles {
    /// The tiles as the kernels read them (glsl/shared/rays/noise_tiles.glsl).
    words: Arc<[u32]>,
    /// The first sample of all, and the number of samples of each tile.
    first_sample: u32,
    n_samples: u32,
}

impl NoiseTiles {
    /// The most tiles that are drawn together.
    pub const MOST: usize = MOST_NOISE_TILES as usize;
    /// The most blocks of samples that are drawn together.
    pub const MOST_BLOCKS: u32 = 1 << 8;
    /// Side of a tile, pixels.
    pub const SIZE: u32 = NOISE_TILE_SIZE;
    /// Number of pixels of a tile.
    pub const N_PIXELS: usize = (NOISE_TILE_SIZE * NOISE_TILE_SIZE) as usize;

    /// Returns tiles that are drawn together.
    ///
    /// # Errors
    /// There are none or more than [`NoiseTiles::MOST`]; a coordinate has more than 12 bits; the tiles get different
    /// numbers of samples, or samples of more than [`NoiseTiles::MOST_BLOCKS`] blocks.
    pub fn new(tiles: &[NoiseTileSamples]) -> Result<Self, BadOptions> {
        let first_sample = tiles.iter().map(|tile| tile.samples.first).min().unwrap_or(0);
        let n_samples = tiles.first().map_or(0, |tile| tile.samples.len());
        let is_block = n_samples.is_power_of_two() && first_sample.is_multiple_of(n_samples);
        if !(1..=Self::MOST).contains(&tiles.len()) || !is_block {
            let n = tiles.len();
            return Err(BadOptions(format!("noise_tiles: {n} tiles of {n_samples} samples from {first_sample} on")));
        }
        let word = |tile: &NoiseTileSamples| {
            let NoiseTileSamples { place, samples } = *tile;
            let block = (samples.first - first_sample) / n_samples;
            let fits = place.max_element() <= 0xfff && samples.len() == n_samples && block < Self::MOST_BLOCKS;
            let is_right = fits && samples.first.is_multiple_of(n_samples);
            let word = place.x | place.y << 12 | block << 24;
            is_right.then_some(word).ok_or_else(|| BadOptions(format!("noise_tiles: {tile:?} does not fit the others")))
        };
        Ok(Self { words: tiles.iter().map(word).collect::<Result<_, _>>()?, first_sample, n_samples })
    }

    /// Returns the places of all tiles that have pixels of a crop, row by row.
    pub(crate) fn places_of(crop: &Crop) -> Vec<UVec2> {
        let rows = crop.y0 / Self::SIZE..crop.y1.div_ceil(Self::SIZE);
        let columns = crop.x0 / Self::SIZE..crop.x1.div_ceil(Self::SIZE);
        rows.flat_map(|y| columns.clone().map(move |x| uvec2(x, y))).collect()
    }

    /// Index of the first sample of all tiles.
    pub(crate) fn first_sample(&self) -> u32 {
        self.first_sample
    }

    /// The places of the tiles in the picture, in units of their side.
    pub(super) fn places(&self) -> impl Iterator<Item = UVec2> {
        self.words.iter().map(|word| uvec2(word & 0xfff, word >> 12 & 0xfff))
    }

    /// Number of samples that each tile gets.
    pub(crate) fn n_samples(&self) -> u32 {
        self.n_samples
    }

    /// The tiles as the kernels read them.
    pub(crate) fn words(&self) -> &[u32] {
        &self.words
    }

    /// Returns the window that the tiles fill, one below the other.
    pub(crate) fn window(&self) -> Crop {
        Crop::whole(Self::SIZE, Self::SIZE * self.words.len() as u32)
    }
}
