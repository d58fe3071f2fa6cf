//! The check of a processor: it draws a small picture of a scene that is part of the program, which is compared with
//! the CPU's picture.

use std::time::Instant;

use kdray::{
    engine::{Built, Engine, choices::Workload},
    frame::{Denoise, Goal, Integrator, Picture, RenderOptions},
    gpu::GpuError,
    scene::Scene,
    world::World,
};
use serde::Serialize;

use super::findings::Problem;

/// The Cornell box. It names no other files.
const SCENE: &str = include_str!("../../../scenes/cornell.toml");
const N_SAMPLES: u32 = 4;
/// Relative difference of two channels that counts as equal, where a channel below 1 counts as 1. Rounding alone makes
/// far smaller differences: a path has some hundred operations, each of which may be off by 2.5 units in the last place
/// (Vulkan's precision of OpFDiv), that is by 3e-7.
const TOLERANCE: f32 = 1e-3;
/// One of this number of pixels may differ by more: where a ray passes an edge, rounding decides which side it hits,
/// and one of the four samples of the pixel is another one.
const PIXELS_FOR_ONE_OUTLIER: usize = 20;
/// Greatest relative difference of the mean of all pixels. Errors in few pixels, such as a black block, exceed it even
/// if the number of pixels that differ is allowed.
const MEAN_TOLERANCE: f32 = 1e-2;
/// The mean of the CPU's picture, linear RGB.
const CPU_MEAN: [f32; 3] = [0.311_784, 0.258_104, 0.176_616];

/// The sample picture, as the CPU draws it.
pub struct Sample {
    world: World,
    options: RenderOptions,
    expected: Result<Picture, GpuError>,
    cpu_ms: f64,
}

/// The result of a check that was passed.
#[derive(Clone, Debug, Serialize)]
pub struct Passed {
    /// Time of drawing, with uploading and compiling.
    pub ms: f64,
    /// Number of pixels that differ from the CPU's by more than rounding.
    pub differing_pixels: usize,
    pub pixels: usize,
}

impl Sample {
    /// Draws the sample picture on the CPU.
    pub fn on_cpu() -> Self {
        let options = RenderOptions {
            width: 64,
            height: 48,
            integrator: Integrator::Path,
            max_depth: 4,
            denoise: Denoise::Off,
            ..RenderOptions::default()
        };
        let scene = Scene::of_text("cornell.toml", SCENE).expect("the scene of the program");
        let workload = Workload::of_pictures(&options, scene.lights.len(), N_SAMPLES.into());
        let Built { world, .. } = Engine::on_cpu().build(scene, &workload).expect("the scene of the program");
        let begin = Instant::now();
        let expected = draw(&Engine::on_cpu(), &world, &options);
        Self { expected, options, cpu_ms: begin.elapsed().as_secs_f64() * 1e3, world }
    }

    /// Checks the CPU's picture against its known mean.
    pub fn check_of_cpu(&self) -> Result<Passed, Problem> {
        let expected = self.expected.as_ref().map_err(Problem::of_device)?;
        match mean_differs(CPU_MEAN, mean(expected)) {
            true => Err(Problem::of_cpu(&format!("its mean is {:?}, not {CPU_MEAN:?}", mean(expected)))),
            false => Ok(Passed { ms: self.cpu_ms, differing_pixels: 0, pixels: expected.radiance.len() }),
        }
    }

    /// Draws the sample picture on a device, and compares it with the CPU's.
    pub fn check(&self, engine: &Engine) -> Result<Passed, Problem> {
        let expected = self.expected.as_ref().map_err(Problem::of_device)?;
        let begin = Instant::now();
        let found = draw(engine, &self.world, &self.options).map_err(|error| Problem::of_device(&error))?;
        let ms = begin.elapsed().as_secs_f64() * 1e3;
        let differing_pixels = compare(expected, &found).map_err(|what| Problem::of_wrong_picture(&what))?;
        Ok(Passed { ms, differing_pixels, pixels: expected.radiance.len() })
    }
}

fn draw(engine: &Engine, world: &World, options: &RenderOptions) -> Result<Picture, GpuError> {
    let mut renderer = engine.renderer(world, options)?;
    renderer.draw(&world.scene().camera, Goal::Samples(N_SAMPLES), || ())?;
    Ok(renderer.picture()?.into_owned())
}

/// Returns the number of pixels that differ by more than rounding.
///
/// # Errors
/// The pictures differ by more than edges explain. The error says how.
fn compare(expected: &Picture, found: &Picture) -> Result<usize, String> {
    let n_pixels = expected.radiance.len();
    if found.radiance.len() != n_pixels {
        return Err(format!("it has {} pixels, not {n_pixels}", found.radiance.len()));
    }
    let n_invalid = found.radiance.iter().flatten().filter(|channel| !channel.is_finite()).count();
    if n_invalid > 0 {
        return Err(format!("{n_invalid} numbers in it are not finite"));
    }
    let is_near = |a: f32, b: f32| (a - b).abs() <= TOLERANCE * a.abs().max(b.abs()).max(1.0);
    let differs = |(a, b): &(&[f32; 4], &[f32; 4])| !a.iter().zip(*b).all(|(a, b)| is_near(*a, *b));
    let n_differing = expected.radiance.iter().zip(&found.radiance).filter(differs).count();
    if n_differing > n_pixels / PIXELS_FOR_ONE_OUTLIER {
        return Err(format!("{n_differing} of its {n_pixels} pixels differ from the CPU's"));
    }
    let means = [mean(expected), mean(found)];
    if mean_differs(means[0], means[1]) {
        return Err(format!("its mean is {:?}, and that of the CPU's is {:?}", means[1], means[0]));
    }
    // The displayed picture is encoded by a kernel of its own.
    let is_near = |(a, b): (&[u8; 4], &[u8; 4])| a.iter().zip(b).all(|(a, b)| a.abs_diff(*b) <= 1);
    let n_displayed = expected.display.iter().zip(&found.display).filter(|(a, b)| !is_near((a, b))).count();
    if n_displayed > n_pixels / PIXELS_FOR_ONE_OUTLIER {
        return Err(format!("{n_displayed} of its {n_pixels} displayed pixels differ from the CPU's"));
    }
    Ok(n_differing)
}

fn mean(picture: &Picture) -> [f32; 3] {
    let n_pixels = picture.radiance.len() as f64;
    let channel = |ix: usize| picture.radiance.iter().map(|pixel| f64::from(pixel[ix])).sum::<f64>() / n_pixels;
    [0, 1, 2].map(|ix| channel(ix) as f32)
}

/// Whether two means differ, or are not numbers.
fn mean_differs(expected: [f32; 3], found: [f32; 3]) -> bool {
    !expected.iter().zip(found).all(|(a, b)| (a - b).abs() <= MEAN_TOLERANCE * a.abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrong_pictures_are_found() {
        let sample = Sample::on_cpu();
        let right = sample.expected.unwrap();
        assert_eq!(compare(&right, &right), Ok(0));
        let refused = |change: &dyn Fn(&mut Picture), named: &str| {
            let mut wrong = right.clone();
            change(&mut wrong);
            let error = compare(&right, &wrong).unwrap_err();
            assert!(error.contains(named), "{error}");
        };
        refused(&|it| it.radiance[7][1] = f32::NAN, "1 numbers in it are not finite");
        refused(&|it| it.radiance.iter_mut().for_each(|pixel| pixel[2] *= 1.05), "pixels differ from the CPU's");
        refused(&|it| it.radiance[1500..1650].iter_mut().for_each(|pixel| *pixel = [0.0; 4]), "its mean is");
        refused(&|it| it.radiance.rotate_left(64), "pixels differ from the CPU's");
        refused(&|it| it.display.iter_mut().for_each(|pixel| pixel.swap(0, 2)), "displayed pixels differ");
        refused(&|it| it.radiance.truncate(64), "it has 64 pixels");
        // One sample in some pixels is another one.
        let mut near = right.clone();
        near.radiance[100..150].iter_mut().for_each(|pixel| pixel[0] += 0.002);
        assert_eq!(compare(&right, &near), Ok(50));
    }

    #[test]
    fn the_cpu_draws_the_known_mean() {
        let mut sample = Sample::on_cpu();
        sample.check_of_cpu().unwrap();
        let picture = sample.expected.as_mut().unwrap();
        picture.radiance.iter_mut().for_each(|pixel| pixel[0] *= 1.02);
        assert!(sample.check_of_cpu().is_err());
    }
}
