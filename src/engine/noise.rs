//! Draws pictures of paths until their noise is low enough, tile by tile.
//!
//! All tiles of the picture get 16 samples of each pixel, then 16 more, then as many again as they have, until their
//! noise is low enough. A tile whose noise is low gets no more samples, and the others are drawn together, wherever
//! they are. So a tile has the bits of a picture of a fixed number of samples, and a crop has the bits of the whole
//! picture. When few tiles are left, several blocks of their samples are drawn together, so that a device has enough to
//! do.
//!
//! The noise of a tile is measured by its samples alone: the two halves of them are two pictures, and half of the
//! difference between two pictures of equal noise is, on average, the error of their mean.

use glam::UVec2;
use rayon::prelude::*;

use crate::{
    cpu,
    frame::{
        BadOptions, Crop, Drawn, DrawnNoiseTiles, MeanLayers, NoiseTileSamples, NoiseTiles, Picture, Profile,
        RenderOptions, SampleRange, check::check,
    },
    gpu::GpuError,
    layout::{PixelAovs, SAMPLE_BLOCK_LOG2},
};

/// Number of pixels of a tile.
const N_PIXELS: usize = NoiseTiles::N_PIXELS;

/// How low the noise of a picture has to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseGoal {
    /// The most noise of a tile: the root mean square error of what its colours look like. That is the square root of
    /// light up to white, and above it 1 and half of the logarithm. 0.01 is an error of about a hundredth of white.
    pub noise: f32,
    /// Number of samples of each pixel after which a tile gets no more: 2^n, at least [`NoiseGoal::FEWEST`].
    pub most_samples: u32,
}

impl NoiseGoal {
    /// The most samples of a pixel if nothing else is said.
    pub const MOST: u32 = 4096;
    /// The fewest samples of a pixel.
    pub const FEWEST: u32 = 2 << SAMPLE_BLOCK_LOG2;

    /// Checks that the goal can be met.
    ///
    /// # Errors
    /// The noise is not a finite number above 0, or the number of samples is no power of two or out of its range.
    pub fn check(&self) -> Result<(), BadOptions> {
        let (noise, most) = (self.noise, self.most_samples);
        check("noise", noise, noise > 0.0 && noise.is_finite(), || "a finite number above 0".to_owned())?;
        let range = Self::FEWEST..=SampleRange::MOST;
        check("most_samples", most, most.is_power_of_two() && range.contains(&most), || {
            format!("a power of two from {} to {}", range.start(), range.end())
        })
    }

    /// Returns the blocks of samples that a tile gets one after the other: each but the first has as many samples as
    /// all before it.
    fn blocks(&self) -> impl Iterator<Item = SampleRange> + use<> {
        let first = SampleRange { first: 0, end: 1 << SAMPLE_BLOCK_LOG2 };
        let doubled = |block: &SampleRange| Some(SampleRange { first: block.end, end: 2 * block.end });
        let most = self.most_samples;
        std::iter::successors(Some(first), doubled).take_while(move |block| block.end <= most)
    }
}

/// A picture whose noise is low, or whose tiles have the most samples.
#[derive(Clone, Debug)]
pub struct NoisePicture {
    /// The picture.
    pub picture: Picture,
    /// What belongs to it. The number of samples is that of the pixels with the most.
    pub drawn: Drawn,
    /// Number of samples of a pixel, on average.
    pub mean_samples: f64,
    /// Number of tiles.
    pub n_tiles: usize,
    /// Number of tiles with more noise than the goal, because they have the most samples.
    pub n_noisy: usize,
}

/// Draws samples of tiles, all of which get equally many.
pub(super) type DrawNoiseTiles<'a> = dyn FnMut(&[NoiseTileSamples]) -> Result<DrawnNoiseTiles, GpuError> + 'a;

/// Number of tiles with which a device has enough to do: 16 samples of each of their pixels are two million paths.
const ENOUGH_TILES: usize = 512;

/// Returns into how many blocks the samples of each tile are divided, which are drawn together: a power of two.
fn n_ranges(n_tiles: usize, n_devices: usize, samples: SampleRange) -> u32 {
    let wanted = (n_devices * ENOUGH_TILES / n_tiles).max(1).ilog2();
    let most = (samples.len() >> SAMPLE_BLOCK_LOG2).min(NoiseTiles::MOST_BLOCKS);
    most.min(1 << wanted)
}

/// Draws a picture of the options' crop until the goal is met. `draw` shares the tiles among `n_devices`. `progress` is
/// called with the share of the work that is done, as far as the noise tells it, and returns whether the picture ends.
pub(super) fn draw_until(
    goal: NoiseGoal,
    options: &RenderOptions,
    (draw, n_devices): (&mut DrawNoiseTiles, usize),
    mut progress: impl FnMut(f32) -> bool,
) -> Result<NoisePicture, GpuError> {
    let mut tiles: Vec<NoiseTile> =
        NoiseTiles::places_of(&options.crop_or_whole()).into_iter().map(NoiseTile::new).collect();
    let mut profile = Profile::default();
    for block in goal.blocks() {
        let noisy: Vec<&mut NoiseTile> = tiles.iter_mut().filter(|tile| tile.noise > goal.noise).collect();
        if noisy.is_empty() {
            break;
        }
        let n_ranges = n_ranges(noisy.len(), n_devices, block);
        let len = block.len() / n_ranges;
        let range = |ix: u32| SampleRange { first: block.first + ix * len, end: block.first + (ix + 1) * len };
        let ranges_of = |tile: &&mut NoiseTile| {
            let place = tile.place;
            (0..n_ranges).map(move |ix| NoiseTileSamples { place, samples: range(ix) })
        };
        let DrawnNoiseTiles { drawn, means } = draw(&noisy.iter().flat_map(ranges_of).collect::<Vec<_>>())?;
        profile.add(&drawn.profile);
        let layers = drawn.layers.0.iter().filter(|layer| !layer.is_empty()).map(Vec::as_slice);
        let layers: Vec<&[[f32; 4]]> = [&means[..]].into_iter().chain(layers).collect();
        let len_of_tile = n_ranges as usize * N_PIXELS;
        noisy.into_par_iter().enumerate().for_each(|(tile_ix, tile)| {
            let pixels = tile_ix * len_of_tile..(tile_ix + 1) * len_of_tile;
            if block.first == 0 && options.pixel_aovs {
                tile.pixel_aovs = drawn.pixel_aovs[pixels.clone()].to_vec();
            }
            let sums = layers.iter().flat_map(|layer| sum_of_ranges(&layer[pixels.clone()], len as f32)).collect();
            tile.add(block, sums, options);
        });
        let shares = tiles.iter().map(|tile| tile.share_of(goal)).sum::<f32>();
        if progress(shares / tiles.len() as f32) {
            break;
        }
    }
    Ok(joined(&tiles, goal, options, profile))
}

/// A tile and its samples.
struct NoiseTile {
    /// In units of the side of a tile.
    place: UVec2,
    /// Number of samples of each pixel.
    n_samples: u32,
    /// The sums of the samples, and of their squared luminance. The sums of the layers follow, if there are any.
    sums: Vec<[f32; 4]>,
    /// What the first sample of each pixel shows; empty unless the options ask for it.
    pixel_aovs: Vec<PixelAovs>,
    /// Infinite before there are two halves of samples.
    noise: f32,
}

impl NoiseTile {
    fn new(place: UVec2) -> Self {
        Self { place, n_samples: 0, sums: Vec::new(), pixel_aovs: Vec::new(), noise: f32::INFINITY }
    }

    /// Adds the sums of a block with as many samples as there are, or of the first one.
    fn add(&mut self, block: SampleRange, sums: Vec<[f32; 4]>, options: &RenderOptions) {
        if self.sums.is_empty() {
            self.sums = sums;
        } else {
            self.noise = self.noise_between(&sums, block.len() as f32, options);
            add(&mut self.sums, &sums);
        }
        self.n_samples = block.end;
    }

    /// Returns the noise of the tile's samples and of as many others together. `n`: number of samples of each half.
    fn noise_between(&self, others: &[[f32; 4]], n: f32, options: &RenderOptions) -> f32 {
        let seen = |sum: f32| appearance(f64::from(sum / n * options.exposure));
        let (mut squares, mut n_values) = (0.0, 0_u32);
        for (pixel_ix, (sums, others)) in self.sums.iter().zip(others).take(N_PIXELS).enumerate() {
            let at = self.pixel(pixel_ix);
            // Tiles at the right and at the lower edge extend beyond the picture.
            if at.x < options.width && at.y < options.height {
                squares += (0..3).map(|i| (0.5 * (seen(sums[i]) - seen(others[i]))).powi(2)).sum::<f64>();
                n_values += 3;
            }
        }
        (squares / f64::from(n_values.max(1))).sqrt() as f32
    }

    /// Returns the coordinates in the picture of one of the tile's pixels.
    fn pixel(&self, pixel_ix: usize) -> UVec2 {
        let side = NoiseTiles::SIZE;
        side * self.place + UVec2::new(pixel_ix as u32 % side, pixel_ix as u32 / side)
    }

    /// Returns which share of the tile's work is done. The error falls by half when the number of samples becomes four
    /// times as large.
    fn share_of(&self, goal: NoiseGoal) -> f32 {
        let of_noise = (goal.noise / self.noise).powi(2).min(1.0);
        of_noise.max(self.n_samples as f32 / goal.most_samples as f32)
    }
}

/// Returns what light looks like, in units of white: a display shows about its square root, and of light that is
/// brighter than white, relative differences count. `light`: radiance times exposure.
fn appearance(light: f64) -> f64 {
    if light < 1.0 { light.max(0.0).sqrt() } else { 1.0 + 0.5 * light.ln() }
}

/// Returns the sums of a tile's pixels over all blocks of samples, whose means the ranges have: 2^n ranges of `len`
/// samples. They are added as a binary tree. A power of two multiplies without rounding, so the sums have the bits of
/// one block.
fn sum_of_ranges(means: &[[f32; 4]], len: f32) -> Vec<[f32; 4]> {
    if means.len() == N_PIXELS {
        return means.iter().map(|pixel| pixel.map(|mean| mean * len)).collect();
    }
    let (first, second) = means.split_at(means.len() / 2);
    let mut sums = sum_of_ranges(first, len);
    add(&mut sums, &sum_of_ranges(second, len));
    sums
}

fn add(sums: &mut [[f32; 4]], others: &[[f32; 4]]) {
    sums.as_flattened_mut().iter_mut().zip(others.as_flattened()).for_each(|(sum, other)| *sum += other);
}

/// Joins the tiles to the picture of the options' crop.
fn joined(tiles: &[NoiseTile], goal: NoiseGoal, options: &RenderOptions, profile: Profile) -> NoisePicture {
    let crop = options.crop_or_whole();
    let n_pixels = crop.width() as usize * crop.height() as usize;
    let mut radiance = vec![[0.0; 4]; n_pixels];
    let mut layers = MeanLayers::default();
    layers.0[options.mean_layers()].fill(vec![[0.0; 4]; n_pixels]);
    let mut pixel_aovs = vec![PixelAovs::default(); if options.pixel_aovs { n_pixels } else { 0 }];
    let mut n_samples = 0.0;
    for tile in tiles {
        let mean = |ix: usize| tile.sums[ix].map(|sum| sum / tile.n_samples as f32);
        for (pixel_ix, ix) in (0..N_PIXELS).filter_map(|pixel_ix| Some((pixel_ix, ix_in(&crop, tile.pixel(pixel_ix))?)))
        {
            let [r, g, b, squared] = mean(pixel_ix);
            radiance[ix] = [r, g, b, 1.0];
            n_samples += f64::from(tile.n_samples);
            if let Some(aovs) = tile.pixel_aovs.get(pixel_ix) {
                pixel_aovs[ix] = *aovs;
                pixel_aovs[ix].set_noise([r, g, b, squared], tile.n_samples);
            }
            for (nth, layer) in (1..).zip(&mut layers.0[options.mean_layers()]) {
                layer[ix] = mean(nth * N_PIXELS + pixel_ix);
            }
        }
    }
    let display = cpu::display(&radiance, options.exposure, options.tonemap);
    let most = tiles.iter().map(|tile| tile.n_samples).max().unwrap_or(0);
    NoisePicture {
        picture: Picture { width: crop.width(), height: crop.height(), radiance, display },
        drawn: Drawn { pixel_aovs, layers, profile, n_samples: most },
        mean_samples: n_samples / n_pixels as f64,
        n_tiles: tiles.len(),
        n_noisy: tiles.iter().filter(|tile| tile.noise > goal.noise).count(),
    }
}

/// Returns the index of a pixel of the picture among those of a crop, if it is one of them.
fn ix_in(crop: &Crop, pixel: UVec2) -> Option<usize> {
    let is_inside = (crop.x0..crop.x1).contains(&pixel.x) && (crop.y0..crop.y1).contains(&pixel.y);
    is_inside.then(|| (pixel.y - crop.y0) as usize * crop.width() as usize + (pixel.x - crop.x0) as usize)
}
