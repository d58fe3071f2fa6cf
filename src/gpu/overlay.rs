//! Draws what egui has laid out over a window's image.

use std::{mem::ManuallyDrop, sync::Arc};

use egui::{ClippedPrimitive, TextureId, TexturesDelta};
use egui_ash_renderer::{DynamicRendering, Options, RenderMode, Renderer, allocator::GpuAllocator};

use super::{Commands, Context, GpuError, Presenter, WindowImage, presenter::FRAMES_IN_FLIGHT};

/// egui's pipeline, textures and meshes.
pub struct Overlay {
    renderer: ManuallyDrop<Renderer<GpuAllocator>>,
    /// Shown by the last frame for the last time.
    released: Vec<TextureId>,
    context: Arc<Context>,
}

/// What to draw.
pub struct OverlayFrame {
    pub primitives: Vec<ClippedPrimitive>,
    /// Pixels of one of egui's points.
    pub pixels_per_point: f32,
}

impl Overlay {
    /// # Errors
    /// Out of memory.
    pub fn new(context: &Arc<Context>, presenter: &Presenter) -> Result<Self, GpuError> {
        let mode = RenderMode::DynamicRendering(DynamicRendering {
            color_attachment_format: presenter.format(),
            depth_attachment_format: None,
            stencil_attachment_format: None,
        });
        let options = Options { in_flight_frames: FRAMES_IN_FLIGHT, ..Options::default() };
        let allocator = Arc::clone(&context.allocator);
        let renderer = Renderer::with_gpu_allocator(allocator, context.device.clone(), mode, options)?;
        Ok(Self { renderer: ManuallyDrop::new(renderer), released: Vec::new(), context: context.clone() })
    }

    /// Takes over new and changed textures; to be called before each `draw`.
    ///
    /// # Errors
    /// Out of memory; a failed copy.
    pub fn update_textures(&mut self, mut textures: TexturesDelta) -> Result<(), GpuError> {
        if textures.is_empty() && self.released.is_empty() {
            return Ok(());
        }
        // Frames in flight may still show what is replaced here.
        self.context.wait()?;
        for id in self.released.drain(..) {
            self.renderer.free_texture(id)?;
        }
        for (id, changes) in textures.set.drain() {
            for change in changes {
                self.renderer.set_texture(self.context.queue, self.context.command_pool, id, &change)?;
            }
        }
        self.released.extend(textures.free.drain());
        Ok(())
    }

    /// Draws over what the window's image holds.
    ///
    /// # Errors
    /// Out of memory.
    pub fn draw(&mut self, commands: &Commands, image: &WindowImage, frame: &OverlayFrame) -> Result<(), GpuError> {
        Ok(self.renderer.cmd_draw(commands.raw, image.extent, frame.pixels_per_point, &frame.primitives)?)
    }
}

impl Drop for Overlay {
    fn drop(&mut self) {
        let _ = self.context.wait();
        // SAFETY: dropped once, here, with the device idle and alive.
        unsafe { ManuallyDrop::drop(&mut self.renderer) };
    }
}
