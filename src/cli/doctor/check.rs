//! The check of a processor: it draws a small picture, the sample picture, of a scene that is part of the program. The
//! picture is compared with the CPU's.

use std::time::Instant;

use kdray::{
    engine::{Engine, LoadRequest, Loaded, Opened},
    frame::{Goal, Integrator, Picture, RenderOptions},
    gpu::GpuError,
    scene::{DenoiseChoice, PictureChoices, Scene},
    world::World,
};
use serde::Serialize;

use super::findings::Problem;

/// The Cornell box. It names no other files.
const SCENE: &str = include_str!("../../../scenes/cornell.toml");
const N_SAMPLES: u32 = 4;
/// Greatest difference of two channels that count as equal, relative to the largest of both and 1. Rounding alone makes
/// far smaller differences: a path has some hundred operations, each of which may be off by 2.5 units in the last place
/// (Vulkan's precision of OpFDiv), that is by 3e-7.
const TOLERANCE: f32 = 1e-3;
/// One in this number of pixels may differ by more: where a ray passes an edge, rounding decides which side it hits,
/// and so changes one of the four samples of the pixel.
const PIXELS_FOR_ONE_OUTLIER: usize = 20;
/// Greatest relative difference of the means of all pixels. It finds errors in fewer pixels than may differ, such as a
/// small black block.
const MEAN_TOLERANCE: f32 = 1e-2;
/// The mean of the CPU's picture, linear RGB.
const CPU_MEAN: [f32; 3] = [0.311_784, 0.258_104, 0.176_616];

/// The sample picture, as the CPU draws it.
pub struct Sample {
    world: World,
    options: RenderOptions,
    expected: Result<Picture, GpuError>,
    /// Time in which the CPU has drawn it.
    cpu_ms: f64,
}

/// What is known of a processor that has passed the check.
#[derive(Clone, Debug, Serialize)]
pub struct Passed {
    /// Time of drawing, with uploading and compiling.
    pub ms: f64,
    /// Number of pixels that differ from the CPU's by more than rounding.
    pub differing_pixels: usize,
    /// Number of all pixels.
    pub pixels: usize,
}

impl Sample {
    /// Draws the sample picture on the CPU.
    pub fn on_cpu() -> Self {
        let scene = Scene::of_text("cornell.toml", SCENE).expect("the scene of the program");
        let choices = PictureChoices {
            size: Some((64, 48)),
            integrator: Some(Integrator::Path),
            max_depth: Some(4),
            exposure: Some(1.0),
            denoise: Some(DenoiseChoice::Off),
            ..PictureChoices::default()
        };
        let request = LoadRequest::pictures(choices);
        let opened = Opened::read(scene, &request).expect("the scene of the program");
        // Devices draw it by the default methods, not by those of the CPU.
        let built = Engine::on_cpu().builder().build(opened, &request.work);
        let Loaded { world, options, .. } = built.expect("the scene of the program");
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
    let (n_pixels, n_found) = (expected.radiance.len(), found.radiance.len());
    if n_found != n_pixels {
        return Err(format!("it has {n_found} pixels, not {n_pixels}"));
    }
    let n_invalid = found.radiance.iter().flatten().filter(|channel| !channel.is_finite()).count();
    if n_invalid > 0 {
        return Err(format!("{n_invalid} numbers in it are not finite"));
    }
    let is_near = |a: f32, b: f32| (a - b).abs() <= TOLERANCE * a.abs().max(b.abs()).max(1.0);
    let n_differing = n_outliers("pixels", &expected.radiance, &found.radiance, is_near)?;
    let means = [mean(expected), mean(found)];
    if mean_differs(means[0], means[1]) {
        return Err(format!("its mean is {:?}, and that of the CPU's is {:?}", means[1], means[0]));
    }
    // Other code than that of the radiance encodes the displayed picture.
    n_outliers("displayed pixels", &expected.display, &found.display, |a, b| a.abs_diff(b) <= 1)?;
    Ok(n_differing)
}

/// Returns the number of pixels with a channel that is not near the expected one.
///
/// # Errors
/// More pixels differ than edges explain. The error calls them `noun`.
fn n_outliers<C: Copy>(
    noun: &str,
    expected: &[[C; 4]],
    found: &[[C; 4]],
    is_near: impl Fn(C, C) -> bool,
) -> Result<usize, String> {
    let differs = |(a, b): &(&[C; 4], &[C; 4])| !a.iter().zip(*b).all(|(a, b)| is_near(*a, *b));
    let (n, n_pixels) = (expected.iter().zip(found).filter(differs).count(), expected.len());
    match n > n_pixels / PIXELS_FOR_ONE_OUTLIER {
        true => Err(format!("{n} of its {n_pixels} {noun} differ from the CPU's")),
        false => Ok(n),
    }
}

/// Returns the mean of the red, green and blue channels.
fn mean(picture: &Picture) -> [f32; 3] {
    let n_pixels = picture.radiance.len() as f64;
    let channel = |ix: usize| picture.radiance.iter().map(|pixel| f64::from(pixel[ix])).sum::<f64>() / n_pixels;
    [0, 1, 2].map(|ix| channel(ix) as f32)
}

/// Returns whether two means differ, or one of them is not a number.
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
