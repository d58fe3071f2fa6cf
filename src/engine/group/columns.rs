//! Draws a picture whose columns are shared among several devices. The left and the right half of a picture take about
//! the same time more often than a half of sky and one of ground.

use std::sync::{Arc, Mutex, PoisonError};

use super::{RendererGroup, are_alike, lock, share, work_queue::Chunking};
use crate::{
    frame::{Crop, Drawn, Goal, Picture, Profile, RenderOptions, Watcher},
    gpu::{Context, GpuError},
    render::JoinedPicture,
};

/// Number of pixels of the smallest strip on a GPU. A strip of fewer pixels leaves parts of a large GPU idle.
const LEAST_PIXELS: u32 = 1 << 16;
/// Number of pixels of the smallest strip on a software driver.
const LEAST_SOFTWARE_PIXELS: u32 = 1 << 8;
/// Greatest number of strips for each device, if all strips have the smallest size and devices differ. Each strip has a
/// fixed cost, because every dispatch waits for its longest ray.
const MOST_STRIPS: u32 = 4;
/// Number of pixels from which a border counts as wide. Each strip draws its own border, so that a picture with a wide
/// border gets only one strip for each device.
const WIDE_BORDER: u32 = 8;

/// Returns the rule by which the columns of a picture are cut into strips.
pub fn chunking(contexts: &[Arc<Context>], options: &RenderOptions) -> Chunking {
    let is_software = contexts[0].is_software();
    if options.border() >= WIDE_BORDER || (!is_software && are_alike(contexts)) {
        return Chunking::OneEach;
    }
    let asked = options.crop_or_whole();
    let least_pixels = if is_software { LEAST_SOFTWARE_PIXELS } else { LEAST_PIXELS };
    let least = asked.width().div_ceil(MOST_STRIPS * contexts.len() as u32);
    Chunking::Guided { least: least.max(least_pixels.div_ceil(asked.height())) }
}

impl RendererGroup {
    /// Draws a picture from strips of full columns.
    pub(super) fn draw_columns(&mut self, n_samples: u32, watcher: &mut impl Watcher) -> Result<Drawn, GpuError> {
        let (asked, first) = (self.options.crop_or_whole(), self.first_sample);
        self.picture = Picture::default();
        let joined = Mutex::new(JoinedPicture::new(asked, &self.options)?);
        let units = asked.x0..asked.x1;
        let strips = share(&mut self.members, &mut self.columns, units, watcher, |renderer, columns, tell| {
            let crop = Crop { x0: columns.start, x1: columns.end, ..asked };
            renderer.set_first_sample(first)?;
            renderer.set_crop(crop)?;
            // The renderer tells of each sample of each band.
            let share = f64::from(crop.width()) / f64::from(asked.width()) / f64::from(renderer.n_bands());
            let drawn = renderer.draw(Goal::Samples(n_samples), &mut || tell(share))?;
            let strip = renderer.picture()?;
            lock(&joined).place(&crop, &strip, &drawn);
            Ok(drawn.profile)
        })?;
        let mut profile = Profile::default();
        strips.into_iter().for_each(|(_, part)| profile.append(part));
        let joined = joined.into_inner().unwrap_or_else(PoisonError::into_inner);
        self.picture = joined.picture;
        Ok(Drawn { n_samples, profile, ..joined.drawn })
    }
}
