//! What the viewer has on the device: the renderer, and the way from its picture into the window.

use std::sync::Arc;

use egui::TexturesDelta;

use super::{
    loaded::Loaded,
    overlay::{Overlay, OverlayFrame},
};
use crate::{
    engine::choices::{Cache, Choices, Request, Workload},
    frame::RenderOptions,
    gpu::{Context, ContextOptions, GpuError, Presenter, Screen},
    passes::Present,
    render::Renderer,
};

/// A scene on a device that shows its pictures in a window.
pub struct Live {
    pub renderer: Renderer,
    /// What was chosen for the scene that it was opened with.
    pub choices: Choices,
    present: Present,
    overlay: Overlay,
    pub presenter: Presenter,
    pub context: Arc<Context>,
}

impl Live {
    /// Opens the device and uploads the scene. `request`: the methods that the user wants, in place of the options'.
    ///
    /// # Errors
    /// No device can do it; the scene or the picture is beyond its limits or memory.
    pub fn open(
        window: Arc<dyn Screen>,
        device: &ContextOptions,
        loaded: &Loaded,
        options: &RenderOptions,
        request: Request,
        vsync: bool,
    ) -> Result<Self, GpuError> {
        let (context, surface) = Context::for_window(device, window)?;
        // In motion, where it has to be quick, a picture is smaller than its window.
        let moving = (options.width / 4, options.height / 4);
        let workload = Workload { size: moving, ..loaded.load_options.workload };
        let cache = Cache::open();
        let methods = request.methods(Some(&context), &loaded.world, &workload, &cache)?;
        let options = methods.apply(options);
        let presenter = Presenter::new(&context, surface, vsync)?;
        let overlay = Overlay::new(&context, &presenter)?;
        let renderer = Renderer::new(context.clone(), &loaded.world, &options)?;
        let present = Present::new(&context, renderer.resources(), &presenter)?;
        let choices = Choices::of_pictures(loaded.accel, methods);
        Ok(Self { renderer, choices, present, overlay, presenter, context })
    }

    /// Puts another scene in the place of the last one, which stays where that fails.
    ///
    /// # Errors
    /// The scene is beyond the device's limits or memory.
    pub fn set_scene(&mut self, loaded: &Loaded) -> Result<(), GpuError> {
        let camera = *self.renderer.camera();
        let mut renderer = Renderer::new(self.context.clone(), &loaded.world, self.renderer.options())?;
        renderer.set_camera(&camera);
        self.context.wait()?;
        self.renderer = renderer;
        Ok(())
    }

    /// Goes on with other shaders; where the device refuses them, with those before.
    ///
    /// # Errors
    /// The driver refuses a shader.
    #[cfg(feature = "hot-reload")]
    pub fn replace_shaders(&mut self, shaders: crate::gpu::Replacements) -> Result<(), GpuError> {
        self.context.wait()?;
        let before = self.context.replace_shaders(shaders);
        let remade = Present::new(&self.context, self.renderer.resources(), &self.presenter)
            .and_then(|present| self.renderer.remake_passes().map(|()| self.present = present));
        if remade.is_err() {
            self.context.replace_shaders(before);
        }
        remade
    }

    /// Takes over what egui has changed in its textures; no change may be left out.
    ///
    /// # Errors
    /// Out of memory; a failed copy.
    pub fn update_textures(&mut self, textures: TexturesDelta) -> Result<(), GpuError> {
        self.overlay.update_textures(textures)
    }

    /// Shows what is displayed, and the overlay over it. False where the window cannot show anything now. `window`: its size
    /// in pixels.
    ///
    /// # Errors
    /// A failed call.
    pub fn show(&mut self, window: (u32, u32), overlay: Option<&OverlayFrame>) -> Result<bool, GpuError> {
        let Self { renderer, present, overlay: drawer, presenter, .. } = self;
        presenter.present(window, |commands, image| {
            if let Some(displayed) = renderer.displayed() {
                present.record(commands, renderer.resources(), displayed.size, image);
            }
            match overlay {
                Some(frame) => drawer.draw(commands, image, frame),
                None => Ok(()),
            }
        })
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        // Frames in flight still read what goes; after a lost device there is nothing to wait for.
        let _ = self.context.wait();
    }
}
