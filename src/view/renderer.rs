//! What draws the pictures of the window: a device, or the CPU engine.

use std::sync::Arc;

use glam::UVec2;

use crate::{
    cpu::{Batching, CpuRenderer},
    frame::{FrameRenderer, Picture, Profile, RenderOptions, View},
    gpu::{Buffer, Context, GpuError},
    layout::PixelAovs,
    render::{Displayed, GpuRenderer},
    scene::Camera,
    world::World,
};

/// A renderer that draws a picture sample by sample, and a sample batch by batch.
pub enum ViewRenderer {
    /// Of a device. The methods of this type are those of [`GpuRenderer`].
    Device(Box<GpuRenderer>),
    /// Of the CPU. It shows the picture alone, no other view.
    Cpu(Box<CpuView>),
}

/// The CPU engine's renderer, with the picture that the window shows.
pub struct CpuView {
    renderer: CpuRenderer,
    most_pixels: Option<u32>,
    /// The last complete picture.
    displayed: Option<(Displayed, Picture)>,
}

/// Pixels of a picture that is displayed.
pub enum DisplayedPixels<'a> {
    /// `pixel_display` of a device.
    Device(&'a Buffer<u32>),
    /// Pixels of the host.
    Host(&'a [[u8; 4]]),
}

impl ViewRenderer {
    /// Creates a renderer on a device or, without one, on the CPU.
    ///
    /// # Errors
    /// Fails as [`GpuRenderer::new`] does.
    pub fn new(context: Option<&Arc<Context>>, world: &World, options: &RenderOptions) -> Result<Self, GpuError> {
        options.check()?;
        Ok(match context {
            Some(context) => Self::Device(Box::new(GpuRenderer::new(context.clone(), world, options)?)),
            None => {
                let renderer = CpuRenderer::new(world, options, Batching::default());
                Self::Cpu(Box::new(CpuView { renderer, most_pixels: None, displayed: None }))
            }
        })
    }

    /// Creates a renderer of the same world, for other options.
    ///
    /// # Errors
    /// Fails as [`GpuRenderer::sharing`] does.
    pub fn sharing(&self, options: &RenderOptions) -> Result<Self, GpuError> {
        Ok(match self {
            Self::Device(renderer) => Self::Device(Box::new(renderer.sharing(options)?)),
            Self::Cpu(view) => {
                options.check()?;
                let renderer = view.renderer.with_options(options);
                Self::Cpu(Box::new(CpuView { renderer, most_pixels: view.most_pixels, displayed: None }))
            }
        })
    }

    /// Returns the options as the caller has set them.
    pub fn options(&self) -> &RenderOptions {
        match self {
            Self::Device(renderer) => renderer.options(),
            Self::Cpu(view) => view.renderer.options(),
        }
    }

    pub fn set_options(&mut self, options: &RenderOptions) -> Result<(), GpuError> {
        match self {
            Self::Device(renderer) => renderer.set_options(options),
            Self::Cpu(view) => {
                options.check()?;
                view.renderer = view.renderer.with_options(options);
                Ok(())
            }
        }
    }

    /// Draws another world from now on. The displayed picture stays until another one is drawn.
    pub fn set_world(&mut self, world: &World) -> Result<(), GpuError> {
        match self {
            Self::Device(renderer) => renderer.set_world(world),
            Self::Cpu(view) => {
                view.renderer.set_world(world);
                Ok(())
            }
        }
    }

    pub fn camera(&self) -> &Camera {
        match self {
            Self::Device(renderer) => renderer.camera(),
            Self::Cpu(view) => view.renderer.camera(),
        }
    }

    pub fn set_camera(&mut self, camera: &Camera) {
        match self {
            Self::Device(renderer) => renderer.set_camera(camera),
            Self::Cpu(view) => view.renderer.set_camera(camera),
        }
    }

    /// Sets the view. The CPU's is always the picture.
    pub fn set_view(&mut self, view: View, brightest: f32) -> bool {
        match self {
            Self::Device(renderer) => renderer.set_view(view, brightest),
            Self::Cpu(_) => false,
        }
    }

    pub fn n_samples(&self) -> u32 {
        match self {
            Self::Device(renderer) => renderer.n_samples(),
            Self::Cpu(view) => view.renderer.n_samples(),
        }
    }

    pub fn reset_samples(&mut self) {
        match self {
            Self::Device(renderer) => renderer.reset_samples(),
            Self::Cpu(view) => view.renderer.reset_samples(),
        }
    }

    pub fn is_pending(&self) -> bool {
        self.progress() > 0.0
    }

    pub fn progress(&self) -> f32 {
        match self {
            Self::Device(renderer) => renderer.progress(),
            Self::Cpu(view) => view.renderer.progress(),
        }
    }

    pub fn limit_batches(&mut self, most_pixels: Option<u32>) -> Result<(), GpuError> {
        match self {
            Self::Device(renderer) => renderer.limit_batches(most_pixels),
            Self::Cpu(view) => {
                view.most_pixels = most_pixels;
                view.renderer.limit_batches(most_pixels);
                Ok(())
            }
        }
    }

    pub fn most_pixels(&self) -> Option<u32> {
        match self {
            Self::Device(renderer) => renderer.most_pixels(),
            Self::Cpu(view) => view.most_pixels,
        }
    }

    pub fn draw_batch(&mut self) -> Result<Option<Profile>, GpuError> {
        match self {
            Self::Device(renderer) => renderer.draw_batch(),
            Self::Cpu(view) => Ok(view.draw_batch()),
        }
    }

    /// Displays the samples by changed options. The CPU has dropped them when the options changed.
    pub fn show(&mut self) -> Result<(), GpuError> {
        match self {
            Self::Device(renderer) => renderer.show(),
            Self::Cpu(_) => Ok(()),
        }
    }

    pub fn displayed(&self) -> Option<Displayed> {
        match self {
            Self::Device(renderer) => renderer.displayed(),
            Self::Cpu(view) => view.displayed.as_ref().map(|(displayed, _)| *displayed),
        }
    }

    /// Returns the pixels of the displayed picture, and its size.
    pub fn displayed_pixels(&self) -> Option<(DisplayedPixels<'_>, (u32, u32))> {
        match self {
            Self::Device(renderer) => {
                renderer.displayed_pixels().map(|(pixels, size)| (DisplayedPixels::Device(pixels), size))
            }
            Self::Cpu(view) => {
                let (displayed, picture) = view.displayed.as_ref()?;
                Some((DisplayedPixels::Host(&picture.display), displayed.size))
            }
        }
    }

    pub fn displayed_picture(&self) -> Result<Option<Picture>, GpuError> {
        match self {
            Self::Device(renderer) => renderer.displayed_picture(),
            Self::Cpu(view) => Ok(view.displayed.as_ref().map(|(_, picture)| picture.clone())),
        }
    }

    pub fn picture(&self) -> Result<Picture, GpuError> {
        match self {
            Self::Device(renderer) => renderer.picture(),
            Self::Cpu(view) => Ok(view.renderer.picture()),
        }
    }

    pub fn aovs_at(&self, pixel: UVec2) -> Result<Option<PixelAovs>, GpuError> {
        match self {
            Self::Device(renderer) => renderer.aovs_at(pixel),
            Self::Cpu(_) => Ok(None),
        }
    }

    pub fn remake_passes(&mut self) -> Result<(), GpuError> {
        match self {
            Self::Device(renderer) => renderer.remake_passes(),
            Self::Cpu(_) => Ok(()),
        }
    }
}

impl CpuView {
    fn draw_batch(&mut self) -> Option<Profile> {
        let profile = self.renderer.draw_batch()?;
        let picture = self.renderer.picture();
        let displayed = Displayed { size: (picture.width, picture.height), camera: *self.renderer.camera() };
        self.displayed = Some((displayed, picture));
        Some(profile)
    }
}
