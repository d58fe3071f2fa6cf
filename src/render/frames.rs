//! The frames of a device's pictures.

use std::time::{Duration, Instant};

use super::{GpuRenderer, incremental::Until};
use crate::{
    frame::{FrameRenderer, MeanLayers, NoiseTiles, PathOptions, Profile, RenderOptions, Watcher},
    gpu::GpuError,
    layout::{FILTER_CENTRE, Frame, PixelAovs},
};

/// Duration above which a sample is slow. The sample after a slow one is drawn recording by recording
/// (`incremental.rs`), if the watcher sees the progress of samples. The wait for the device after each recording takes
/// about 0.1 ms. All these waits take less than a hundredth of a slow sample, but on a fast GPU a wait takes as long as
/// a whole recording.
const SLOW_SAMPLE: Duration = Duration::from_millis(500);

impl FrameRenderer for GpuRenderer {
    fn options(&self) -> &RenderOptions {
        &self.options
    }

    fn n_samples(&self) -> u32 {
        self.n_samples
    }

    fn reset_samples(&mut self) {
        self.n_samples = 0;
        self.has_sums = false;
        self.pending = None;
    }

    fn most_samples_log2(&self) -> u32 {
        let constants = self.resources.constants();
        self.budget.most_samples_log2(self.context.info(), u64::from(constants.width) * u64::from(constants.height))
    }

    fn samples_log2(&mut self) -> &mut u32 {
        &mut self.samples_log2
    }

    /// Draws recording by recording if the frame is expected to be slow and the watcher sees the progress of samples.
    fn draw_frame(&mut self, watcher: &mut impl Watcher) -> Result<Profile, GpuError> {
        let begin = Instant::now();
        let until = if self.is_slow && watcher.sees_sample_progress() { Until::Recording } else { Until::End };
        let profile = loop {
            match self.go_on(until)? {
                Some(profile) => break profile,
                None => watcher.sample_progress(self.progress()),
            }
        };
        self.is_slow = begin.elapsed() > SLOW_SAMPLE;
        Ok(profile)
    }

    fn set_noise_tiles(&mut self, tiles: NoiseTiles) -> Result<(), GpuError> {
        let paths = PathOptions { first_sample: tiles.first_sample(), ..self.options.paths };
        self.set_options(&RenderOptions { noise_tiles: Some(tiles), paths, ..self.options.clone() })
    }

    fn window_mean(&self) -> Result<Vec<[f32; 4]>, GpuError> {
        self.resources.pixels.pixel_radiance.download_first(self.resources.n_pixels())
    }

    fn pixel_aovs(&self) -> Result<Vec<PixelAovs>, GpuError> {
        self.pixel_aovs()
    }

    fn centre_aovs(&mut self) -> Result<Vec<PixelAovs>, GpuError> {
        let set_camera = |renderer: &mut Self, pixel_filter, aperture| {
            let constants = *renderer.resources.constants();
            renderer.resources.set_constants(&Frame { pixel_filter, aperture, ..constants });
        };
        let Frame { pixel_filter, aperture, .. } = *self.resources.constants();
        let (of_view, is_slow) = (std::mem::replace(&mut self.needs_primary_rays_only, true), self.is_slow);
        set_camera(self, FILTER_CENTRE, 0.0);
        self.reset_samples();
        let drawn = self.draw_frame(&mut || ());
        set_camera(self, pixel_filter, aperture);
        (self.needs_primary_rays_only, self.is_slow) = (of_view, is_slow);
        self.reset_samples();
        drawn.and_then(|_| self.pixel_aovs())
    }

    fn mean_layers(&self) -> Result<MeanLayers, GpuError> {
        let mut layers = MeanLayers::default();
        let (n_pixels, radiance) = (self.resources.n_pixels(), &self.resources.pixels.pixel_radiance);
        let (window, crop) = (self.in_use.window(), self.in_use.crop_or_whole());
        for (layer_ix, layer) in (1..).zip(&mut layers.0[self.in_use.mean_layers()]) {
            *layer = window.cut(radiance.download_range(layer_ix * n_pixels, n_pixels)?, &crop);
        }
        Ok(layers)
    }
}
