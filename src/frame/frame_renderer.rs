//! The frames of a picture, one after the other, as a device and the CPU draw them.

use super::{
    Drawn, DrawnNoiseTiles, Goal, Integrator, MeanLayers, NoiseTileSamples, NoiseTiles, Pacer, Profile, RenderOptions,
    Watcher,
};
use crate::{
    gpu::GpuError,
    layout::{MOST_SAMPLES_LOG2, PixelAovs},
};

/// A renderer that draws frames: one sample of each pixel, or of paths, several ones.
pub trait FrameRenderer {
    /// The options as the caller has set them.
    fn options(&self) -> &RenderOptions;

    /// Number of samples per pixel of which the picture is the mean.
    fn n_samples(&self) -> u32;

    /// Drops all samples, so that the next one is the first of a new picture.
    fn reset_samples(&mut self);

    /// Returns the base-2 logarithm of the most samples that a frame of paths should draw.
    fn most_samples_log2(&self) -> u32;

    /// The base-2 logarithm of the number of samples that the next frame of paths draws.
    fn samples_log2(&mut self) -> &mut u32;

    /// Draws the next frame. Tells the watcher of the progress within it, but not of its samples.
    ///
    /// # Errors
    /// A call fails, or one pixel alone makes more rays than the queue holds.
    fn draw_frame(&mut self, watcher: &mut impl Watcher) -> Result<Profile, GpuError>;

    /// Makes tiles the part of the picture that is drawn next.
    ///
    /// # Errors
    /// The tiles exceed the device's limits or memory.
    fn set_noise_tiles(&mut self, tiles: NoiseTiles) -> Result<(), GpuError>;

    /// Returns the mean of the samples before the noise filter, of the whole window. In frames of paths, the fourth
    /// component is the mean of their squared luminance.
    ///
    /// # Errors
    /// A copy fails.
    fn window_mean(&self) -> Result<Vec<[f32; 4]>, GpuError>;

    /// Returns the AOVs of each pixel of the picture: the first hit, and the costs of the pixel's rays, in the
    /// sample that was drawn last. Of paths, they are those of the first sample of the frame that was drawn last.
    ///
    /// # Panics
    /// The options do not ask for AOVs.
    ///
    /// # Errors
    /// A copy fails.
    fn pixel_aovs(&self) -> Result<Vec<PixelAovs>, GpuError>;

    /// Finds what the ray through the centre of each pixel hits, without a lens. Returns the AOVs, whose costs have no
    /// meaning. Drops all samples.
    ///
    /// # Panics
    /// The options do not ask for AOVs, or not for paths.
    ///
    /// # Errors
    /// Fails as [`FrameRenderer::draw_frame`] does.
    fn centre_aovs(&mut self) -> Result<Vec<PixelAovs>, GpuError>;

    /// Returns the layers that are means of all samples, which are empty if the options do not ask for them. The last
    /// sample must be complete.
    ///
    /// # Errors
    /// A copy fails.
    fn mean_layers(&self) -> Result<MeanLayers, GpuError>;

    /// Sets the number of samples that the next frame of paths draws: `2^log2`, at most `2^MOST_SAMPLES_LOG2`. The
    /// number of samples so far must be a multiple of it. The picture does not depend on it. Other frames draw one.
    ///
    /// # Panics
    /// `log2` is too large, or the number of samples so far is no multiple.
    fn set_samples_per_frame(&mut self, log2: u32) {
        let n_samples = self.n_samples();
        assert!(log2 <= MOST_SAMPLES_LOG2 && n_samples.is_multiple_of(1 << log2), "2^{log2} after {n_samples}");
        *self.samples_log2() = log2;
    }

    /// Draws a new picture of the window, and reports its progress to the watcher, which can end it after any frame.
    ///
    /// # Errors
    /// Fails as [`FrameRenderer::draw_frame`] does, or if the options' first sample is none from which so many samples
    /// can be drawn together.
    fn draw_window(&mut self, goal: Goal, watcher: &mut impl Watcher) -> Result<Drawn, GpuError> {
        self.options().check_samples(goal)?;
        self.reset_samples();
        let RenderOptions { integrator, pixel_aovs, .. } = *self.options();
        // The samples of paths are at random places of their pixels.
        let at_centres = if pixel_aovs && integrator == Integrator::Path { self.centre_aovs()? } else { Vec::new() };
        let (mut pacer, mut drawn) = (Pacer::new(goal, integrator, self.most_samples_log2()), Drawn::default());
        while let Some(log2) = pacer.next(drawn.n_samples) {
            if integrator == Integrator::Path {
                self.set_samples_per_frame(log2);
            }
            let profile = self.draw_frame(watcher)?;
            (drawn.n_samples..self.n_samples()).for_each(|_| watcher.sample());
            drawn.profile.add(&profile);
            if drawn.n_samples == 0 && pixel_aovs {
                drawn.pixel_aovs = self.pixel_aovs()?;
                drawn.pixel_aovs.iter_mut().zip(&at_centres).for_each(|(aovs, at_centre)| {
                    *aovs = PixelAovs { n_rays: aovs.n_rays, n_steps: aovs.n_steps, ..*at_centre };
                });
            }
            drawn.n_samples = self.n_samples();
            if watcher.ends() {
                break;
            }
        }
        if pixel_aovs && integrator == Integrator::Path {
            let options = self.options();
            let means = options.window().cut(self.window_mean()?, &options.crop_or_whole());
            drawn.pixel_aovs.iter_mut().zip(means).for_each(|(aovs, mean)| aovs.set_noise(mean, drawn.n_samples));
        }
        drawn.layers = self.mean_layers()?;
        Ok(drawn)
    }

    /// Draws samples of noise tiles, up to `most` tiles together. All tiles get equally many.
    ///
    /// # Errors
    /// Fails as [`FrameRenderer::draw_frame`] and [`FrameRenderer::set_noise_tiles`] do.
    fn draw_noise_tiles(&mut self, tiles: &[NoiseTileSamples], most: usize) -> Result<DrawnNoiseTiles, GpuError> {
        let mut all = DrawnNoiseTiles::default();
        let n_chunks = tiles.len().div_ceil(most).max(1);
        for together in tiles.chunks(tiles.len().div_ceil(n_chunks).max(1)) {
            let tiles = NoiseTiles::new(together)?;
            let goal = Goal::Samples(tiles.n_samples());
            self.set_noise_tiles(tiles)?;
            let drawn = self.draw_window(goal, &mut || ())?;
            all.append(DrawnNoiseTiles { drawn, means: self.window_mean()? });
        }
        Ok(all)
    }
}
