//! The renderers of the pictures that the window shows.

use std::sync::Arc;

use super::{in_motion::PictureKind, loaded_scene::LoadedScene, renderer::ViewRenderer};
use crate::{
    engine::choices::{Cache, Choices, Methods, Request, Workload},
    frame::RenderOptions,
    gpu::{Context, GpuError},
    world::World,
};

/// A device, or the CPU, that renders a scene.
pub struct GpuSession {
    /// The renderer that draws now.
    pub renderer: ViewRenderer,
    /// Choices made for the scene with which the device was opened.
    pub choices: Choices,
    /// The renderer of the other kind of pictures. It keeps its pipelines and buffers while it is not used.
    other: Option<ViewRenderer>,
    /// Whether the picture of the other renderer is shown, since `renderer` has not drawn any since it was changed to.
    shows_other: bool,
    /// Whether the other renderer still has the world of an earlier moment.
    is_other_late: bool,
    /// The world that is drawn.
    world: World,
    /// The world of the picture that is shown.
    seen: World,
    /// The device; none if the CPU draws.
    pub context: Option<Arc<Context>>,
}

impl GpuSession {
    /// Uploads the scene to a device, or takes it for the CPU if there is none. `request` decides the traversal and the
    /// primary visibility; those in `options` are replaced.
    ///
    /// # Errors
    /// The scene or the picture exceeds the device's limits or memory.
    pub fn open(
        context: Option<Arc<Context>>,
        loaded: &LoadedScene,
        options: &RenderOptions,
        request: Request,
    ) -> Result<Self, GpuError> {
        let methods = methods_for(context.as_ref(), loaded, request, (options.width, options.height))?;
        let options = methods.apply(options);
        let world = loaded.built.world.clone();
        let renderer = ViewRenderer::new(context.as_ref(), &world, &options)?;
        let choices = Choices::of_pictures(loaded.built.accel, methods);
        let seen = world.clone();
        Ok(Self { renderer, choices, other: None, shows_other: false, is_other_late: false, world, seen, context })
    }

    /// Changes to the renderer of another kind of pictures. It is made at the first change; from then on, both are
    /// kept. The picture of the previous one stays on screen until the other one has drawn a picture. `options` are of
    /// that kind, and have a size for which the buffers are made.
    ///
    /// # Errors
    /// The buffers exceed the device's memory. Then nothing has changed.
    pub fn change_to(&mut self, options: &RenderOptions) -> Result<(), GpuError> {
        let is_of = |renderer: &mut ViewRenderer| PictureKind::of(renderer.options()) == PictureKind::of(options);
        let is_late = std::mem::take(&mut self.is_other_late);
        let renderer = match self.other.take_if(is_of) {
            Some(mut other) if is_late => {
                other.set_world(&self.world)?;
                other
            }
            Some(other) => other,
            None => self.renderer.sharing(options)?,
        };
        self.other = Some(std::mem::replace(&mut self.renderer, renderer));
        self.shows_other = true;
        Ok(())
    }

    /// Draws the world of another moment from now on. If that fails, the previous one stays.
    ///
    /// # Errors
    /// The world exceeds the device's limits or memory.
    pub fn set_world(&mut self, world: &World) -> Result<(), GpuError> {
        self.renderer.set_world(world)?;
        self.world = world.clone();
        self.is_other_late = self.other.is_some();
        Ok(())
    }

    /// Returns the world of the picture that is shown.
    pub fn seen(&self) -> &World {
        &self.seen
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
        self.seen = self.world.clone();
    }

    /// Returns the renderer whose picture is shown.
    pub fn front(&self) -> &ViewRenderer {
        match &self.other {
            Some(other) if self.shows_other => other,
            _ => &self.renderer,
        }
    }

    /// Waits until the device has ended all that was submitted before.
    ///
    /// # Errors
    /// The device is lost, or memory is exhausted.
    pub fn wait_for_all(&self) -> Result<(), GpuError> {
        self.context.as_ref().map_or(Ok(()), |context| context.wait_for_all())
    }

    /// Replaces the renderer that draws by one of another world, and with it the other one.
    fn install(&mut self, renderer: ViewRenderer, world: &World) -> Result<(), GpuError> {
        self.wait_for_all()?;
        self.renderer = renderer;
        (self.other, self.shows_other, self.is_other_late) = (None, false, false);
        (self.world, self.seen) = (world.clone(), world.clone());
        Ok(())
    }

    /// Replaces the scene. If that fails, the previous scene stays.
    ///
    /// # Errors
    /// The scene exceeds the device's limits or memory.
    pub fn set_scene(&mut self, loaded: &LoadedScene) -> Result<(), GpuError> {
        let camera = *self.renderer.camera();
        let mut renderer = ViewRenderer::new(self.context.as_ref(), &loaded.built.world, self.renderer.options())?;
        renderer.set_camera(&camera);
        self.install(renderer, &loaded.built.world)
    }

    /// Replaces the scene by that of another file, from whose camera the next picture is drawn. Chooses traversal and
    /// primary visibility as [`Self::open`] does; the size of the pictures stays. Returns the options. If it fails, the
    /// previous scene stays.
    ///
    /// # Errors
    /// The scene exceeds the device's limits or memory.
    pub fn open_scene(&mut self, loaded: &LoadedScene) -> Result<RenderOptions, GpuError> {
        let RenderOptions { width, height, .. } = *self.renderer.options();
        let methods =
            methods_for(self.context.as_ref(), loaded, loaded.load_settings.builder.request, (width, height))?;
        let options = methods.apply(&RenderOptions { width, height, ..loaded.built.options.clone() });
        let world = &loaded.built.world;
        self.install(ViewRenderer::new(self.context.as_ref(), world, &options)?, world)?;
        Ok(options)
    }

    /// Replaces the shaders. If the device refuses them, the previous ones stay.
    ///
    /// # Errors
    /// The driver refuses a shader.
    pub fn replace_shaders(&mut self, shaders: crate::gpu::Replacements) -> Result<(), GpuError> {
        self.wait_for_all()?;
        let Some(context) = &self.context else { return Ok(()) };
        let before = context.replace_shaders(shaders);
        let remade = self.renderer.remake_passes();
        match remade {
            Ok(()) => (self.other, self.shows_other, self.is_other_late) = (None, false, false),
            Err(_) => drop(context.replace_shaders(before)),
        }
        remade
    }
}

/// Chooses traversal and primary visibility for pictures in motion, which must be quick and are smaller than the
/// window. `window` is the window's size in pixels.
fn methods_for(
    context: Option<&Arc<Context>>,
    loaded: &LoadedScene,
    request: Request,
    window: (u32, u32),
) -> Result<Methods, GpuError> {
    let workload = Workload { size: (window.0 / 4, window.1 / 4), ..loaded.built.workload };
    request.methods(context, &loaded.built.world, &workload, &Cache::open())
}

impl Drop for GpuSession {
    fn drop(&mut self) {
        // Frames in flight still read the objects that are dropped. An error means that the device is lost; then
        // there is nothing to wait for.
        let _ = self.wait_for_all();
    }
}
