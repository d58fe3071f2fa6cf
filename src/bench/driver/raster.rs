//! Rasterization in place of primary rays. Frames of `max_depth` 1 are drawn, and the times of their tracing passes
//! count.

use std::sync::Arc;

use super::report::{PassSpread, RasterResult, SetResult};
use crate::{
    bench::{Spread, stage::Stage},
    frame::{Denoise, PassTime, Primary, RenderOptions},
    gpu::{Context, GpuError},
    render::GpuRenderer,
};

/// A renderer of a stage's view, and the times of its passes.
pub struct Raster {
    primary: Primary,
    renderer: GpuRenderer,
    /// One entry per frame: names and milliseconds of its passes. Empty where the device has no timestamps.
    frames: Vec<Vec<(&'static str, f64)>>,
}

impl Raster {
    /// Makes a renderer with one method of rasterization.
    ///
    /// # Errors
    /// Fails as [`GpuRenderer::new`] does.
    pub fn new(context: &Arc<Context>, stage: &Stage, primary: Primary) -> Result<Self, GpuError> {
        let options = RenderOptions {
            width: stage.frame.width,
            height: stage.frame.height,
            max_depth: 1,
            denoise: Denoise::Off,
            primary,
            ..RenderOptions::default()
        };
        let renderer = GpuRenderer::new(Arc::clone(context), &stage.world, &options)?;
        Ok(Self { primary, renderer, frames: Vec::new() })
    }

    /// Makes a renderer for each method of rasterization that the device supports.
    ///
    /// # Errors
    /// Fails as [`GpuRenderer::new`] does.
    pub fn all(context: &Arc<Context>, stage: &Stage) -> Result<Vec<Self>, GpuError> {
        let software_raster = context.has_int64_atomics().then_some(Primary::SoftwareRaster);
        [Primary::Raster].into_iter().chain(software_raster).map(|primary| Self::new(context, stage, primary)).collect()
    }

    /// Draws `n_frames` frames, after one that is not counted.
    ///
    /// # Errors
    /// Fails as [`GpuRenderer::draw`] does.
    pub fn draw(&mut self, n_frames: u16) -> Result<(), GpuError> {
        self.renderer.draw()?;
        for _ in 0..n_frames {
            let passes = self.renderer.draw()?.passes;
            // Blended surfaces add bounces, which are no matter of rasterization.
            let is_of_camera = |pass: &&PassTime| pass.pass().finds_hits() && pass.bounce.unwrap_or_default() == 0;
            let tracing = passes.iter().filter(is_of_camera);
            self.frames.extend(tracing.map(|pass| pass.ms.map(|ms| (pass.name, ms))).collect::<Option<Vec<_>>>());
        }
        Ok(())
    }

    /// Returns the result of all frames so far. `primary` is the result on the set of primary rays, which also has
    /// one ray per pixel.
    pub fn result(&self, primary: &SetResult) -> RasterResult {
        let sums = self.frames.iter().map(|frame| frame.iter().map(|(_, ms)| ms).sum());
        let names = self.frames.first().into_iter().flatten().map(|(name, _)| *name);
        let ms_of = |pass_ix: usize| Spread::of(self.frames.iter().map(|frame| frame[pass_ix].1));
        let passes = names.enumerate().filter_map(|(i, name)| ms_of(i).map(|ms| PassSpread { name, ms })).collect();
        RasterResult::new(self.primary.to_string(), passes, Spread::of(sums), primary)
    }
}
