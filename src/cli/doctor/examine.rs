//! The examination of a scene on a processor.

use std::time::Instant;

use kdray::{
    buffers::Pixels,
    engine::{Engine, choices::Workload},
    frame::{Crop, Goal, Integrator, RenderOptions},
    gpu::GpuError,
    scene::Scene,
    world::World,
};
use serde::Serialize;

use super::findings::Problem;
use crate::cli::render::check_memory;

/// Size of the part of the picture that is drawn, pixels.
const CROP: u32 = 32;
/// The most samples that are drawn of each pixel.
const MOST_SAMPLES: u32 = 4;

/// A scene with the options that it states itself.
pub struct SceneOnProcessor {
    options: RenderOptions,
    n_samples: u32,
    workload: Workload,
}

/// What was found of a scene on a processor.
#[derive(Clone, Debug, Serialize)]
pub struct Examined {
    /// Time of drawing a part of the picture, with uploading and compiling.
    pub ms: f64,
    /// Memory on the device that the scene, its structure and a whole picture take, bytes. None for the CPU, which has
    /// no memory of its own.
    pub needed_bytes: Option<u64>,
}

impl SceneOnProcessor {
    pub fn new(scene: &Scene) -> Self {
        let options = scene.defaults.options();
        let n_samples = scene.defaults.for_integrator(None).samples;
        let workload = Workload::of_pictures(&options, scene.lights.len(), 1);
        Self { options, n_samples, workload }
    }

    pub fn options(&self) -> &RenderOptions {
        &self.options
    }

    /// Returns the workload of the part of the picture.
    pub fn workload(&self) -> &Workload {
        &self.workload
    }

    /// Allocates the memory of a whole picture, and draws a part of it.
    pub fn examine(&self, engine: &Engine, world: &World) -> Result<Examined, Problem> {
        check_memory(&self.options, self.n_samples, engine.context().is_none(), 1)
            .map_err(|error| Problem::of_memory(&error.to_string()))?;
        let methods = engine.methods(world, &self.workload).map_err(|error| Problem::of_device(&error))?;
        let options = methods.apply(&self.options);
        let needed_bytes = self.needed_bytes(engine, world, &options).map_err(|error| Problem::of_device(&error))?;
        if let Some((needed, context)) = needed_bytes.zip(engine.context())
            && needed > context.info().memory_bytes
        {
            return Err(Problem::of_device_memory(needed, context.info().memory_bytes));
        }
        let begin = Instant::now();
        let radiance = self.draw_part(engine, world, &options).map_err(|error| Problem::of_device(&error))?;
        if radiance.iter().flatten().any(|channel| !channel.is_finite()) {
            return Err(Problem::of_wrong_picture("numbers in the part of the scene's picture are not finite"));
        }
        Ok(Examined { ms: begin.elapsed().as_secs_f64() * 1e3, needed_bytes })
    }

    /// Returns the bytes that the scene and a whole picture take on the device, by allocating them.
    fn needed_bytes(&self, engine: &Engine, world: &World, options: &RenderOptions) -> Result<Option<u64>, GpuError> {
        let Some(context) = engine.context() else { return Ok(None) };
        let _renderer = engine.renderer(world, options)?;
        let allocated: u64 = context.memory().iter().map(|it| it.bytes).sum();
        // The sums of samples are allocated with the second sample.
        let of_pixel = match options.integrator {
            Integrator::Path => Pixels::bytes_per_pixel_of_paths(self.n_samples),
            Integrator::Whitted if self.n_samples > 1 => size_of::<[f32; 4]>() as u64,
            Integrator::Whitted => 0,
        };
        Ok(Some(allocated + of_pixel * u64::from(options.width) * u64::from(options.height)))
    }

    /// Draws the middle of the picture. Returns its radiance.
    fn draw_part(&self, engine: &Engine, world: &World, options: &RenderOptions) -> Result<Vec<[f32; 4]>, GpuError> {
        let (width, height) = (CROP.min(options.width), CROP.min(options.height));
        let (x0, y0) = ((options.width - width) / 2, (options.height - height) / 2);
        let crop = Some(Crop { x0, y0, x1: x0 + width, y1: y0 + height });
        let mut renderer = engine.renderer(world, &RenderOptions { crop, ..options.clone() })?;
        let n_samples = self.n_samples.min(MOST_SAMPLES);
        renderer.draw(&world.scene().camera, Goal::Samples(n_samples), || ())?;
        Ok(renderer.picture()?.into_owned().radiance)
    }
}
