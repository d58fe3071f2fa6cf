//! Draws samples of noise tiles, from anywhere in the picture, all at once.

use super::BandedRenderer;
use crate::{
    buffers::Pixels,
    frame::{DrawnTiles, Goal, NoiseTiles, PathOptions, RenderOptions, TileSamples},
    gpu::GpuError,
};

impl BandedRenderer {
    /// Draws samples of tiles, as many tiles together as the device can bind. All get equally many.
    /// [`BandedRenderer::set_crop`] ends the drawing of tiles.
    ///
    /// # Panics
    /// The options have a noise filter, or they do not ask for paths.
    ///
    /// # Errors
    /// Fails as [`BandedRenderer::draw`] does.
    pub fn draw_tiles(&mut self, tiles: &[TileSamples]) -> Result<DrawnTiles, GpuError> {
        let options = self.renderer.options().clone();
        let most_pixels = self.renderer.context.limits().storage_range / Pixels::bytes_per_pixel(&options);
        let most_tiles = (most_pixels as usize / NoiseTiles::N_PIXELS).clamp(1, NoiseTiles::MOST);
        let mut all = DrawnTiles::default();
        let n_chunks = tiles.len().div_ceil(most_tiles).max(1);
        for together in tiles.chunks(tiles.len().div_ceil(n_chunks).max(1)) {
            let tiles = NoiseTiles::new(together)?;
            let (paths, n_samples) =
                (PathOptions { first_sample: tiles.first_sample(), ..options.paths }, tiles.n_samples());
            (self.bands, self.joined) = (vec![tiles.window()], None);
            self.renderer.set_options(&RenderOptions { noise_tiles: Some(tiles), paths, ..options.clone() })?;
            let drawn = self.draw_band(Goal::Samples(n_samples), &mut || ())?;
            all.append(DrawnTiles { drawn, means: self.renderer.window_mean()? });
        }
        Ok(all)
    }
}
