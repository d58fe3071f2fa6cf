//! Pictures whose rows several devices share.

use std::sync::{Arc, Mutex, PoisonError};

use super::{RendererGroup, handout::Portions, lock, share};
use crate::{
    frame::{Crop, Drawn, Goal, LightLayers, Picture, RenderOptions, Watcher},
    gpu::{Context, GpuError},
    layout::Feature,
};

/// Number of pixels of the smallest tile on a GPU. Fewer pixels leave parts of a large GPU idle.
const LEAST_PIXELS: u32 = 1 << 16;
/// The same on a software driver.
const LEAST_SOFTWARE_PIXELS: u32 = 1 << 8;
/// Number of tiles of a picture for each device, if all tiles are of the smallest size. Each tile takes some time for
/// itself: every dispatch waits for its longest ray.
const MOST_TILES: u32 = 4;
/// Number of rows of a border that is wide: to draw it around several tiles takes long.
const WIDE_BORDER: u32 = 8;

/// Returns how rows are handed out.
pub fn portions(contexts: &[Arc<Context>], options: &RenderOptions) -> Portions {
    if options.border() >= WIDE_BORDER {
        return Portions::OneEach;
    }
    let asked = options.crop_or_whole();
    let least_pixels = if contexts[0].is_software() { LEAST_SOFTWARE_PIXELS } else { LEAST_PIXELS };
    let least = asked.height().div_ceil(MOST_TILES * contexts.len() as u32);
    Portions::Many { least: least.max(least_pixels.div_ceil(asked.width())) }
}

impl RendererGroup {
    /// Draws a picture from tiles of full rows.
    pub(super) fn draw_rows(&mut self, n_samples: u32, watcher: &mut impl Watcher) -> Result<Drawn, GpuError> {
        let (asked, first) = (self.options.crop_or_whole(), self.first_sample);
        // The memory of the last picture is used again.
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
            let of_all = f64::from(crop.height()) / f64::from(asked.height());
            let drawn = renderer.draw(Goal::Samples(n_samples), &mut || tell(of_all))?;
            let pixel = |y: u32| (y - asked.y0) as usize * asked.width() as usize;
            let pixels = pixel(crop.y0)..pixel(crop.y1);
            let mut whole = lock(&picture);
            let Picture { radiance, display, .. } = &mut *whole;
            renderer.picture_into(&mut radiance[pixels.clone()], &mut display[pixels])?;
            Ok(drawn)
        })?;
        let (mut all, mut features) = (None::<Drawn>, Vec::<Feature>::new());
        let mut light = LightLayers::default();
        for (_, mut drawn) in tiles {
            features.append(&mut drawn.features);
            light.0.iter_mut().zip(&mut drawn.light.0).for_each(|(all, part)| all.append(part));
            match &mut all {
                None => all = Some(drawn),
                Some(all) => all.profile.append(drawn.profile),
            }
        }
        self.picture = picture.into_inner().unwrap_or_else(PoisonError::into_inner);
        Ok(Drawn { features, light, ..all.expect("a picture has rows") })
    }
}
