//! `kdray render`: renders a scene file to pictures.

mod draw;
mod files;
mod noise;
mod views;

use std::time::Instant;

use kdray::{
    engine::{
        Engine, Loaded, Opened, Work,
        choices::{Choices, ChosenAccel},
    },
    frame::{Goal, Profile, RenderOptions, SampleRange},
    gpu::{Device, DeviceInfo},
    output::{self, Record, WholeRecord},
    util::progress,
    world::World,
};
use tracing::info_span;

use self::{
    draw::{Common, DrawnPictures, draw_and_write, draws_whole_frames},
    files::{check_outputs, roles},
    views::{NamedPath, views},
};
use super::{
    args::RenderArgs,
    device_args::open_devices,
    error::CliError,
    print, print_line,
    progress::Progress,
    report::{FrameTimeRange, Report, SCHEMA},
    spans::Spans,
    trace::trace_json,
};

/// What a scheduler is told of the shares of the work: loading, building, and rendering, which takes longest in films.
const SHARES: [f64; 3] = [0.05, 0.05, 0.9];

/// Runs `kdray render`: loads the scene, builds its structure, renders, writes and reports. Arguments, files and
/// memory are checked before the work that an error would waste.
pub fn run(args: RenderArgs) -> Result<(), CliError> {
    let args = &args.with_packed_path()?;
    args.check()?;
    let roles = roles(args)?;
    check_outputs(args)?;
    set_threads(args.threads)?;

    let (begun_at, spans) = (Instant::now(), Spans::default());
    let spans_of_trace = args.trace.is_some().then_some(&spans);
    let progress = Progress::of_kind(args.progress, args.quiet, &SHARES, spans_of_trace);
    let path = args.path.as_deref().map(NamedPath::load).transpose()?;
    let mut views = views(args, path.as_ref(), roles, &progress)?;
    if views.is_empty() {
        return Ok(());
    }
    let mut opened = open(args, &progress)?;
    if let Some(path) = path {
        let path = path.relative_to(opened.scene.origin);
        for view in &mut views {
            view.camera = Some(path.camera_at(view.frame)?);
        }
    }
    args.set_options(&mut opened.options)?;
    let n_samples = args.samples(&opened.scene);
    let some_samples = args.some_samples(&opened.scene, &opened.options)?;
    let noise_goal = args.noise_goal(&opened.scene, &opened.options)?;
    let n_drawn = some_samples.map_or(n_samples, |range| range.len());
    let devices = || open_devices(args.device.as_ref(), args.validate, &progress);
    let devices = if args.cpu { Vec::new() } else { info_span!("create device").in_scope(devices)? };
    args.check_devices(devices.len())?;

    let engine = if args.cpu { Engine::on_cpu() } else { Engine::on_devices(devices.clone()) };
    let engine = engine.with_request(args.picture.request());
    let whole_frames = draws_whole_frames(&engine, &views);
    let (n_triangles, load_ms) = (opened.scene.n_triangles(), opened.load_ms);
    // A part of a picture gets the structure that the whole picture gets.
    let work = Work::Pictures {
        cameras: views.iter().filter_map(|view| view.camera).collect(),
        n_samples,
        n_at_once: if whole_frames { devices.len() as u32 } else { 1 },
    };
    let building = engine.builder().describe(n_triangles);
    let engine = engine.with_progress(progress.observer(&building, &[progress::Work::Building]));
    let build = || info_span!("build tree").in_scope(|| engine.build(opened, &work));
    let (built, _) = progress.stage(&building, build);
    let (Loaded { world, options, accel, notes, build_ms, .. }, methods) = built?;
    notes.iter().for_each(|note| progress.note(note));
    let (options, camera) = (methods.apply(&options), world.scene().camera);
    let mut record = record(&engine, &world, &options, accel, (n_samples, some_samples));
    record.whole.noise = args.noise;
    let crop = record.crop;
    let goal = args.time.map_or(Goal::Samples(n_drawn), Goal::Time);
    let common = Common { args, options: &options, camera, goal, noise_goal, n_drawn, some_samples, record };
    let rendering = format!("rendering {}x{}", crop.width(), crop.height());
    let (drawn, _) =
        progress.stage(&rendering, || draw_and_write(&common, (&engine, &world), &views, (&progress, &rendering)));
    let DrawnPictures { profiles, n_samples, noise, render_ms } = drawn.map_err(CliError::of_drawing)?;
    drop(progress);

    let repeated = FrameTimeRange::of(&profiles);
    let profile = median(profiles);
    if let Some(path) = &args.trace {
        output::write(path, &trace_json(begun_at, &spans.sorted(), &profile))?;
    }
    let report = Report {
        schema: SCHEMA,
        scene: world.scene().name.clone(),
        pictures: views.iter().map(|view| view.files.picture.clone()).collect(),
        extra_files: views.iter().flat_map(|view| view.files.beside()).cloned().collect(),
        options: (&options).into(),
        choices: Choices::of_pictures(accel, methods),
        samples: n_samples,
        noise: noise_goal.zip(noise).map(|(goal, noise)| noise.report(goal)),
        devices: devices.len().max(1),
        whole_frames,
        triangles: n_triangles,
        accel: world.statistics(),
        grid_build: world.grid_build().cloned(),
        load_ms,
        build_ms,
        render_ms,
        repeated,
        frame: profile.into(),
    };
    if let Some(path) = &args.profile {
        output::write(path, &report.json())?;
    }
    if !args.quiet {
        print(&args.progress.report(&report.text()))?;
    }
    devices.iter().try_for_each(report_validation)
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

/// Reads the scene.
fn open(args: &RenderArgs, progress: &Progress) -> Result<Opened, CliError> {
    let loading = format!("loading {}", args.scene.display());
    let observer = progress.observer(&loading, &[progress::Work::Reading, progress::Work::Images]);
    let request = args.load.pictures(&args.picture, &args.look, observer);
    let read = || info_span!("load scene").in_scope(|| Opened::read(&args.scene, &request));
    Ok(progress.stage(&loading, read).0?)
}

/// Sets the number of threads of rayon's global pool. Without a number, rayon chooses.
pub(super) fn set_threads(n_threads: Option<u16>) -> Result<(), CliError> {
    let Some(n_threads) = n_threads else { return Ok(()) };
    (rayon::ThreadPoolBuilder::new().num_threads(n_threads.into()).build_global())
        .map_err(|error| CliError::Usage(format!("--threads {n_threads}: {error}")))
}

/// Returns the frame of median time. Without timestamps, returns the middle one in the order of drawing.
fn median(mut profiles: Vec<Profile>) -> Profile {
    profiles.sort_by(|a, b| a.frame_ms.partial_cmp(&b.frame_ms).expect("times are numbers"));
    profiles.swap_remove(profiles.len() / 2)
}

/// Prints the validation layer's messages. Fails if there is any.
pub(super) fn report_validation(device: &Device) -> Result<(), CliError> {
    let messages = device.validation_messages();
    for message in &messages {
        print_line("validation", message);
    }
    if messages.is_empty() { Ok(()) } else { Err(CliError::Validation(messages.len())) }
}
