//! Draws a picture whose samples are shared among several devices. Each device draws aligned blocks of samples of all
//! pixels. One device adds all samples as a binary tree, and the sum of an aligned block is a node of that tree. So the
//! mean has the same bits as that of one device.

use super::{Member, RendererGroup, remove_failed, share};
use crate::{
    frame::{Drawn, Goal, Picture, Profile, SampleRange, SampleSums, Watcher},
    gpu::GpuError,
    layout::SAMPLE_BLOCK_LOG2,
};

/// Number of samples of a unit of work.
pub const UNIT: u32 = 1 << SAMPLE_BLOCK_LOG2;

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
            let (mut sums, mut profile) = (SampleSums::default(), Profile::default());
            for block in range.blocks() {
                renderer.set_first_sample(block.first)?;
                let drawn = renderer.draw(Goal::Samples(block.len()), &mut || tell(1.0))?;
                sums.push_mean(block, &renderer.window_mean()?);
                profile.add(&drawn.profile);
            }
            Ok((sums, profile))
        })?;
        let (mut sums, mut profile) = (SampleSums::default(), Profile::default());
        for (_, (part, part_profile)) in parts {
            part.into_blocks().into_iter().for_each(|block| sums.push(block));
            profile.add(&part_profile);
        }
        self.picture = self.picture_of(sums.into_mean())?;
        Ok(Drawn { profile, n_samples, ..Drawn::default() })
    }

    /// Returns the picture of the mean of all samples, filtered and encoded by the first member that does not fail.
    fn picture_of(&mut self, mut mean: Vec<[f32; 4]>) -> Result<Picture, GpuError> {
        let asked = self.options.crop_or_whole();
        loop {
            let Member { ix, renderer, .. } = &mut self.members[0];
            // If it drew no samples, its crop is still that of the last picture.
            match renderer.set_crop(asked).and_then(|()| renderer.picture_of(&mut mean)) {
                Ok(picture) => return Ok(picture),
                Err(error) => {
                    let ix = *ix;
                    remove_failed(&mut self.members, ix, error)?;
                }
            }
        }
    }
}
