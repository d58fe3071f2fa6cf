//! Draws the pictures of `kdray render`, and writes each before the next one is drawn on the same device.

use std::{
    collections::BTreeMap,
    mem::take,
    sync::{Mutex, PoisonError},
    time::{Duration, Instant},
};

use kdray::{
    cpu,
    engine::{AnimatedWorld, Engine, LoadError, NoiseGoal, Renderer},
    frame::{
        Aov, Drawn, Goal, Integrator, Picture, Profile, RangeSums, RenderOptions, SampleRange, SampleSums, Watcher,
    },
    gpu::{DeviceInfo, GpuError},
    layout::PixelAovs,
    output::{FilmFile, Layers, OutputError, Record, WholeRecord},
    scene::Camera,
    world::World,
};

use super::{deadline::Deadline, files::Files, motion::CameraMotion, noise::NoiseReached};
use crate::cli::{
    args::RenderArgs,
    error::CliError,
    interrupt::{self, Unwritten},
    progress::{CountedProgress, Progress},
};

/// A camera, and the files of its picture.
pub struct FrameJob {
    /// None for the scene's own camera.
    pub camera: Option<Camera>,
    /// The number of the frame on the camera's path; 0 without a path.
    pub frame: u32,
    /// Its place among the frames that are drawn.
    pub ix: usize,
    /// Whether the pictures of all frames go to one file.
    pub shares_file: bool,
    pub files: Files,
}

/// The one file of a film, to which pictures are written in their order, in whatever order they are drawn.
pub struct OneFile {
    file: FilmFile,
    n_written: usize,
    waiting: BTreeMap<usize, Picture>,
}

impl OneFile {
    pub fn new(file: FilmFile) -> Self {
        Self { file, n_written: 0, waiting: BTreeMap::new() }
    }

    fn push(&mut self, ix: usize, picture: Picture) -> Result<(), OutputError> {
        self.waiting.insert(ix, picture);
        while let Some(picture) = self.waiting.remove(&self.n_written) {
            self.file.push(&picture)?;
            self.n_written += 1;
        }
        Ok(())
    }

    pub fn finish(self) -> Result<(), OutputError> {
        self.file.finish()
    }
}

/// What all pictures of a command have in common.
pub struct Common<'a> {
    pub args: &'a RenderArgs,
    pub options: &'a RenderOptions,
    /// The world that was loaded.
    pub world: &'a World,
    /// The scene's own camera.
    pub camera: Camera,
    /// The animations that play, if any do.
    pub animated: Option<&'a Mutex<AnimatedWorld>>,
    /// The way of the camera, if it moves apart from animations.
    pub motion: Option<&'a CameraMotion<'a>>,
    /// The file of all pictures, if they go to one.
    pub one_file: Option<&'a Mutex<OneFile>>,
    /// The end of each picture, if all samples are drawn.
    pub goal: Goal,
    /// The noise at which pictures end, if the user wants that.
    pub noise_goal: Option<NoiseGoal>,
    /// Number of samples of each pixel that are drawn, if they have a number. The most samples if pictures end at a
    /// noise.
    pub n_drawn: u32,
    /// The samples that are drawn, if they are not all samples of the pictures.
    pub some_samples: Option<SampleRange>,
    /// The time after which the picture ends with the samples so far.
    pub deadline: Deadline,
    /// The record of the pictures. Its camera differs from picture to picture, and so does its device if each of
    /// several draws whole frames.
    pub record: Record,
}

/// What is known after all pictures are written.
pub struct DrawnPictures {
    /// The profile of each frame.
    pub profiles: Vec<Profile>,
    /// Number of samples of each pixel.
    pub n_samples: u32,
    /// What the noise of all pictures has led to.
    pub noise: Option<NoiseReached>,
    /// Time from the beginning until the pictures were in memory, without the time of writing files. If each of several
    /// devices drew whole frames, it is the time of the device that drew longest.
    pub render_ms: f64,
}

/// A picture that is not written yet.
struct DrawnView {
    picture: Picture,
    camera: Camera,
    drawn: Drawn,
    /// The vectors of the layer `motion`.
    motion: Vec<[f32; 2]>,
    sums: RangeSums,
    /// The device that has drawn the picture. None if several have drawn it together, or the CPU.
    device: Option<DeviceInfo>,
    written: WrittenView,
    /// Whether it has fewer samples than it should have.
    is_cut: bool,
    /// The limit of time that has ended it.
    overdue: Option<Duration>,
    unwritten: Unwritten,
}

/// What remains of a picture after it is written.
struct WrittenView {
    /// The profile of each repetition.
    profiles: Vec<Profile>,
    n_samples: u32,
    noise: Option<NoiseReached>,
}

/// Draws each view `--repeat` times and writes its picture. Of several devices, each draws whole frames if there are
/// enough of them, else all draw each picture together.
pub fn draw_and_write(
    common: &Common,
    (engine, world): (&Engine, &World),
    views: &[FrameJob],
    stage: (&Progress, &str),
) -> Result<DrawnPictures, CliError> {
    let draw = if draws_whole_frames(engine, views) { draw_frames_apart } else { draw_in_turn };
    let (written, drawing) = draw(common, (engine, world), views, stage)?;
    let n_samples = written.last().map_or(common.n_drawn, |view| view.n_samples);
    let noise = NoiseReached::of_all(written.iter().filter_map(|view| view.noise));
    let profiles = written.into_iter().flat_map(|view| view.profiles).collect();
    Ok(DrawnPictures { profiles, n_samples, noise, render_ms: drawing.as_secs_f64() * 1e3 })
}

/// Whether each of several devices draws whole frames. Each has to get at least two on average: with fewer frames, some
/// devices would have nothing to do for a large part of the time.
pub fn draws_whole_frames(engine: &Engine, views: &[FrameJob]) -> bool {
    let n_devices = engine.devices().count();
    n_devices > 1 && views.len() >= 2 * n_devices
}

/// Draws and writes one view after the other. Returns them, and the time without the writing of files.
fn draw_in_turn(
    common: &Common,
    (engine, world): (&Engine, &World),
    views: &[FrameJob],
    stage: (&Progress, &str),
) -> Result<(Vec<WrittenView>, Duration), CliError> {
    let mut begin = Instant::now();
    let mut renderer = engine.renderer(world, common.options)?;
    let mut items = common.counted(stage, views.len() as u32, renderer.n_bands());
    let (mut written, mut drawing) = (Vec::new(), Duration::ZERO);
    for view in views {
        let drawn = draw_view(common, view, &mut renderer, &mut Bar(&mut items))?;
        drawing += begin.elapsed();
        written.push(write_view(common, view, drawn)?);
        begin = Instant::now();
    }
    Ok((written, drawing))
}

/// Lets each device draw and write whole frames. Returns the views, and the time of the device that has drawn longest,
/// without the writing of files.
fn draw_frames_apart(
    common: &Common,
    (engine, world): (&Engine, &World),
    views: &[FrameJob],
    stage: (&Progress, &str),
) -> Result<(Vec<WrittenView>, Duration), CliError> {
    let begin = Instant::now();
    let mut film = engine.film_renderer(world, common.options)?;
    let opening = begin.elapsed();
    // The film tells of each sample of a frame once, also if a device draws several bands.
    let mut items = common.counted(stage, views.len() as u32, 1);
    let view = |frame_ix: u32| &views[frame_ix as usize];
    let written = film.draw(
        views.len() as u32,
        &mut Bar(&mut items),
        |renderer, frame_ix, tell_sample| draw_view(common, view(frame_ix), renderer, &mut || tell_sample()),
        |frame_ix, drawn| write_view(common, view(frame_ix), drawn),
    )?;
    Ok((written, opening + film.longest_drawing()))
}

impl Common<'_> {
    /// Returns the time of a view's animations, seconds.
    fn seconds_of(&self, view: &FrameJob) -> f64 {
        let load = &self.args.load;
        if self.args.is_film() { load.seconds_of(view.frame.into()) } else { load.seconds().unwrap_or_default() }
    }

    /// Returns the world of a view and its camera, `later` frames after its own time.
    fn moment(&self, view: &FrameJob, later: f64) -> Result<(World, Camera), GpuError> {
        let load = &self.args.load;
        let (mut world, mut camera) = (self.world.clone(), view.camera.unwrap_or(self.camera));
        // A single picture shows the world as it was loaded.
        if let Some(animated) = self.animated.filter(|_| self.args.moves() || later != 0.0) {
            let mut animated = animated.lock().unwrap_or_else(PoisonError::into_inner);
            let posed = animated.at(self.seconds_of(view) + load.seconds_of(later)).map_err(|error| match error {
                LoadError::Device(error) => error,
                other => GpuError::Mismatch(other.to_string()),
            })?;
            (world, camera) = (posed.0, view.camera.unwrap_or(posed.1));
        }
        if let Some(motion) = self.motion.filter(|_| later != 0.0) {
            let frame = f64::from(view.frame) + later;
            camera = motion.camera_at(frame).map_err(|error| GpuError::Mismatch(error.to_string()))?;
        }
        Ok((world, camera))
    }

    /// Lets a renderer show a view, `later` frames after its own time. Returns its world and camera.
    fn show(&self, view: &FrameJob, later: f64, renderer: &mut Renderer) -> Result<(World, Camera), GpuError> {
        let (world, camera) = self.moment(view, later)?;
        if self.animated.is_some() && self.args.moves() {
            renderer.set_world(&world)?;
        }
        Ok((world, camera))
    }

    /// Returns the vectors of the layer `motion`, none if it is not asked for. `now`: the view at its own time. AOVs
    /// show the moment of the first sample.
    fn motion_vectors(
        &self,
        view: &FrameJob,
        mut now: (World, Camera),
        pixel_aovs: &[PixelAovs],
    ) -> Result<Vec<[f32; 2]>, GpuError> {
        if !self.args.aov.contains(&Aov::Motion) {
            return Ok(Vec::new());
        }
        let mut later = 1.0;
        if let Some(shutter) = self.args.shutter {
            let moment = shutter.moment(self.some_samples.map_or(0, |range| range.first));
            (now, later) = (self.moment(view, moment)?, moment + 1.0);
        }
        let mut next = self.moment(view, later)?;
        if next.0.scene().n_triangles() != now.0.scene().n_triangles() {
            let frame = view.frame;
            tracing::warn!("frame {frame}: meshes are missing one frame later, so motion has the camera's way alone");
            next.0 = now.0.clone();
        }
        let RenderOptions { width, height, .. } = *self.options;
        let views = [&now, &next].map(|(world, camera)| (world, camera));
        Ok(cpu::motion_vectors(views, (width, height), &self.record.crop, pixel_aovs))
    }

    /// Returns the counter of the samples of all bands of all views.
    fn counted<'a>(
        &self,
        (progress, message): (&'a Progress, &str),
        n_views: u32,
        n_bands: u32,
    ) -> CountedProgress<'a> {
        let args = self.args;
        // A picture that ends at a noise counts as one sample.
        let n_drawn = if self.noise_goal.is_some() { 1 } else { self.n_drawn };
        let factors = [n_views, n_drawn, args.repeat.into(), n_bands];
        let mut items = match self.goal {
            Goal::Samples(_) => progress.counted(message, factors.into_iter().fold(1, u32::saturating_mul)),
            Goal::Time(time) => progress.counted_until(message, time),
        };
        // Progress within a sample takes time, because the CPU waits for the device. Measured frames are drawn without
        // it.
        items.shows_item_progress &= args.profile.is_none() && args.trace.is_none() && args.repeat == 1;
        items
    }
}

/// Draws a picture `--repeat` times.
fn draw_view(
    common: &Common,
    view: &FrameJob,
    renderer: &mut Renderer,
    watcher: &mut dyn Watcher,
) -> Result<DrawnView, GpuError> {
    renderer.set_seed(common.args.seed_of(view.frame))?;
    // What is not blurred, and the record, show the picture's own time.
    let now = common.show(view, 0.0, renderer)?;
    let camera = now.1;
    let device = renderer.device().cloned();
    let mut relay = Relay::new(common, watcher);
    let (mut drawn, mut sums, mut profiles, mut noise) = (Drawn::default(), RangeSums::default(), Vec::new(), None);
    let mut n_samples = common.n_drawn;
    let picture = if let Some(shutter) = common.args.shutter {
        let range = common.some_samples.unwrap_or(SampleRange::whole(common.n_drawn));
        let show = |renderer: &mut Renderer, sample_ix| {
            common.show(view, shutter.moment(sample_ix), renderer).map(|(_, camera)| camera)
        };
        (drawn, sums) = renderer.draw_moments(range, show, &mut relay)?;
        profiles.push(take(&mut drawn.profile));
        n_samples = drawn.n_samples;
        part(common, &sums.picture)
    } else if let Some(range) = common.some_samples {
        (drawn, sums) = renderer.draw_range(&camera, range, &mut relay)?;
        profiles.push(take(&mut drawn.profile));
        part(common, &sums.picture)
    } else if let Some(goal) = common.noise_goal {
        let mut noisy = renderer.draw_until(&camera, goal, &mut relay)?;
        profiles.push(take(&mut noisy.drawn.profile));
        noise = Some(NoiseReached::of(&noisy));
        drawn = noisy.drawn;
        // Pictures of other crops have the same number, whatever their tiles have needed.
        n_samples = if relay.is_cut { drawn.n_samples } else { n_samples };
        noisy.picture
    } else {
        for _ in 0..common.args.repeat {
            drawn = renderer.draw(&camera, common.goal, &mut relay)?;
            profiles.push(take(&mut drawn.profile));
        }
        n_samples = drawn.n_samples;
        renderer.picture()?.into_owned()
    };
    // The watcher is asked after the last frame, too.
    let is_whole = matches!(common.goal, Goal::Samples(goal) if common.noise_goal.is_none() && n_samples >= goal);
    let Relay { is_cut, overdue, unwritten, .. } = relay;
    let (is_cut, overdue) = (is_cut && !is_whole, overdue.filter(|_| !is_whole));
    let written = WrittenView { profiles, n_samples, noise };
    let unwritten = unwritten.unwrap_or_default();
    let motion = common.motion_vectors(view, now, &drawn.pixel_aovs)?;
    Ok(DrawnView { picture, camera, drawn, motion, sums, device, written, is_cut, overdue, unwritten })
}

/// Writes the files of a view.
fn write_view(common: &Common, view: &FrameJob, of_view: DrawnView) -> Result<WrittenView, CliError> {
    let DrawnView { picture, camera, drawn, motion, sums, device, written, is_cut, overdue, unwritten } = of_view;
    if let Some(limit) = overdue {
        if !common.args.may_end_early() {
            return Err(CliError::TimeLimit { limit, present: "drawing" });
        }
        let limit = humantime::format_duration(limit);
        tracing::warn!("the picture ends with the samples so far, since --time-limit {limit} is over");
    }
    let mut record = record_of(common, view, &camera, written.n_samples);
    if is_cut {
        record.whole.noise = None;
    }
    // Several devices that draw whole frames may be of several kinds.
    if let Some(DeviceInfo { name, driver, .. }) = device {
        (record.device, record.driver) = (name, driver);
    }
    let (sums, mean_sums) = sums.untold();
    let means = drawn.layers.0.each_ref().map(Vec::as_slice);
    let (aovs, pixel_aovs) = (&common.args.aov[..], &drawn.pixel_aovs[..]);
    match common.one_file {
        Some(file) => file.lock().unwrap_or_else(PoisonError::into_inner).push(view.ix, picture)?,
        None => {
            let record = Some(&record);
            let layers = Layers { aovs, pixel_aovs, motion: &motion, means, sums, mean_sums, record };
            view.files.write(&picture, &layers)?
        }
    }
    drop(unwritten);
    if common.args.is_film() {
        // A film ends after this frame, without a report.
        interrupt::end_if_asked();
    }
    Ok(written)
}

/// Returns the record of a picture. `n_samples`: the number that was drawn, if the picture has all samples.
fn record_of(common: &Common, view: &FrameJob, camera: &Camera, n_samples: u32) -> Record {
    let mut record = common.record.clone();
    record.whole.camera = WholeRecord::camera(camera);
    if common.animated.is_some() || common.args.load.seconds().is_some() {
        record.whole.time = Some(format!("{} s", common.seconds_of(view)));
    }
    if common.options.integrator == Integrator::Path {
        record.whole.seed = common.args.seed_of(view.frame);
    }
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
struct Bar<'a, 'b>(&'a mut CountedProgress<'b>);

impl Watcher for Bar<'_, '_> {
    fn sees_sample_progress(&self) -> bool {
        self.0.shows_item_progress
    }

    fn sample_progress(&mut self, share: f32) {
        self.0.item_progress(share);
    }

    fn sample(&mut self) {
        self.0.finish_item();
    }
}

/// Passes on what it is told, and ends a picture early if the user or the time limit wants that.
struct Relay<'a> {
    watcher: &'a mut dyn Watcher,
    deadline: Deadline,
    may_end: bool,
    /// Whether the picture has been ended early.
    is_cut: bool,
    /// The limit of time that has ended it.
    overdue: Option<Duration>,
    /// From the first samples on that are a picture.
    unwritten: Option<Unwritten>,
}

impl<'a> Relay<'a> {
    fn new(common: &Common, watcher: &'a mut dyn Watcher) -> Self {
        let may_end = common.args.may_end_early();
        Self { watcher, deadline: common.deadline, may_end, is_cut: false, overdue: None, unwritten: None }
    }
}

impl Watcher for &mut Relay<'_> {
    fn sees_sample_progress(&self) -> bool {
        self.watcher.sees_sample_progress()
    }

    fn sample_progress(&mut self, share: f32) {
        self.watcher.sample_progress(share);
    }

    fn sample(&mut self) {
        self.watcher.sample();
    }

    fn ends(&mut self) -> bool {
        self.overdue = self.overdue.or(self.deadline.passed());
        if self.may_end {
            self.unwritten.get_or_insert_default();
            self.is_cut |= interrupt::is_asked();
        }
        self.is_cut |= self.overdue.is_some();
        self.is_cut
    }
}
