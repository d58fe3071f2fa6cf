//! Drawing on the device, or on the CPU for want of one.

use std::{borrow::Cow, sync::Arc};

use kdray::{
    cpu::{self, Batching},
    frame::{Picture, RenderOptions},
    gpu::{Context, GpuError},
    render::{BandedRenderer, Drawn, Watcher},
    scene::Camera,
    world::World,
};
use tracing::info_span;

use crate::cli::progress::Steps;

/// Either renderer.
pub enum Drawer {
    Device(Box<BandedRenderer>),
    Cpu(Box<cpu::Renderer>),
}

/// Moves the bar as far as a drawing is.
struct Bar<'a, 'b>(&'a mut Steps<'b>);

impl Watcher for Bar<'_, '_> {
    fn sees_parts(&self) -> bool {
        self.0.shows_parts
    }

    fn part(&mut self, share: f32) {
        self.0.part(share);
    }

    fn sample(&mut self) {
        self.0.step();
    }
}

impl Drawer {
    pub fn new(context: Option<&Arc<Context>>, world: &World, options: &RenderOptions) -> Result<Self, GpuError> {
        Ok(match context {
            Some(context) => Self::Device(Box::new(BandedRenderer::new(Arc::clone(context), world, options)?)),
            None => Self::Cpu(Box::new(cpu::Renderer::new(world, options, Batching::default()))),
        })
    }

    /// Parts of the picture that are drawn one after the other.
    pub fn n_bands(&self) -> u32 {
        match self {
            Self::Device(renderer) => renderer.n_bands(),
            Self::Cpu(_) => 1,
        }
    }

    /// Draws what a camera sees by so many samples a pixel. Each sample of each band is a step.
    pub fn draw(&mut self, camera: &Camera, n_samples: u32, steps: &mut Steps) -> Result<Drawn, GpuError> {
        match self {
            Self::Device(renderer) => {
                renderer.set_camera(camera);
                renderer.draw(n_samples, Bar(steps))
            }
            Self::Cpu(renderer) => {
                renderer.set_camera(camera);
                Ok(draw_on_cpu(renderer, n_samples, steps))
            }
        }
    }

    /// The picture drawn last.
    pub fn picture(&self) -> Result<Cow<'_, Picture>, GpuError> {
        match self {
            Self::Device(renderer) => renderer.picture(),
            Self::Cpu(renderer) => Ok(Cow::Owned(renderer.picture())),
        }
    }
}

fn draw_on_cpu(renderer: &mut cpu::Renderer, n_samples: u32, steps: &mut Steps) -> Drawn {
    let mut sample = |renderer: &mut cpu::Renderer| {
        let profile = info_span!("render").in_scope(|| renderer.draw_sample_with(|share| steps.part(share)));
        steps.step();
        profile
    };
    let mut profile = sample(renderer);
    let features = if renderer.options().features { renderer.features() } else { Vec::new() };
    (1..n_samples).for_each(|_| profile.add(&sample(renderer)));
    Drawn { features, profile }
}
