//! Pictures whose samples several devices share. Each device draws aligned blocks of samples of all pixels, whose sums
//! are nodes of the tree in which all samples are added. So the mean has the same bits as that of one device.

use super::{RendererGroup, share};
use crate::{
    frame::{Drawn, Goal, Profile, SampleRange, SampleSums, Watcher},
    gpu::GpuError,
    layout::MOST_SAMPLES_LOG2,
};

/// Number of samples that are handed out together: those of a frame of paths.
pub const UNIT: u32 = 1 << MOST_SAMPLES_LOG2;

impl RendererGroup {
    /// Draws a picture from samples of all pixels.
    pub(super) fn draw_samples(&mut self, n_samples: u32, watcher: &mut impl Watcher) -> Result<Drawn, GpuError> {
        let asked = self.options.crop_or_whole();
        let first = self.first_sample;
        let all = first + n_samples;
        let units = 0..n_samples.div_ceil(UNIT);
        let parts = share(&mut self.members, &mut self.samples, units, watcher, |renderer, units, tell| {
            renderer.set_crop(asked)?;
            let range = SampleRange { first: first + units.start * UNIT, end: (first + units.end * UNIT).min(all) };
            let (mut sums, mut profile) = (SampleSums::default(), None::<Profile>);
            for block in range.blocks() {
                renderer.set_first_sample(block.first)?;
                let drawn = renderer.draw(Goal::Samples(block.len()), &mut || tell(1.0))?;
                sums.push_mean(block, &renderer.window_mean()?);
                match &mut profile {
                    None => profile = Some(drawn.profile),
                    Some(profile) => profile.add(&drawn.profile),
                }
            }
            Ok((sums, profile.unwrap_or_default()))
        })?;
        let (mut sums, mut profile) = (SampleSums::default(), None::<Profile>);
        for (_, (part, part_profile)) in parts {
            part.into_blocks().into_iter().for_each(|block| sums.push(block));
            match &mut profile {
                None => profile = Some(part_profile),
                Some(profile) => profile.add(&part_profile),
            }
        }
        let display = &mut self.members[0].renderer;
        // It may have had no samples to draw.
        display.set_crop(asked)?;
        self.picture = display.picture_of(sums.into_mean())?;
        Ok(Drawn { profile: profile.unwrap_or_default(), n_samples, ..Drawn::default() })
    }
}
