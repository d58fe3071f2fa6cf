//! Loads, builds and draws one scene after the other on the same devices.

use std::{
    cell::OnceCell,
    path::Path,
    sync::{Mutex, PoisonError},
    time::Instant,
};

use kdray::{
    accel::AccelKind,
    engine::{
        AnimatedWorld, Engine, LoadRequest, Loaded, NoiseGoal, Opened, Work,
        choices::{Choices, ChosenAccel, Methods},
    },
    frame::{Aov, Goal, Profile, RenderOptions, SampleRange},
    gpu::DeviceInfo,
    output::{self, FilmFile, Record, WholeRecord},
    util::progress,
    world::World,
};
use tracing::info_span;

use super::{
    deadline::Deadline,
    draw::{Common, DrawnPictures, FrameJob, OneFile, draw_and_write, draws_whole_frames},
    motion::CameraMotion,
    views::NamedPath,
};
use crate::cli::{
    args::RenderArgs,
    device_args::open_devices,
    error::CliError,
    progress::Progress,
    report::{FrameTimeRange, Report, SCHEMA},
    spans::Spans,
    trace::trace_json,
};

/// What a scheduler is told of the shares of the work: loading, building, and rendering, which takes longest in films.
const SHARES: [f64; 3] = [0.05, 0.05, 0.9];

/// What all scenes of a command share. Of a scene, it keeps nothing.
pub struct Session<'a> {
    pub args: &'a RenderArgs,
    pub progress: Progress,
    begun_at: Instant,
    spans: Spans,
    engine: OnceCell<Engine>,
}

/// A scene that can be drawn, and how it is drawn.
struct Ready {
    engine: Engine,
    world: World,
    options: RenderOptions,
    accel: ChosenAccel,
    methods: Methods,
    /// Number of samples per pixel of the whole picture, and which of them are drawn if they are not all.
    samples: (u32, Option<SampleRange>),
    noise_goal: Option<NoiseGoal>,
    n_triangles: usize,
    load_ms: f64,
    build_ms: f64,
}

impl Ready {
    /// Returns what all pictures of the scene have in common.
    fn common<'a>(
        &'a self,
        args: &'a RenderArgs,
        animated: Option<&'a Mutex<AnimatedWorld>>,
        deadline: Deadline,
    ) -> Common<'a> {
        let Self { engine, world, options, accel, samples, noise_goal, .. } = self;
        let mut record = record(engine, world, options, *accel, *samples);
        record.whole.noise = args.noise;
        let rate = args.load.frames_a_second();
        record.whole.shutter = args.shutter.map(|shutter| format!("{shutter} at {rate} frames a second"));
        let (n_samples, some_samples) = *samples;
        let n_drawn = some_samples.map_or(n_samples, |range| range.len());
        let goal = args.time.map_or(Goal::Samples(n_drawn), Goal::Time);
        let (camera, noise_goal) = (world.scene().camera, *noise_goal);
        Common {
            args,
            options,
            world,
            camera,
            animated,
            motion: None,
            one_file: None,
            goal,
            noise_goal,
            n_drawn,
            some_samples,
            deadline,
            record,
        }
    }
}

impl<'a> Session<'a> {
    pub fn new(args: &'a RenderArgs, n_scenes: usize) -> Self {
        let (begun_at, spans) = (Instant::now(), Spans::default());
        let spans_of_trace = args.trace.is_some().then_some(&spans);
        let progress = Progress::of_kind(args.progress, args.quiet, (&SHARES, n_scenes as u64), spans_of_trace);
        Self { args, progress, begun_at, spans, engine: OnceCell::new() }
    }

    /// Returns the engine. The first call opens the devices that the user asks for.
    pub fn engine(&self) -> Result<&Engine, CliError> {
        if let Some(engine) = self.engine.get() {
            return Ok(engine);
        }
        let args = self.args;
        let open = || open_devices(args.device.as_ref(), args.validate, &self.progress);
        let devices = if args.cpu { Vec::new() } else { info_span!("create device").in_scope(open)? };
        args.check_devices(devices.len())?;
        let engine = if args.cpu { Engine::on_cpu() } else { Engine::on_devices(devices) };
        Ok(self.engine.get_or_init(|| engine.with_request(args.picture.request())))
    }

    /// Opens the devices again for the next scene if one of them is lost.
    pub fn replace_lost_devices(&mut self) {
        if self.engine.get().is_some_and(|engine| engine.devices().any(|device| device.is_lost())) {
            self.engine.take();
        }
    }

    /// Ends the progress. Returns the engine.
    pub fn end(self) -> Result<Engine, CliError> {
        self.engine().cloned()
    }

    /// Loads a scene, builds its structure, draws its views and writes them.
    pub fn draw(&self, scene: &Path, mut views: Vec<FrameJob>, path: Option<NamedPath>) -> Result<Report, CliError> {
        let deadline = Deadline::new(self.args.time_limit);
        // A turn shows a thing at rest, unless the user chooses an animation.
        let may_play = self.args.turntable.is_none() || self.args.load.animation.is_some();
        let time = self.args.is_film().then(|| self.args.load.seconds_of(views[0].frame.into()));
        let time = time.or_else(|| self.args.shutter.map(|_| self.args.load.seconds().unwrap_or_default()));
        // A single picture shows its time without being told what moves, but the layer of motion needs to know it.
        let time = time.or(self.args.load.seconds().filter(|_| self.args.aov.contains(&Aov::Motion)));
        let first_time = time.filter(|_| may_play);
        let opened = self.open(scene, first_time, deadline)?;
        let is_animated = first_time.is_some() && self.args.load.plays(&opened.scene.animations);
        if !is_animated && path.is_none() && self.args.turntable.is_none() {
            self.args.refuse_to_move(scene)?;
        }
        let first_scene = is_animated.then(|| opened.scene.clone());
        let motion = match (self.args.turntable, path) {
            (Some(n_frames), _) => {
                let RenderOptions { width, height, .. } = opened.options;
                Some(CameraMotion::Turn(opened.scene.turntable(n_frames, width as f32 / height as f32)))
            }
            (None, path) => path.map(|path| CameraMotion::Path(path.relative_to(opened.scene.origin))),
        };
        if let Some(motion) = &motion {
            for view in &mut views {
                view.camera = Some(motion.camera_at(view.frame.into())?);
            }
        }
        let ready = self.build(opened, &views, (is_animated, deadline))?;
        deadline.check("building")?;
        let animated = first_scene.map(|first| {
            let request = self.request(first_time, Default::default());
            Mutex::new(AnimatedWorld::new(scene, &request, first, &ready.world))
        });
        let one_file = self.one_file(&views, &ready)?;
        let common = Common {
            one_file: one_file.as_ref(),
            motion: motion.as_ref(),
            ..ready.common(self.args, animated.as_ref(), deadline)
        };
        let rendering = format!("rendering {}x{}", common.record.crop.width(), common.record.crop.height());
        let (engine, stage) = ((&ready.engine, &ready.world), (&self.progress, rendering.as_str()));
        let (drawn, _) = self.progress.stage(&rendering, || draw_and_write(&common, engine, &views, stage));
        let DrawnPictures { profiles, n_samples, noise, render_ms } = drawn.map_err(CliError::of_drawing)?;
        let last_moment = animated.filter(|_| self.args.moves());
        let last_moment = last_moment.map(|it| it.into_inner().unwrap_or_else(PoisonError::into_inner).work());
        if let Some(file) = one_file {
            file.into_inner().unwrap_or_else(PoisonError::into_inner).finish()?;
        }

        let repeated = FrameTimeRange::of(&profiles);
        let profile = median(profiles);
        if let Some(path) = &self.args.trace {
            output::write(path, &trace_json(self.begun_at, &self.spans.sorted(), &profile))?;
        }
        let Ready { engine, world, options, accel, methods, noise_goal, n_triangles, load_ms, build_ms, .. } = &ready;
        Ok(Report {
            schema: SCHEMA,
            scene: world.scene().name.clone(),
            pictures: views.iter().map(|view| view.files.picture.clone()).collect(),
            extra_files: views.iter().flat_map(|view| view.files.beside()).cloned().collect(),
            options: options.into(),
            choices: Choices::of_pictures(*accel, methods.clone()),
            samples: n_samples,
            noise: noise_goal.zip(noise).map(|(goal, noise)| noise.report(goal)),
            devices: engine.devices().count().max(1),
            whole_frames: draws_whole_frames(engine, &views),
            triangles: *n_triangles,
            accel: world.statistics(),
            device_build: world.device_build().cloned(),
            last_moment,
            load_ms: *load_ms,
            build_ms: *build_ms,
            render_ms,
            repeated,
            frame: profile.into(),
        })
    }

    /// Begins the file of a film, if all its frames go to one.
    fn one_file(&self, views: &[FrameJob], ready: &Ready) -> Result<Option<Mutex<OneFile>>, CliError> {
        let path = &views[0].files.picture;
        if !self.args.is_film() || !views[0].shares_file {
            return Ok(None);
        }
        let crop = ready.options.crop_or_whole();
        let size = (crop.width(), crop.height());
        let file = FilmFile::new(path, size, self.args.load.frames_a_second(), views.len() as u32)?;
        Ok(Some(Mutex::new(OneFile::new(file))))
    }

    /// Builds the structure of a scene for its views, and chooses the methods.
    /// `is_animated`: whether animations play.
    fn build(
        &self,
        mut opened: Opened,
        views: &[FrameJob],
        (is_animated, deadline): (bool, Deadline),
    ) -> Result<Ready, CliError> {
        let (args, progress) = (self.args, &self.progress);
        args.set_options(&mut opened.options)?;
        args.check_shutter(&opened.options)?;
        let n_samples = args.samples(&opened.scene);
        let some_samples = args.some_samples(&opened.scene, &opened.options)?;
        let noise_goal = args.noise_goal(&opened.scene, &opened.options)?;
        let engine = self.engine()?;
        let (n_triangles, load_ms) = (opened.scene.n_triangles(), opened.load_ms);
        // A part of a picture gets the structure that the whole picture gets.
        let work = Work::Pictures {
            cameras: views.iter().filter_map(|view| view.camera).collect(),
            n_samples,
            n_at_once: if draws_whole_frames(engine, views) { engine.devices().count() as u32 } else { 1 },
        };
        let asked = args.picture.request();
        let moves = is_animated && args.moves();
        let of_motion = moves.then(|| opened.for_motion(asked, engine.processor(), n_samples));
        let (request, note) = of_motion.unwrap_or((asked, None));
        if request.instances != asked.instances {
            progress.note("meshes are kept apart, since some move; --instances flatten stores them as one");
        }
        note.iter().for_each(|note| progress.note(note));
        if request.build != asked.build && request.accel.unwrap_or_default() == AccelKind::KdTree {
            progress.note("the GPU builds the kd-trees, since meshes may change; with --build best, the CPU does");
        }
        let engine = engine.clone().with_request(request);
        let building = engine.builder().describe(&opened.scene);
        let engine = engine.with_progress(progress.observer(&building, &[progress::Work::Building]));
        let builder = engine.clone();
        let build = move || info_span!("build tree").in_scope(|| builder.build(opened, &work));
        let (built, _) = progress.stage(&building, || deadline.within("building", build));
        let (Loaded { world, options, accel, notes, build_ms, .. }, methods) = built??;
        notes.iter().for_each(|note| progress.note(note));
        let options = methods.apply(&options);
        let samples = (n_samples, some_samples);
        Ok(Ready { engine, world, options, accel, methods, samples, noise_goal, n_triangles, load_ms, build_ms })
    }

    /// Returns the request for a scene. `time`: the time at which its animations are shown, if not that of the
    /// arguments.
    fn request(&self, time: Option<f64>, observer: progress::Progress) -> LoadRequest {
        let load = &self.args.load;
        let mut request = load.pictures(&self.args.picture, &self.args.look, observer);
        request.scene.at = time.or(request.scene.at);
        request
    }

    /// Reads a scene.
    fn open(&self, scene: &Path, time: Option<f64>, deadline: Deadline) -> Result<Opened, CliError> {
        let loading = format!("loading {}", scene.display());
        let observer = self.progress.observer(&loading, &[progress::Work::Reading, progress::Work::Images]);
        let request = self.request(time, observer);
        let scene = scene.to_owned();
        let read = move || info_span!("load scene").in_scope(|| Opened::read(&scene, &request));
        let (read, _) = self.progress.stage(&loading, || deadline.within("loading", read));
        Ok(read??)
    }
}

/// Returns the record of the pictures, from the scene's own camera.
fn record(
    engine: &Engine,
    world: &World,
    options: &RenderOptions,
    accel: ChosenAccel,
    (n_samples, some_samples): (u32, Option<SampleRange>),
) -> Record {
    // Devices of one kind round alike, so they are named once.
    let of_devices = |of: fn(&DeviceInfo) -> &String| {
        let mut words: Vec<&str> = Vec::new();
        for word in engine.devices().map(|device| of(device.info()).as_str()) {
            if !words.contains(&word) {
                words.push(word);
            }
        }
        words.join("; ")
    };
    Record {
        scene: world.scene().name.clone(),
        whole: WholeRecord::new(world.scene(), options, n_samples),
        crop: options.crop_or_whole(),
        samples: some_samples.unwrap_or(SampleRange::whole(n_samples)),
        device: if engine.device().is_some() { of_devices(|it| &it.name) } else { "CPU".to_owned() },
        driver: of_devices(|it| &it.driver),
        accel: match accel.tree_kind() {
            Some(tree) => format!("{}, {}, {}", accel.kind(), tree.value, options.traversal),
            None => accel.kind().to_string(),
        },
        checksum: None,
    }
}

/// Returns the frame of median time. Without timestamps, returns the middle one in the order of drawing.
fn median(mut profiles: Vec<Profile>) -> Profile {
    profiles.sort_by(|a, b| a.frame_ms.partial_cmp(&b.frame_ms).expect("times are numbers"));
    profiles.swap_remove(profiles.len() / 2)
}
