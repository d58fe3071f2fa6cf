//! Primary rays that are rasterized: the visibility and primary_hit passes of whole frames of one bounce.

use std::sync::Arc;

use super::report::{RasterResult, SetResult};
use crate::{
    bench::{Spread, stage::Stage},
    frame::{Denoise, Primary, RenderOptions},
    gpu::{Context, GpuError},
    render::Renderer,
};

/// Frames of a stage's view, and the times of their passes.
pub struct Raster {
    renderer: Renderer,
    visibility_ms: Vec<f64>,
    primary_hit_ms: Vec<f64>,
}

impl Raster {
    /// # Errors
    /// As [`Renderer::new`].
    pub fn new(context: &Arc<Context>, stage: &Stage) -> Result<Self, GpuError> {
        let options = RenderOptions {
            width: stage.frame.width,
            height: stage.frame.height,
            max_depth: 1,
            denoise: Denoise::Off,
            primary: Primary::Raster,
            ..RenderOptions::default()
        };
        let renderer = Renderer::new(Arc::clone(context), &stage.scene, &stage.tree, &options)?;
        Ok(Self { renderer, visibility_ms: Vec::new(), primary_hit_ms: Vec::new() })
    }

    /// Draws so many frames, after one that is not counted.
    ///
    /// # Errors
    /// As [`Renderer::draw`].
    pub fn draw(&mut self, n_frames: u16) -> Result<(), GpuError> {
        self.renderer.draw()?;
        for _ in 0..n_frames {
            let profile = self.renderer.draw()?;
            self.visibility_ms.extend(profile.pass_ms("visibility"));
            self.primary_hit_ms.extend(profile.pass_ms("primary_hit"));
        }
        Ok(())
    }

    /// All frames so far, beside the driver's primary rays, which are as many.
    pub fn result(&self, primary: &SetResult) -> RasterResult {
        let both = self.visibility_ms.iter().zip(&self.primary_hit_ms).map(|(a, b)| a + b);
        RasterResult::new(
            [&self.visibility_ms, &self.primary_hit_ms].map(|ms| Spread::of(ms.iter().copied())),
            Spread::of(both),
            primary,
        )
    }
}
