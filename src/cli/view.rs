//! `kdray view`: a scene in a window, or a window that waits for a file.

use std::{path::Path, sync::Arc};

use kdray::{
    engine::choices::{Processor, Workload},
    frame::{RenderOptions, View},
    gpu::{ContextOptions, chosen_device},
    output::{self, Format, OutputError},
    scene::{self, CameraPath, RenderDefaults, Scene},
    util::{self, progress::Work},
    view::{Display, LoadOptions, LoadedScene, Opened, Opener, Settings, Tour, ViewOptions, ViewReport},
};
use serde::Serialize;

use super::{
    build,
    error::CliError,
    file_roles::FileRoles,
    picture_args::PictureArgs,
    print, print_line,
    progress::Progress,
    render::set_threads,
    view_args::{Switch, ViewArgs},
};

/// Default number of samples per pixel while the camera rests.
const SAMPLES_AT_REST: u32 = 256;

/// Runs `kdray view`: loads the scene if there is one, builds its structure and shows it. Arguments and files are
/// checked before the work that an error would waste.
pub fn run(args: &ViewArgs) -> Result<(), CliError> {
    args.picture.check()?;
    check_scene(args)?;
    check_shaders(args)?;
    check_outputs(args)?;
    set_threads(args.threads)?;
    let display = Display::open()?;

    let progress = Progress::new(args.quiet, 2);
    let Start { loaded, options, tour } = match &args.scene {
        Some(path) => load(args, path, &progress)?,
        None => without_scene(args)?,
    };
    drop(progress);

    let processor = loaded.load_options.processor;
    let max_samples = n_samples(args, tour.is_some());
    let vsync = args.vsync == Switch::On;
    let settings = Settings {
        options,
        in_motion: args.in_motion,
        max_samples,
        budget_ms: args.budget_ms,
        vsync,
        view: View::Picture,
        gain: 1.0,
    };
    let scene_name = loaded.scene().name.clone();
    let report = display.view(
        loaded,
        ViewOptions {
            settings,
            device: ContextOptions::new(args.device.clone(), args.validate),
            overlay: !args.no_overlay,
            tour,
            screenshot: args.screenshot.clone(),
            record: args.record.clone(),
            opener: opener(args, processor),
            shaders: args.shaders.clone(),
            // The window stays open even if the terminal is gone.
            print: |text| drop(print(text)),
        },
    )?;
    if let Some(path) = &args.profile {
        output::write(path, &json(&Profile { scene: &scene_name, budget_ms: args.budget_ms, vsync, view: &report }))?;
    }
    if !args.quiet {
        print(&format!("{}\n", report.choices))?;
    }
    for message in &report.validation {
        print_line("validation", message);
    }
    if report.validation.is_empty() { Ok(()) } else { Err(CliError::Validation(report.validation.len())) }
}

/// Returns the function that loads the files which the user opens in the window. The options of pictures on the
/// command line apply to them, too.
fn opener(args: &ViewArgs, processor: Processor) -> Opener {
    let picture = args.picture.clone();
    let first = args.load.options_for(&picture, &args.look);
    // The camera and the scene on the command line are those of the first file.
    let look = scene::Look { eye: None, target: None, ..first.look };
    let load_options = scene::LoadOptions { scene: None, camera: None, look, ..first };
    Arc::new(move |path, progress| {
        open(path, (&load_options, progress), &picture, processor).map_err(|error| error.to_string())
    })
}

fn open(
    path: &Path,
    (scene_options, progress): (&scene::LoadOptions, util::progress::Progress),
    picture: &PictureArgs,
    processor: Processor,
) -> Result<Opened, CliError> {
    let observed = scene::LoadOptions { progress: progress.clone(), ..scene_options.clone() };
    let scene = Scene::load_with(path, &observed)?;
    let mut options = picture.options(&scene.defaults);
    scene.warn_of_missing_light(path, options.integrator);
    let (request, workload) = (picture.request(), Workload::of_window((options.width, options.height)));
    let accel = request.choose_accel(processor, scene.n_triangles(), &workload);
    build::check_memory(accel, scene.n_triangles())?;
    let load_options = LoadOptions { request, processor, workload, scene: scene_options.clone() };
    let loaded = LoadedScene::with_tree(path, scene, &load_options, &progress);
    picture.meter(&loaded.world, &mut options);
    Ok(Opened { loaded, options })
}

/// What the window shows first.
struct Start {
    loaded: LoadedScene,
    options: RenderOptions,
    tour: Option<Tour>,
}

/// Loads the scene and builds its structure.
fn load(args: &ViewArgs, path: &Path, progress: &Progress) -> Result<Start, CliError> {
    let scene_options = args.load.options_for(&args.picture, &args.look);
    let loading = format!("loading {}", path.display());
    let observed = scene::LoadOptions {
        progress: progress.observer(&loading, &[Work::Reading, Work::Images]),
        ..scene_options.clone()
    };
    let (scene, _) = progress.stage(&loading, || Scene::load_with(path, &observed));
    let scene = scene?;
    scene.warn_of_missing_light(path, args.picture.options(&scene.defaults).integrator);
    args.look.note_up(path, &scene).into_iter().for_each(|note| progress.note(&note));
    let mut options = args.picture.options(&scene.defaults);
    let tour = tour(args, &scene)?;
    let workload = match &tour {
        Some(tour) => {
            let n_pictures = u64::from(tour.n_frames()) * u64::from(n_samples(args, true));
            Workload::of_pictures(&options, scene.lights.len(), n_pictures)
        }
        None => Workload::of_window((options.width, options.height)),
    };
    let processor = Processor::of_device(&chosen_device(args.device.as_ref())?);
    let load_options = LoadOptions { request: args.picture.request(), processor, workload, scene: scene_options };
    let accel = load_options.request.choose_accel(processor, scene.n_triangles(), &workload);
    build::check_memory(accel, scene.n_triangles())?;
    let building = build::building(accel, scene.n_triangles());
    let observer = progress.observer(&building, &[Work::Building]);
    let (loaded, _) = progress.stage(&building, || LoadedScene::with_tree(path, scene, &load_options, &observer));
    args.picture.meter(&loaded.world, &mut options).into_iter().for_each(|note| progress.note(&note));
    Ok(Start { loaded, options, tour })
}

/// Returns the start of a window that waits for a file.
fn without_scene(args: &ViewArgs) -> Result<Start, CliError> {
    let scene = args.load.options_for(&args.picture, &args.look);
    let options = args.picture.options(&RenderDefaults::default());
    let processor = Processor::of_device(&chosen_device(args.device.as_ref())?);
    let (request, workload) = (args.picture.request(), Workload::of_window((options.width, options.height)));
    let loaded = LoadedScene::none(&LoadOptions { request, processor, workload, scene });
    Ok(Start { loaded, options, tour: None })
}

/// Returns the number of samples per pixel while the camera rests.
fn n_samples(args: &ViewArgs, has_tour: bool) -> u32 {
    args.spp.unwrap_or(if has_tour { 1 } else { SAMPLES_AT_REST })
}

/// Returns the camera tour of `--path` and `--frames`, or none if neither is given.
fn tour(args: &ViewArgs, scene: &Scene) -> Result<Option<Tour>, CliError> {
    let Some(file) = &args.path else { return Ok(args.frames.map(|n_frames| Tour::around(scene.camera, n_frames))) };
    let path = CameraPath::load(file)?.from_origin(scene.origin);
    let n_frames = args.frames.unwrap_or((path.end() - path.begin()).ceil() as u32 + 1);
    let tour = Tour::along(&path, n_frames).ok_or_else(|| {
        let file = file.display();
        CliError::Usage(format!("{file}: between keyframes, eye and target coincide, or up points along the view"))
    });
    tour.map(Some)
}

/// The file of `--profile`.
#[derive(Serialize)]
struct Profile<'a> {
    scene: &'a str,
    budget_ms: f64,
    vsync: bool,
    #[serde(flatten)]
    view: &'a ViewReport,
}

fn json(profile: &Profile) -> Vec<u8> {
    let mut json = serde_json::to_vec_pretty(profile).expect("plain structs of numbers and words");
    json.push(b'\n');
    json
}

/// Refuses options that choose a part of the scene's file if there is none.
fn check_scene(args: &ViewArgs) -> Result<(), CliError> {
    if args.scene.is_none() && (args.load.camera.is_some() || args.load.scene_name.is_some()) {
        return Err(CliError::Usage("--camera and --scene choose a part of SCENE, which is missing".into()));
    }
    Ok(())
}

/// Refuses a checkout that has no shaders.
fn check_shaders(args: &ViewArgs) -> Result<(), CliError> {
    match &args.shaders {
        Some(checkout) if !checkout.join("glsl").is_dir() => {
            Err(CliError::Usage(format!("--shaders {}: there is no folder glsl in it", checkout.display())))
        }
        _ => Ok(()),
    }
}

/// Refuses outputs that cannot be written, or that the command also reads.
fn check_outputs(args: &ViewArgs) -> Result<(), CliError> {
    check_roles(args)?;
    if let Some(path) = &args.screenshot {
        Format::of(path)?;
        output::check(path)?;
    }
    if let Some(path) = &args.profile {
        output::check(path)?;
    }
    if let Some(directory) = &args.record {
        check_directory(directory)?;
    }
    Ok(())
}

/// Refuses an output that the command also reads, or that it writes twice.
fn check_roles(args: &ViewArgs) -> Result<(), CliError> {
    let mut roles = FileRoles::default();
    args.scene.iter().for_each(|scene| roles.read_scene("SCENE", scene, args.load.options()));
    args.path.iter().for_each(|path| roles.read("--path", path));
    args.screenshot.iter().try_for_each(|path| roles.write("--screenshot", path))?;
    args.profile.iter().try_for_each(|path| roles.write("--profile", path))
}

/// Refuses a directory in which frames cannot be written.
fn check_directory(directory: &Path) -> Result<(), CliError> {
    let path = directory.join("frame.0000.png");
    if directory.is_dir() {
        return Ok(output::check(&path)?);
    }
    Err(OutputError::NoDirectory { path, directory: directory.to_owned() }.into())
}
