//! Draws noise tiles that are shared among several devices.

use std::sync::Arc;

use super::{RendererGroup, share, work_queue::Chunking};
use crate::{
    frame::{DrawnNoiseTiles, NoiseTileSamples},
    gpu::{Context, GpuError},
};

/// The fewest tiles that a GPU draws together. Fewer pixels leave parts of a large GPU idle.
const FEWEST_TILES: u32 = 1 << 7;
/// The same for a software driver.
const FEWEST_SOFTWARE_TILES: u32 = 1;

/// Returns how tiles are shared.
pub fn chunking(contexts: &[Arc<Context>]) -> Chunking {
    let is_software = contexts[0].is_software();
    Chunking::Guided { least: if is_software { FEWEST_SOFTWARE_TILES } else { FEWEST_TILES } }
}

impl RendererGroup {
    /// Draws samples of tiles, as
    /// [`BandedRenderer::draw_noise_tiles`](crate::render::BandedRenderer::draw_noise_tiles) does.
    pub fn draw_noise_tiles(&mut self, tiles: &[NoiseTileSamples]) -> Result<DrawnNoiseTiles, GpuError> {
        let units = 0..tiles.len() as u32;
        let parts = share(&mut self.members, &mut self.noise_tiles, units, &mut || (), |renderer, units, _| {
            renderer.draw_noise_tiles(&tiles[units.start as usize..units.end as usize])
        })?;
        let mut all = DrawnNoiseTiles::default();
        parts.into_iter().for_each(|(_, part)| all.append(part));
        all.drawn.profile.device = self.device_names();
        Ok(all)
    }
}
