//! Draws a picture whose rows are shared among several devices.

use std::sync::{Arc, Mutex, PoisonError};

use super::{RendererGroup, lock, share, work_queue::Chunking};
use crate::{
    frame::{Crop, Drawn, Goal, Picture, RenderOptions, Watcher},
    gpu::{Context, GpuError},
};

/// Number of pixels of the smallest tile on a GPU. A tile of fewer pixels leaves parts of a large GPU idle.
const LEAST_PIXELS: u32 = 1 << 16;
/// Number of pixels of the smallest tile on a software driver.
const LEAST_SOFTWARE_PIXELS: u32 = 1 << 8;
/// Greatest number of tiles for each device, if all tiles have the smallest size. Each tile has a fixed cost, because
/// every dispatch waits for its longest ray.
const MOST_TILES: u32 = 4;
/// Number of rows from which a border counts as wide. Each tile draws its own border, so that a picture with a wide
/// border gets only one tile for each device.
const WIDE_BORDER: u32 = 8;

/// Returns the rule by which the rows of a picture are cut into tiles.
pub fn chunking(contexts: &[Arc<Context>], options: &RenderOptions) -> Chunking {
    if options.border() >= WIDE_BORDER {
        return Chunking::OneEach;
    }
    let asked = options.crop_or_whole();
    let least_pixels = if contexts[0].is_software() { LEAST_SOFTWARE_PIXELS } else { LEAST_PIXELS };
    let least = asked.height().div_ceil(MOST_TILES * contexts.len() as u32);
    Chunking::Guided { least: least.max(least_pixels.div_ceil(asked.width())) }
}

impl RendererGroup {
    /// Draws a picture from tiles of full rows.
    pub(super) fn draw_rows(&mut self, n_samples: u32, watcher: &mut impl Watcher) -> Result<Drawn, GpuError> {
        let (asked, first) = (self.options.crop_or_whole(), self.first_sample);
        // The last picture's memory is reused.
        let mut whole = std::mem::take(&mut self.picture);
        (whole.width, whole.height) = (asked.width(), asked.height());
        let n_pixels = asked.width() as usize * asked.height() as usize;
        whole.radiance.resize(n_pixels, [0.0; 4]);
        whole.display.resize(n_pixels, [0; 4]);
        let picture = Mutex::new(whole);
        let tiles = share(&mut self.members, &mut self.rows, asked.y0..asked.y1, watcher, |renderer, rows, tell| {
            let crop = Crop { y0: rows.start, y1: rows.end, ..asked };
            renderer.set_first_sample(first)?;
            renderer.set_crop(crop)?;
            // The renderer tells of each sample of each band.
            let share = f64::from(crop.height()) / f64::from(asked.height()) / f64::from(renderer.n_bands());
            let drawn = renderer.draw(Goal::Samples(n_samples), &mut || tell(share))?;
            let pixel = |y: u32| (y - asked.y0) as usize * asked.width() as usize;
            let pixels = pixel(crop.y0)..pixel(crop.y1);
            let mut whole = lock(&picture);
            let Picture { radiance, display, .. } = &mut *whole;
            renderer.picture_into(&mut radiance[pixels.clone()], &mut display[pixels])?;
            Ok(drawn)
        })?;
        let mut all = Drawn { n_samples, ..Drawn::default() };
        for (_, mut drawn) in tiles {
            all.features.append(&mut drawn.features);
            all.light.append(drawn.light);
            all.profile.append(drawn.profile);
        }
        self.picture = picture.into_inner().unwrap_or_else(PoisonError::into_inner);
        Ok(all)
    }
}
