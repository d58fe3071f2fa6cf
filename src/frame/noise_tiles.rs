//! Noise tiles: squares of a picture of paths that get samples until their noise is low. They are drawn together,
//! wherever they are, as a column of tiles that takes the place of the window.

use std::sync::Arc;

use glam::{UVec2, uvec2};

use super::Crop;
use crate::layout::{MOST_NOISE_TILES, NOISE_TILE_SIZE};

/// Places of noise tiles, in units of their side.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NoiseTiles(Arc<[u32]>);

impl NoiseTiles {
    /// The most tiles that are drawn together.
    pub const MOST: usize = MOST_NOISE_TILES as usize;
    /// Side of a tile, pixels.
    pub const SIZE: u32 = NOISE_TILE_SIZE;
    /// Number of pixels of a tile.
    pub const N_PIXELS: usize = (NOISE_TILE_SIZE * NOISE_TILE_SIZE) as usize;

    /// Returns tiles at the given places.
    ///
    /// # Panics
    /// There are none or more than [`NoiseTiles::MOST`], or a coordinate has more than 16 bits.
    pub fn new(places: &[UVec2]) -> Self {
        assert!((1..=Self::MOST).contains(&places.len()), "{} tiles", places.len());
        let word = |place: &UVec2| {
            assert!(place.max_element() <= 0xffff, "a place with {place}");
            place.x | place.y << 16
        };
        Self(places.iter().map(word).collect())
    }

    /// Returns the places of all tiles that have pixels of a crop, row by row.
    pub fn places_of(crop: &Crop) -> Vec<UVec2> {
        let rows = crop.y0 / Self::SIZE..crop.y1.div_ceil(Self::SIZE);
        let columns = crop.x0 / Self::SIZE..crop.x1.div_ceil(Self::SIZE);
        rows.flat_map(|y| columns.clone().map(move |x| uvec2(x, y))).collect()
    }

    /// The places as the kernels read them.
    pub(crate) fn words(&self) -> &[u32] {
        &self.0
    }

    /// Returns the window that the tiles fill, one below the other.
    pub(crate) fn window(&self) -> Crop {
        Crop::whole(Self::SIZE, Self::SIZE * self.0.len() as u32)
    }
}
