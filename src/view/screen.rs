//! The window's device objects: the passes that show a picture and the overlay over it.
//!
//! Software drivers compile a kernel when it first runs, within their queue, which takes seconds for kernels of paths.
//! What is submitted meanwhile waits for it. So a window of a software driver has a device of its own, with a queue of
//! its own, and the picture is copied there.

use std::{borrow::Cow, sync::Arc};

use egui::TexturesDelta;

use super::{
    gpu_session::GpuSession,
    overlay::{Overlay, OverlayFrame},
    renderer::DisplayedPixels,
};
use crate::{
    gpu::{BindingSet, Buffer, BufferUse, Context, ContextOptions, GpuError, Presenter, Replacements, WindowHandles},
    passes::Present,
};

/// The device that shows pictures in a window.
pub struct Screen {
    // The order of the fields is the order of their release.
    /// The picture that is shown; none before the first one.
    shown: Option<Shown>,
    present: Present,
    overlay: Overlay,
    pub presenter: Presenter,
    context: Arc<Context>,
}

/// A picture on the window's device.
struct Shown {
    /// `pixel_display`: the renderer's own buffer, or a copy of it.
    pixels: Buffer<u32>,
    set: BindingSet,
    /// Width and height, pixels.
    size: (u32, u32),
}

impl Screen {
    /// Opens the device. Also returns the device that draws, which is the same one unless it is a software driver; none
    /// if the CPU draws.
    ///
    /// # Errors
    /// No device can render and present, or memory is exhausted.
    pub fn open(
        window: Arc<dyn WindowHandles>,
        device: &ContextOptions,
        (vsync, on_cpu): (bool, bool),
    ) -> Result<(Self, Option<Arc<Context>>), GpuError> {
        let (context, surface) = Context::for_window(device, window.clone())?;
        let draws = match (on_cpu, context.is_software()) {
            (true, _) => None,
            (false, true) => Some(Context::for_window(device, window)?.0),
            (false, false) => Some(context.clone()),
        };
        let presenter = Presenter::new(&context, surface, vsync)?;
        let overlay = Overlay::new(&context, &presenter)?;
        let present = Present::new(&context, &presenter)?;
        Ok((Self { shown: None, present, overlay, presenter, context }, draws))
    }

    /// Takes over the picture that the renderers display.
    ///
    /// # Errors
    /// Out of memory, or a copy fails.
    pub fn take_picture(&mut self, gpu: &GpuSession) -> Result<(), GpuError> {
        let Some((displayed, size)) = gpu.front().displayed_pixels() else {
            self.shown = None;
            return Ok(());
        };
        let n_pixels = size.0 as usize * size.1 as usize;
        let copied = match displayed {
            DisplayedPixels::Device(pixels) if self.is_device_of(gpu) => {
                let is_kept = |shown: &Shown| Arc::ptr_eq(shown.pixels.any(), pixels.any());
                return self.bind(size, is_kept, |_| Ok(pixels.clone()));
            }
            DisplayedPixels::Device(pixels) => Cow::Owned(pixels.download_first(n_pixels)?),
            DisplayedPixels::Host(pixels) => Cow::Borrowed(bytemuck::cast_slice(pixels)),
        };
        // Frames in flight still read the previous picture.
        self.context.wait_for_all()?;
        let make = |context: &Arc<Context>| Buffer::new(context, "shown", n_pixels, BufferUse::Storage);
        self.bind(size, |shown| shown.pixels.len() >= n_pixels, make)?;
        self.shown.as_ref().map_or(Ok(()), |shown| shown.pixels.upload(&copied))
    }

    /// Returns whether the window's device is the one that draws.
    fn is_device_of(&self, gpu: &GpuSession) -> bool {
        gpu.context.as_ref().is_some_and(|context| Arc::ptr_eq(context, &self.context))
    }

    /// Binds the buffer of a picture of `size`, which is made unless the bound one is kept.
    fn bind(
        &mut self,
        size: (u32, u32),
        is_kept: impl Fn(&Shown) -> bool,
        make: impl FnOnce(&Arc<Context>) -> Result<Buffer<u32>, GpuError>,
    ) -> Result<(), GpuError> {
        match &mut self.shown {
            Some(shown) if is_kept(shown) => shown.size = size,
            _ => {
                let pixels = make(&self.context)?;
                let set = self.present.set(&pixels)?;
                self.shown = Some(Shown { pixels, set, size });
            }
        }
        Ok(())
    }

    /// Uploads egui's changes of its textures. Every change must be passed on, since each is relative to the last.
    ///
    /// # Errors
    /// Out of memory, or a copy fails.
    pub fn update_textures(&mut self, textures: TexturesDelta) -> Result<(), GpuError> {
        self.overlay.update_textures(textures)
    }

    /// Makes the window's shaders again from those that have replaced the previous ones on the device that draws.
    ///
    /// # Errors
    /// The driver refuses a shader. Then the previous ones stay.
    pub fn replace_shaders(&mut self, gpu: &GpuSession, shaders: Replacements) -> Result<(), GpuError> {
        self.context.wait_for_all()?;
        if !self.is_device_of(gpu) {
            self.context.replace_shaders(shaders);
        }
        self.present = Present::new(&self.context, &self.presenter)?;
        Ok(())
    }

    /// Shows the picture, and the overlay over it. Returns false if the window cannot show anything now. `window` is
    /// the window's size in pixels.
    ///
    /// # Errors
    /// A Vulkan call fails.
    pub fn show(&mut self, window: (u32, u32), overlay: Option<&OverlayFrame>) -> Result<bool, GpuError> {
        let Self { shown, present, overlay: drawer, presenter, .. } = self;
        presenter.present(window, |commands, image| {
            if let Some(Shown { set, size, .. }) = shown {
                present.record(commands, set, *size, image);
            }
            match overlay {
                Some(frame) => drawer.draw(commands, image, frame),
                None => Ok(()),
            }
        })
    }

    /// Returns the window's device.
    pub fn context(&self) -> &Arc<Context> {
        &self.context
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        // Frames in flight still read the objects that are dropped. An error means that the device is lost; then
        // there is nothing to wait for.
        let _ = self.context.wait_for_all();
    }
}
