//! The examination of a scene on a processor: whether its picture fits into the memory, and whether a part of it is
//! drawn.

use std::time::Instant;

use kdray::{
    buffers::{PathQueue, Pixels},
    engine::{Engine, choices::Workload},
    frame::{Crop, Goal, Integrator, RenderOptions},
    gpu::{Device, GpuError},
    world::World,
};
use serde::Serialize;

use super::findings::Problem;

/// Width and height of the part of the picture that is drawn, pixels.
const CROP: u32 = 32;
/// Greatest number of samples of each pixel that are drawn.
const MOST_SAMPLES: u32 = 4;

/// The picture that a scene file asks for, with its own size, integrator and number of samples.
pub struct ScenePicture {
    pub options: RenderOptions,
    pub n_samples: u32,
    pub workload: Workload,
}

/// What was found of the scene's picture on a processor.
#[derive(Clone, Debug, Serialize)]
pub struct Examined {
    /// Time of drawing a part of the picture, with uploading and compiling.
    pub ms: f64,
    /// Memory on the device that the scene, its structure and a whole picture take, bytes. None for the CPU, which has
    /// no memory of its own.
    pub needed_bytes: Option<u64>,
}

impl ScenePicture {
    /// Checks that a whole picture fits into the memory, and draws a part of it.
    pub fn examine(&self, engine: &Engine, world: &World) -> Result<Examined, Problem> {
        (engine.builder().require_for_pictures(&self.options, self.n_samples, 1))
            .map_err(|error| Problem::of_memory(&error.to_string()))?;
        let methods = engine.methods(world, &self.workload).map_err(|error| Problem::of_device(&error))?;
        let options = methods.apply(&self.options);
        let needed_bytes = match engine.device() {
            Some(device) => Some(self.check_device_memory(engine, device, world, &options)?),
            None => None,
        };
        let begin = Instant::now();
        let radiance = self.draw_crop(engine, world, &options).map_err(|error| Problem::of_device(&error))?;
        if radiance.iter().flatten().any(|channel| !channel.is_finite()) {
            return Err(Problem::of_wrong_picture("numbers in the part of the scene's picture are not finite"));
        }
        Ok(Examined { ms: begin.elapsed().as_secs_f64() * 1e3, needed_bytes })
    }

    /// Allocates what the scene, its structure and a whole picture take on the device. Returns the number of bytes.
    fn check_device_memory(
        &self,
        engine: &Engine,
        device: &Device,
        world: &World,
        options: &RenderOptions,
    ) -> Result<u64, Problem> {
        let _renderer = engine.renderer(world, options).map_err(|error| Problem::of_device(&error))?;
        let allocated: u64 = device.memory().iter().map(|it| it.bytes).sum();
        // The sums of samples are allocated only when the second sample is drawn.
        let bytes_of_sums = match options.integrator {
            Integrator::Path => Pixels::bytes_per_pixel_of_paths(self.n_samples),
            Integrator::Whitted if self.n_samples > 1 => size_of::<[f32; 4]>() as u64,
            Integrator::Whitted => 0,
        };
        let n_pixels = u64::from(options.width) * u64::from(options.height);
        let available = device.info().memory_bytes;
        // So do the paths of further samples in a frame, which get a part of the memory at most.
        let bytes_of_paths = match options.integrator {
            Integrator::Path => PathQueue::bytes_of_more_samples(n_pixels, self.n_samples, available),
            Integrator::Whitted => 0,
        };
        let needed = allocated + bytes_of_sums * n_pixels + bytes_of_paths;
        if needed > available { Err(Problem::of_device_memory(needed, available)) } else { Ok(needed) }
    }

    /// Draws the middle of the picture. Returns its radiance.
    fn draw_crop(&self, engine: &Engine, world: &World, options: &RenderOptions) -> Result<Vec<[f32; 4]>, GpuError> {
        let (width, height) = (CROP.min(options.width), CROP.min(options.height));
        let (x0, y0) = ((options.width - width) / 2, (options.height - height) / 2);
        let crop = Some(Crop { x0, y0, x1: x0 + width, y1: y0 + height });
        let mut renderer = engine.renderer(world, &RenderOptions { crop, ..options.clone() })?;
        let n_samples = self.n_samples.min(MOST_SAMPLES);
        renderer.draw(&world.scene().camera, Goal::Samples(n_samples), || ())?;
        Ok(renderer.picture()?.into_owned().radiance)
    }
}
