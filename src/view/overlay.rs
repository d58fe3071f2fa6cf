//! Draws egui's output over a window's image.

use std::sync::Arc;

use egui::{ClippedPrimitive, TextureId, TexturesDelta};
use egui_ash_renderer::{DynamicRendering, Options, RenderMode, Renderer, RendererError, allocator::GpuAllocator};

use crate::gpu::{Commands, Context, FRAMES_IN_FLIGHT, GpuError, Presenter, WindowImage};

/// Device objects that draw egui's output: pipeline, textures and meshes.
pub struct Overlay {
    /// None only while the overlay is dropped.
    renderer: Option<Renderer<GpuAllocator>>,
    /// Textures that no further frame uses. They are freed once the frames in flight have ended.
    released: Vec<TextureId>,
    context: Arc<Context>,
}

/// egui's output for one frame.
pub struct OverlayFrame {
    /// Meshes with their clip rectangles.
    pub primitives: Vec<ClippedPrimitive>,
    /// Pixels per egui point.
    pub pixels_per_point: f32,
}

impl Overlay {
    /// Creates the pipeline for the presenter's image format.
    ///
    /// # Errors
    /// Out of memory.
    pub fn new(context: &Arc<Context>, presenter: &Presenter) -> Result<Self, GpuError> {
        let mode = RenderMode::DynamicRendering(DynamicRendering {
            color_attachment_format: presenter.format(),
            depth_attachment_format: None,
            stencil_attachment_format: None,
        });
        let options = Options { in_flight_frames: FRAMES_IN_FLIGHT, ..Options::default() };
        let allocator = context.allocator();
        let renderer =
            Renderer::with_gpu_allocator(allocator, context.device().clone(), mode, options).map_err(error)?;
        Ok(Self { renderer: Some(renderer), released: Vec::new(), context: context.clone() })
    }

    /// Uploads new and changed textures. It must be called before each [`Self::draw`].
    ///
    /// # Errors
    /// Out of memory; a failed copy.
    pub fn update_textures(&mut self, mut textures: TexturesDelta) -> Result<(), GpuError> {
        if textures.is_empty() && self.released.is_empty() {
            return Ok(());
        }
        // Frames in flight may still read the textures that are replaced here.
        self.context.wait_for_all()?;
        let renderer = self.renderer.as_mut().expect("a renderer");
        for id in self.released.drain(..) {
            renderer.free_texture(id).map_err(error)?;
        }
        for (id, changes) in textures.set.drain() {
            for change in changes {
                self.context
                    .with_queue(|queue, pool| renderer.set_texture(queue, pool, id, &change))?
                    .map_err(error)?;
            }
        }
        self.released.extend(textures.free.drain());
        Ok(())
    }

    /// Draws over the contents of the window's image.
    ///
    /// # Errors
    /// Out of memory.
    pub fn draw(&mut self, commands: &Commands, image: &WindowImage, frame: &OverlayFrame) -> Result<(), GpuError> {
        let renderer = self.renderer.as_mut().expect("a renderer");
        let drawn = renderer.cmd_draw(commands.raw(), image.extent(), frame.pixels_per_point, &frame.primitives);
        drawn.map_err(error)
    }
}

impl Drop for Overlay {
    fn drop(&mut self) {
        let _ = self.context.wait_for_all();
        drop(self.renderer.take());
    }
}

/// Converts an error of egui's renderer.
fn error(error: RendererError) -> GpuError {
    match error {
        RendererError::Vulkan(result) => GpuError::call("drawing", "overlay")(result),
        other => GpuError::Other { object: "the overlay", message: other.to_string() },
    }
}
