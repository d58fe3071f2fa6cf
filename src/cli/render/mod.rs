//! `kdray render`: renders a scene file to pictures.

mod draw;
mod files;
mod memory;

use std::{path::Path, time::Instant};

use kdray::{
    engine::{
        Built, Engine,
        choices::{Choices, ChosenAccel, Workload},
    },
    frame::{Goal, Profile, RenderOptions, SampleRange},
    gpu::{Context, DeviceInfo, GpuError},
    output::{self, Record, WholeRecord},
    scene::{CameraPath, LoadOptions, Scene},
    util::progress::Work,
    world::World,
};
use tracing::info_span;

pub(super) use self::memory::check_memory;
use self::{
    draw::{Common, DrawnPictures, FrameJob, draw_and_write, draws_whole_frames},
    files::{Files, check_outputs, numbered, output_of, roles},
};
use super::{
    args::{Frames, RenderArgs},
    build,
    device_args::open_devices,
    error::CliError,
    file_roles::FileRoles,
    print, print_line,
    progress::Progress,
    report::{FrameTimeRange, Report},
    spans::Spans,
    trace::trace_json,
};

/// Runs `kdray render`: loads the scene, builds its structure, renders, writes and reports. Arguments, files and
/// memory are checked before the work that an error would waste.
pub fn run(args: RenderArgs) -> Result<(), CliError> {
    let args = &args.with_packed_path()?;
    args.check()?;
    let roles = roles(args)?;
    check_outputs(args)?;
    set_threads(args.threads)?;

    let (begun_at, spans) = (Instant::now(), Spans::default());
    let progress = Progress::with_spans(args.quiet, 3, args.trace.is_some().then_some(&spans));
    let mut views = views(args, roles, &progress)?;
    if views.is_empty() {
        return Ok(());
    }
    let (scene, load_ms) = load(args, &progress)?;
    if let Some(path) = &args.path {
        let path = CameraPath::load(path)?.from_origin(scene.origin);
        views.iter_mut().for_each(|view| view.camera = path.camera_at(f64::from(view.frame)).or(view.camera));
    }
    let options = args.options(&scene)?;
    let n_samples = args.samples(&scene);
    let some_samples = args.some_samples(&scene, &options)?;
    let n_drawn = some_samples.map_or(n_samples, |range| range.len());
    check_memory(&options, n_drawn, args.cpu, 1)?;
    let open = || open_devices(args.device.as_ref(), args.validate, &progress);
    let contexts = if args.cpu { Vec::new() } else { info_span!("create device").in_scope(open)? };
    args.check_devices(contexts.len())?;

    let engine = if args.cpu { Engine::on_cpu() } else { Engine::on_devices(contexts.clone()) };
    let engine = engine.with_request(args.picture.request());
    let whole_frames = draws_whole_frames(&engine, &views);
    if whole_frames {
        check_memory(&options, n_drawn, args.cpu, contexts.len() as u64)?;
    }
    let n_triangles = scene.n_triangles();
    // A part of a picture gets the structure that the whole picture gets.
    let n_pictures = u64::from(n_samples) * views.len() as u64;
    let camera = scene.camera;
    let cameras = views.iter().map(|view| view.camera.as_ref().unwrap_or(&camera));
    let workload = Workload::of_pictures(&options, scene.lights.len(), n_pictures).with_cameras(cameras);
    let accel = engine.choose_accel(n_triangles, &workload);
    build::check_memory(accel, n_triangles)?;
    let building = build::building(accel, n_triangles);
    let engine = engine.with_progress(progress.observer(&building, &[Work::Building]));
    let build = || info_span!("build tree").in_scope(|| engine.build(scene, &workload));
    let (built, build_ms) = progress.stage(&building, build);
    let Built { world, accel } = built.map_err(GpuError::from)?;
    let methods = engine.methods(&world, &workload)?;
    let mut options = methods.apply(&options);
    args.picture.meter(&world, &mut options).into_iter().for_each(|note| progress.note(&note));
    let record = record(&engine, &world, &options, accel, (n_samples, some_samples));
    let crop = record.crop;
    let goal = args.time.map_or(Goal::Samples(n_drawn), Goal::Time);
    let common = Common { args, options: &options, camera, goal, n_drawn, some_samples, record };
    let rendering = format!("rendering {}x{}", crop.width(), crop.height());
    let (drawn, _) =
        progress.stage(&rendering, || draw_and_write(&common, (&engine, &world), &views, (&progress, &rendering)));
    let DrawnPictures { profiles, n_samples, render_ms } = drawn.map_err(CliError::of_drawing)?;
    drop(progress);

    let repeated = FrameTimeRange::of(&profiles);
    let profile = median(profiles);
    if let Some(path) = &args.trace {
        output::write(path, &trace_json(begun_at, &spans.sorted(), &profile))?;
    }
    let report = Report {
        scene: world.scene().name.clone(),
        pictures: views.iter().map(|view| view.files.picture.clone()).collect(),
        extra_files: views.iter().flat_map(|view| view.files.beside()).cloned().collect(),
        options: (&options).into(),
        choices: Choices::of_pictures(accel, methods),
        samples: n_samples,
        devices: contexts.len().max(1),
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
        print(&report.text())?;
    }
    contexts.iter().try_for_each(|context| report_validation(context))
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
        let mut words: Vec<&str> = engine.contexts().map(|context| of(context.info()).as_str()).collect();
        words.dedup();
        words.join("; ")
    };
    Record {
        scene: world.scene().name.clone(),
        whole: WholeRecord::new(world.scene(), options, n_samples),
        crop: options.crop_or_whole(),
        samples: some_samples.unwrap_or(SampleRange::whole(n_samples)),
        device: if engine.context().is_some() { of_devices(|it| &it.name) } else { "CPU".to_owned() },
        driver: of_devices(|it| &it.driver),
        accel: match accel.tree_kind() {
            Some(tree) => format!("{}, {}, {}", accel.kind(), tree.value, options.traversal),
            None => accel.kind().to_string(),
        },
        checksum: None,
    }
}

/// Loads the scene. Returns it and the loading time in milliseconds. Warns if the scene has no light.
fn load(args: &RenderArgs, progress: &Progress) -> Result<(Scene, f64), CliError> {
    let loading = format!("loading {}", args.scene.display());
    let observer = progress.observer(&loading, &[Work::Reading, Work::Images]);
    let options = args.load.options_for(&args.picture, &args.look);
    let options = LoadOptions { progress: observer, ..options };
    let (scene, load_ms) =
        progress.stage(&loading, || info_span!("load scene").in_scope(|| Scene::load_with(&args.scene, &options)));
    let scene = scene?;
    scene.warn_of_missing_light(&args.scene, args.picture.options(&scene.defaults).integrator);
    args.look.note_up(&args.scene, &scene).into_iter().for_each(|note| progress.note(&note));
    Ok((scene, load_ms))
}

/// Returns the scene's own view or, with a path, one view per frame. Leaves out views whose files exist, if the user
/// wants that. Refuses views whose files cannot be written or have another role.
fn views(args: &RenderArgs, mut roles: FileRoles, progress: &Progress) -> Result<Vec<FrameJob>, CliError> {
    let output = output_of(args);
    let mut views = match &args.path {
        None => vec![FrameJob { camera: None, frame: 0, files: Files::of(output, &args.aov) }],
        Some(path) => {
            let views = views_along(path, args, &output)?;
            views.iter().try_for_each(|view| view.files.note(&mut roles))?;
            views
        }
    };
    if args.skip_existing {
        let n_all = views.len();
        views.retain(|view| !view.files.exist());
        match n_all - views.len() {
            0 => (),
            1 => progress.note("1 picture exists already"),
            n => progress.note(&format!("{n} pictures exist already")),
        }
    }
    views.iter().try_for_each(|view| view.files.check())?;
    Ok(views)
}

/// Returns one view per frame of the path.
fn views_along(path_file: &Path, args: &RenderArgs, output: &Path) -> Result<Vec<FrameJob>, CliError> {
    let path = CameraPath::load(path_file)?;
    let Frames { first, last, step } =
        args.frames.unwrap_or(Frames { first: path.begin().ceil() as u32, last: path.end().floor() as u32, step: 1 });
    if first > last {
        return Err(CliError::Usage(format!(
            "{}: no whole frame number lies between its first and last keyframe",
            path_file.display()
        )));
    }
    let view = |frame| {
        let camera = path.camera_at(f64::from(frame)).ok_or_else(|| {
            let file = path_file.display();
            CliError::Usage(format!("{file}: at frame {frame}, eye and target coincide, or up points along the view"))
        })?;
        Ok(FrameJob { camera: Some(camera), frame, files: Files::of(numbered(output, frame)?, &args.aov) })
    };
    (first..=last).step_by(step as usize).map(view).collect()
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
pub(super) fn report_validation(context: &Context) -> Result<(), CliError> {
    let messages = context.validation_messages();
    for message in &messages {
        print_line("validation", message);
    }
    if messages.is_empty() { Ok(()) } else { Err(CliError::Validation(messages.len())) }
}
