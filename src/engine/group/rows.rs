//! Pictures whose rows several devices share.

use std::sync::Arc;

use super::{RendererGroup, handout::Portions, share};
use crate::{
    frame::{Crop, Drawn, Goal, Picture, RenderOptions, Watcher},
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
        let asked = self.options.crop_or_whole();
        let tiles = share(&mut self.members, &mut self.rows, asked.y0..asked.y1, watcher, |renderer, rows, tell| {
            let crop = Crop { y0: rows.start, y1: rows.end, ..asked };
            renderer.set_crop(crop)?;
            let of_all = f64::from(crop.height()) / f64::from(asked.height());
            let drawn = renderer.draw(Goal::Samples(n_samples), &mut || tell(of_all))?;
            Ok((renderer.picture()?.into_owned(), drawn))
        })?;
        let n_pixels = asked.width() as usize * asked.height() as usize;
        let (width, height) = (asked.width(), asked.height());
        let mut picture = Picture { width, height, radiance: Vec::new(), display: Vec::new() };
        picture.radiance.reserve_exact(n_pixels);
        picture.display.reserve_exact(n_pixels);
        let (mut all, mut features) = (None::<Drawn>, Vec::<Feature>::new());
        for (_, (part, mut drawn)) in tiles {
            picture.radiance.extend(part.radiance);
            picture.display.extend(part.display);
            features.append(&mut drawn.features);
            match &mut all {
                None => all = Some(drawn),
                Some(all) => all.profile.append(drawn.profile),
            }
        }
        self.picture = picture;
        Ok(Drawn { features, ..all.expect("a picture has rows") })
    }
}
