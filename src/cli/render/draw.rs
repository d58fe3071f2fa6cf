//! Draws the pictures of `kdray render`, and writes each before the next one is drawn.

use std::time::{Duration, Instant};

use kdray::{
    cpu,
    engine::Renderer,
    frame::{Drawn, Goal, Picture, Profile, RangeSums, RenderOptions, SampleRange, SampleSums, Watcher},
    output::{Layers, Record, WholeRecord},
    scene::Camera,
};

use super::files::Files;
use crate::cli::{
    args::RenderArgs,
    error::CliError,
    progress::{Progress, StepProgress},
};

/// A camera, and the files of its picture.
pub struct FrameJob {
    /// None for the scene's own camera.
    pub camera: Option<Camera>,
    /// The number of the frame on the camera's path; 0 without a path.
    pub frame: u32,
    pub files: Files,
}

/// What all pictures of a command have in common.
pub struct Common<'a> {
    pub args: &'a RenderArgs,
    pub options: &'a RenderOptions,
    /// The scene's own camera.
    pub camera: Camera,
    /// The end of each picture, if all samples are drawn.
    pub goal: Goal,
    /// Number of samples of each pixel that are drawn, if they have a number.
    pub n_drawn: u32,
    /// The samples that are drawn, if they are not all samples of the pictures.
    pub some_samples: Option<SampleRange>,
    /// The record of the pictures. Only its camera differs from picture to picture.
    pub record: Record,
}

/// What is known after all pictures are written.
pub struct DrawnPictures {
    /// The profile of each frame.
    pub profiles: Vec<Profile>,
    /// Number of samples of each pixel.
    pub n_samples: u32,
    /// Time from the beginning until the pictures were in memory, without the time of writing files.
    pub render_ms: f64,
}

/// Draws each view `--repeat` times and writes its picture. `begin`: when the preparation of the renderer began.
pub fn draw_and_write(
    common: &Common,
    mut renderer: Renderer,
    views: &[FrameJob],
    (progress, message): (&Progress, &str),
    begin: Instant,
) -> Result<DrawnPictures, CliError> {
    let args = common.args;
    let factors = [views.len() as u32, common.n_drawn, args.repeat.into(), renderer.n_bands()];
    let n_steps = factors.into_iter().fold(1, u32::saturating_mul);
    let mut steps = match common.goal {
        Goal::Samples(_) => progress.steps(message, n_steps),
        Goal::Time(time) => progress.steps_until(message, time),
    };
    // Progress within a sample takes time, because the CPU waits for the device. Measured frames are drawn without
    // it.
    steps.shows_parts &= args.profile.is_none() && args.trace.is_none() && args.repeat == 1;
    let (mut profiles, mut drawing, mut last) = (Vec::new(), Duration::ZERO, begin);
    let mut n_samples = common.n_drawn;
    for view in views {
        let camera = view.camera.unwrap_or(common.camera);
        let (picture, sums, drawn);
        match common.some_samples {
            Some(range) => {
                (drawn, sums) = renderer.draw_range(&camera, range, Bar(&mut steps))?;
                picture = part(common, &sums.picture);
                profiles.push(drawn.profile);
            }
            None => {
                let mut last = Drawn::default();
                for _ in 0..args.repeat {
                    last = renderer.draw(&camera, common.goal, Bar(&mut steps))?;
                    profiles.push(std::mem::take(&mut last.profile));
                }
                n_samples = last.n_samples;
                picture = renderer.picture()?.into_owned();
                (drawn, sums) = (last, RangeSums::default());
            }
        }
        drawing += last.elapsed();
        let record = record_of(common, &camera, n_samples);
        let (sums, light_sums) = sums.untold();
        let light = drawn.light.0.each_ref().map(Vec::as_slice);
        let (aovs, features) = (&args.aov[..], &drawn.features[..]);
        let layers = Layers { aovs, features, light, sums, light_sums, record: Some(&record) };
        view.files.write(&picture, &layers)?;
        last = Instant::now();
    }
    Ok(DrawnPictures { profiles, n_samples, render_ms: drawing.as_secs_f64() * 1e3 })
}

/// Returns the record of a picture. `n_samples`: the number that was drawn, if the picture has all samples.
fn record_of(common: &Common, camera: &Camera, n_samples: u32) -> Record {
    let mut record = common.record.clone();
    record.whole.camera = WholeRecord::camera(camera);
    if common.some_samples.is_none() {
        record.whole.n_samples = n_samples;
        record.samples = SampleRange::whole(n_samples);
    }
    record
}

/// Returns the picture of some samples.
fn part(common: &Common, sums: &SampleSums) -> Picture {
    let RenderOptions { exposure, tonemap, .. } = *common.options;
    let (crop, radiance) = (common.record.crop, sums.mean());
    let display = cpu::display(&radiance, exposure, tonemap);
    Picture { width: crop.width(), height: crop.height(), radiance, display }
}

/// Moves the progress bar while a frame is drawn.
struct Bar<'a, 'b>(&'a mut StepProgress<'b>);

impl Watcher for Bar<'_, '_> {
    fn sees_parts(&self) -> bool {
        self.0.shows_parts
    }

    fn part(&mut self, share: f32) {
        self.0.part(share);
    }

    fn sample(&mut self) {
        self.0.step();
    }
}
