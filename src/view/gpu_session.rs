//! The viewer's device objects: the renderer, and the passes that show its picture and the overlay in the window.

use std::sync::Arc;

use egui::TexturesDelta;

use super::{
    in_motion::PictureKind,
    loaded_scene::LoadedScene,
    overlay::{Overlay, OverlayFrame},
};
use crate::{
    engine::choices::{Cache, Choices, Methods, Request, Workload},
    frame::{FrameRenderer, RenderOptions},
    gpu::{Context, ContextOptions, GpuError, Presenter, WindowHandles},
    passes::Present,
    render::GpuRenderer,
};

/// A device that renders a scene and shows its pictures in a window.
pub struct GpuSession {
    /// The renderer that draws now.
    pub renderer: GpuRenderer,
    /// Choices made for the scene with which the device was opened.
    pub choices: Choices,
    present: Present,
    /// The renderer of the other kind of pictures, with its pass. It keeps its pipelines and buffers while it is not
    /// used.
    other: Option<(GpuRenderer, Present)>,
    /// Whether the picture of the other renderer is shown, since `renderer` has not drawn any since it was changed to.
    shows_other: bool,
    overlay: Overlay,
    pub presenter: Presenter,
    pub context: Arc<Context>,
}

impl GpuSession {
    /// Opens the device and uploads the scene. `request` decides the traversal and the primary visibility; those in
    /// `options` are replaced.
    ///
    /// # Errors
    /// No device can render and present, or the scene or the picture exceeds the device's limits or memory.
    pub fn open(
        window: Arc<dyn WindowHandles>,
        device: &ContextOptions,
        loaded: &LoadedScene,
        options: &RenderOptions,
        request: Request,
        vsync: bool,
    ) -> Result<Self, GpuError> {
        let (context, surface) = Context::for_window(device, window)?;
        let methods = methods_for(&context, loaded, request, (options.width, options.height))?;
        let options = methods.apply(options);
        let presenter = Presenter::new(&context, surface, vsync)?;
        let overlay = Overlay::new(&context, &presenter)?;
        let renderer = GpuRenderer::new(context.clone(), &loaded.built.world, &options)?;
        let present = Present::new(&context, renderer.resources(), &presenter)?;
        let choices = Choices::of_pictures(loaded.built.accel, methods);
        let (other, shows_other) = (None, false);
        Ok(Self { renderer, choices, present, other, shows_other, overlay, presenter, context })
    }

    /// Changes to the renderer of another kind of pictures. It is made at the first change; from then on, both are
    /// kept. The picture of the previous one stays on screen until the other one has drawn a picture. `options` are of
    /// that kind, and have a size for which the buffers are made.
    ///
    /// # Errors
    /// The buffers exceed the device's memory. Then nothing has changed.
    pub fn change_to(&mut self, options: &RenderOptions) -> Result<(), GpuError> {
        let is_of = |renderer: &GpuRenderer| PictureKind::of(renderer.options()) == PictureKind::of(options);
        let (renderer, present) = match self.other.take_if(|(renderer, _)| is_of(renderer)) {
            Some(other) => other,
            None => {
                let renderer = self.renderer.sharing(options)?;
                let present = Present::new(&self.context, renderer.resources(), &self.presenter)?;
                (renderer, present)
            }
        };
        let before = (std::mem::replace(&mut self.renderer, renderer), std::mem::replace(&mut self.present, present));
        self.other = Some(before);
        self.shows_other = true;
        Ok(())
    }

    /// Releases the renderer that is not used.
    pub fn drop_other(&mut self) {
        if !self.shows_other {
            self.other = None;
        }
    }

    /// Notes that the renderer that draws now has a picture of the present view, which is shown from now on.
    pub fn note_picture(&mut self) {
        self.shows_other = false;
    }

    /// Returns the renderer whose picture is shown.
    pub fn front(&self) -> &GpuRenderer {
        match &self.other {
            Some((other, _)) if self.shows_other => other,
            _ => &self.renderer,
        }
    }

    /// Replaces the renderer that draws, and with it the other one.
    fn install(&mut self, renderer: GpuRenderer) -> Result<(), GpuError> {
        let present = Present::new(&self.context, renderer.resources(), &self.presenter)?;
        self.context.wait_for_all()?;
        (self.renderer, self.present) = (renderer, present);
        (self.other, self.shows_other) = (None, false);
        Ok(())
    }

    /// Replaces the scene. If that fails, the previous scene stays.
    ///
    /// # Errors
    /// The scene exceeds the device's limits or memory.
    pub fn set_scene(&mut self, loaded: &LoadedScene) -> Result<(), GpuError> {
        let camera = *self.renderer.camera();
        let mut renderer = GpuRenderer::new(self.context.clone(), &loaded.built.world, self.renderer.options())?;
        renderer.set_camera(&camera);
        self.install(renderer)
    }

    /// Replaces the scene by that of another file, from whose camera the next picture is drawn. Chooses traversal and
    /// primary visibility as [`Self::open`] does; the size of the pictures stays. Returns the options. If it fails, the
    /// previous scene stays.
    ///
    /// # Errors
    /// The scene exceeds the device's limits or memory.
    pub fn open_scene(&mut self, loaded: &LoadedScene) -> Result<RenderOptions, GpuError> {
        let RenderOptions { width, height, .. } = *self.renderer.options();
        let methods = methods_for(&self.context, loaded, loaded.load_settings.builder.request, (width, height))?;
        let options = methods.apply(&RenderOptions { width, height, ..loaded.built.options.clone() });
        self.install(GpuRenderer::new(self.context.clone(), &loaded.built.world, &options)?)?;
        Ok(options)
    }

    /// Replaces the shaders. If the device refuses them, the previous ones stay.
    ///
    /// # Errors
    /// The driver refuses a shader.
    pub fn replace_shaders(&mut self, shaders: crate::gpu::Replacements) -> Result<(), GpuError> {
        self.context.wait_for_all()?;
        let before = self.context.replace_shaders(shaders);
        let remade = Present::new(&self.context, self.renderer.resources(), &self.presenter)
            .and_then(|present| self.renderer.remake_passes().map(|()| self.present = present));
        match remade {
            Ok(()) => (self.other, self.shows_other) = (None, false),
            Err(_) => drop(self.context.replace_shaders(before)),
        }
        remade
    }

    /// Uploads egui's changes of its textures. Every change must be passed on, since each is relative to the last.
    ///
    /// # Errors
    /// Out of memory, or a copy fails.
    pub fn update_textures(&mut self, textures: TexturesDelta) -> Result<(), GpuError> {
        self.overlay.update_textures(textures)
    }

    /// Shows the displayed picture, and the overlay over it. Returns false if the window cannot show anything now.
    /// `window` is the window's size in pixels.
    ///
    /// # Errors
    /// A Vulkan call fails.
    pub fn show(&mut self, window: (u32, u32), overlay: Option<&OverlayFrame>) -> Result<bool, GpuError> {
        let Self { renderer, present, other, shows_other, overlay: drawer, presenter, .. } = self;
        let (renderer, present) = match other {
            Some((renderer, present)) if *shows_other => (&*renderer, &*present),
            _ => (&*renderer, &*present),
        };
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

/// Chooses traversal and primary visibility for pictures in motion, which must be quick and are smaller than the
/// window. `window` is the window's size in pixels.
fn methods_for(
    context: &Arc<Context>,
    loaded: &LoadedScene,
    request: Request,
    window: (u32, u32),
) -> Result<Methods, GpuError> {
    let workload = Workload { size: (window.0 / 4, window.1 / 4), ..loaded.built.workload };
    request.methods(Some(context), &loaded.built.world, &workload, &Cache::open())
}

impl Drop for GpuSession {
    fn drop(&mut self) {
        // Frames in flight still read the objects that are dropped. An error means that the device is lost; then
        // there is nothing to wait for.
        let _ = self.context.wait_for_all();
    }
}
