//! The engine renders pictures and casts rays, on a Vulkan device or on the CPU. It opens the device, and chooses the
//! kd-tree, the traversal and the primary visibility where the user leaves them open.
//!
//! ```text
//! file, scene, mesh ─> Engine::load ─> World ─> Engine::render ─> Picture
//!                                       └─────> Engine::cast ───> hits
//! ```

#[cfg(feature = "files")]
mod animated;
mod caster;
pub mod choices;
mod first_view;
mod group;
mod load;
mod memory;
mod noise;
mod renderer;

use std::sync::Arc;

#[cfg(feature = "files")]
pub use self::animated::{AnimatedWorld, MomentWork};
use self::choices::{Cache, Methods, Processor, Request, Workload};
pub use self::{
    caster::Caster,
    group::FilmRenderer,
    load::{Builder, LoadError, LoadRequest, Loaded, Opened, Source, Work},
    noise::{NoiseGoal, NoisePicture},
    renderer::{Rendered, Renderer},
};
use crate::{
    accel::{Query, kdtree::Traversal},
    cast::{CpuCaster, Hit, Ray},
    frame::{Goal, RenderOptions},
    gpu::{Context, ContextOptions, Device, GpuError},
    util::progress::Progress,
    world::{Geometry, World},
};

/// A Vulkan device or the CPU, with the choices that the user has pinned and a cache of measurements. A clone is a
/// second handle to the same device.
#[derive(Clone)]
pub struct Engine {
    /// The Vulkan device; none on the CPU.
    device: Option<Device>,
    /// Further devices, which help to draw pictures.
    others: Vec<Device>,
    request: Request,
    cache: Cache,
    progress: Progress,
}

impl Engine {
    /// Opens the best Vulkan device, or the one that the options name.
    ///
    /// # Errors
    /// There is no Vulkan driver or no such device, or the device lacks what kdray needs.
    pub fn open(options: &ContextOptions) -> Result<Self, GpuError> {
        Device::open(options).map(Self::on_device)
    }

    /// Uses a Vulkan device that is already open.
    pub fn on_device(device: impl Into<Device>) -> Self {
        Self { device: Some(device.into()), ..Self::on_cpu() }
    }

    /// Uses several Vulkan devices that are already open. They share the drawing of a picture or of the frames of a
    /// film. Everything else is done by the first one. If there are none, the engine runs on the CPU.
    pub fn on_devices(devices: Vec<impl Into<Device>>) -> Self {
        let mut devices = devices.into_iter().map(Into::into);
        Self { device: devices.next(), others: devices.collect(), ..Self::on_cpu() }
    }

    /// Uses the CPU without Vulkan, on the current rayon pool.
    pub fn on_cpu() -> Self {
        Self {
            device: None,
            others: Vec::new(),
            request: Request::default(),
            cache: Cache::open(),
            progress: Progress::default(),
        }
    }

    /// Returns the same engine with the choices that `request` specifies. The engine makes all other choices.
    #[must_use]
    pub fn with_request(self, request: Request) -> Self {
        Self { request, ..self }
    }

    /// Returns the same engine, which reports the progress of the kd-trees that it builds.
    #[must_use]
    pub fn with_progress(self, progress: Progress) -> Self {
        Self { progress, ..self }
    }

    /// Returns all Vulkan devices, none on the CPU.
    pub fn devices(&self) -> impl Iterator<Item = &Device> {
        self.device.iter().chain(&self.others)
    }

    /// Returns the Vulkan device, or none on the CPU.
    pub fn device(&self) -> Option<&Device> {
        self.device.as_ref()
    }

    fn context(&self) -> Option<&Arc<Context>> {
        self.device.as_ref().map(Device::inner)
    }

    fn contexts(&self) -> Vec<Arc<Context>> {
        self.devices().map(|device| Arc::clone(device.inner())).collect()
    }

    /// Returns the kind of processor that the engine runs on.
    pub fn processor(&self) -> Processor {
        Processor::of(self.context().map(Arc::as_ref))
    }

    /// Returns the device's own name, or the CPU with its number of threads.
    pub fn device_name(&self) -> String {
        match &self.device {
            Some(device) => device.info().name.clone(),
            None => format!("CPU, {} threads", rayon::current_num_threads()),
        }
    }

    /// Chooses the traversal and the primary visibility. On a GPU, if the workload is large enough to pay for a short
    /// measurement, the candidates are timed, and the times are kept in the user's cache folder.
    ///
    /// # Errors
    /// The device is lost.
    pub fn methods(&self, world: &World, workload: &Workload) -> Result<Methods, GpuError> {
        self.request.methods(self.context(), world, workload, &self.cache)
    }

    /// Creates a renderer, which can draw many pictures of one world.
    ///
    /// # Errors
    /// An option is out of its range, or the scene or a row of the picture is beyond the device's limits or memory.
    pub fn renderer(&self, world: &World, options: &RenderOptions) -> Result<Renderer, GpuError> {
        Renderer::new(&self.contexts(), world, options)
    }

    /// Creates renderers that draw the frames of a film, one on each device.
    ///
    /// # Errors
    /// The engine runs on the CPU, an option is out of its range, or the scene or a row of the picture is beyond the
    /// limits or the memory of a device.
    pub fn film_renderer(&self, world: &World, options: &RenderOptions) -> Result<FilmRenderer, GpuError> {
        let contexts = self.contexts();
        if contexts.is_empty() {
            return Err(GpuError::Lacks { device: "CPU".to_owned(), missing: "renderers of films".to_owned() });
        }
        FilmRenderer::new(&contexts, world, options)
    }

    /// Creates a caster, which can cast many sets of rays through the same triangles.
    ///
    /// # Errors
    /// The triangles are beyond the device's limits or memory, or too many for [`Traversal::Brute`].
    pub fn caster<'a>(&self, geometry: Geometry<'a>, traversal: Traversal) -> Result<Caster<'a>, GpuError> {
        Caster::new(self.context(), geometry, traversal, || CpuCaster::new(geometry, traversal))
    }

    /// Creates a caster that keeps the world, and so may live as long as anybody likes.
    ///
    /// # Errors
    /// Fails as [`Engine::caster`] does.
    pub fn caster_of_world(&self, world: &World, traversal: Traversal) -> Result<Caster<'static>, GpuError> {
        Caster::new(self.context(), world.geometry(), traversal, || CpuCaster::of_world(world, traversal))
    }

    /// Draws one picture from the scene's own camera with one sample per pixel. The engine's choices of traversal and
    /// primary visibility replace those of the options.
    ///
    /// # Errors
    /// Fails as [`Engine::methods`] and [`Engine::renderer`] do, or if a call fails.
    pub fn render(&self, world: &World, options: &RenderOptions) -> Result<Rendered, GpuError> {
        options.check()?;
        let scene = world.scene();
        let workload = Workload::of_pictures(options, scene.lights.len(), 1).with_cameras([&scene.camera].into_iter());
        let options = self.methods(world, &workload)?.apply(options);
        let mut renderer = self.renderer(world, &options)?;
        let drawn = renderer.draw(&scene.camera, Goal::Samples(1), || ())?;
        Ok(Rendered { picture: renderer.picture()?.into_owned(), drawn })
    }

    /// Casts rays, and returns one hit for each. The engine chooses the traversal.
    ///
    /// # Errors
    /// Fails as [`Engine::methods`] and [`Engine::caster`] do, or if a call fails.
    pub fn cast(&self, world: &World, rays: &[Ray], query: Query) -> Result<Vec<Hit>, GpuError> {
        let traversal = self.methods(world, &Workload::of_rays(rays.len() as u64))?.traversal.value;
        Ok(self.caster(world.geometry(), traversal)?.cast(rays, query, 1)?.hits)
    }
}
