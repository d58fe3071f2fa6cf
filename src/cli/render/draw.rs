//! Drawing on the device, or on the CPU for want of one.

use std::sync::Arc;

use kdray::{
    cpu::{self, Batching},
    frame::{Picture, Profile, RenderOptions},
    gpu::{Context, GpuError},
    kdtree::KdTree,
    layout::Feature,
    render::Renderer,
    scene::{Camera, Scene},
};
use tracing::info_span;

use crate::cli::progress::Steps;

/// Either renderer.
pub enum Drawer<'a> {
    Device(Box<Renderer>),
    Cpu(Box<cpu::Renderer<'a>>),
}

/// What comes of drawing, beside the picture.
pub struct Drawn {
    /// Of the first sample, at the pixels' centres; empty where the options do not ask for them.
    pub features: Vec<Feature>,
    /// All samples together.
    pub profile: Profile,
}

impl<'a> Drawer<'a> {
    pub fn new(
        context: Option<&Arc<Context>>,
        scene: &'a Scene,
        tree: &'a KdTree,
        options: &'a RenderOptions,
    ) -> Result<Self, GpuError> {
        Ok(match context {
            Some(context) => Self::Device(Box::new(Renderer::new(Arc::clone(context), scene, tree, options)?)),
            None => Self::Cpu(Box::new(cpu::Renderer::new(scene, tree, options, Batching::default()))),
        })
    }

    /// Draws what a camera sees by so many samples a pixel.
    pub fn draw(&mut self, camera: &Camera, n_samples: u32, steps: &mut Steps) -> Result<Drawn, GpuError> {
        self.set_camera(camera);
        let mut profile = self.draw_sample()?;
        let features = self.features()?;
        steps.step();
        for _ in 1..n_samples {
            profile.add(&self.draw_sample()?);
            steps.step();
        }
        Ok(Drawn { features, profile })
    }

    fn set_camera(&mut self, camera: &Camera) {
        match self {
            Self::Device(renderer) => renderer.set_camera(camera),
            Self::Cpu(renderer) => renderer.set_camera(camera),
        }
    }

    fn draw_sample(&mut self) -> Result<Profile, GpuError> {
        match self {
            Self::Device(renderer) => renderer.draw_sample(),
            Self::Cpu(renderer) => Ok(info_span!("render").in_scope(|| renderer.draw_sample())),
        }
    }

    fn features(&self) -> Result<Vec<Feature>, GpuError> {
        match self {
            Self::Device(renderer) if renderer.options().features => renderer.features(),
            Self::Cpu(renderer) if renderer.options().features => Ok(renderer.features()),
            _ => Ok(Vec::new()),
        }
    }

    /// The picture drawn last.
    pub fn picture(&self) -> Result<Picture, GpuError> {
        match self {
            Self::Device(renderer) => renderer.picture(),
            Self::Cpu(renderer) => Ok(renderer.picture()),
        }
    }
}
