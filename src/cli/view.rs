//! `kdray view`: a scene in a window, or a window that waits for a file.

use std::{path::Path, sync::Arc};

use kdray::{
    engine::{self, Builder, Opened, choices::Processor},
    frame::View,
    gpu::{ContextOptions, chosen_device},
    output::{self, Format, OutputError},
    scene::{CameraPath, LoadOptions, Look, Scene},
    util::{self, progress::Work},
    view::{Display, LoadSettings, LoadedScene, Opener, Settings, Tour, ViewOptions, ViewReport},
};
use serde::Serialize;

use super::{
    device_args::software_note,
    error::CliError,
    file_roles::FileRoles,
    print, print_line,
    progress::Progress,
    render::set_threads,
    report::{SCHEMA, write_json},
    view_args::{Switch, ViewArgs},
};

/// Default number of samples per pixel while the camera rests.
const SAMPLES_AT_REST: u32 = 256;

/// Runs `kdray view`: loads the scene if there is one, builds its structure and shows it. Arguments and files are
/// checked before the work that an error would waste.
pub fn run(args: &ViewArgs) -> Result<(), CliError> {
    args.picture.check(args.cpu)?;
    check_scene(args)?;
    check_shaders(args)?;
    check_outputs(args)?;
    set_threads(args.threads)?;
    let display = Display::open()?;

    let progress = Progress::new(args.quiet, 2);
    let Start { loaded, tour } = load(args, &progress)?;
    drop(progress);

    let processor = loaded.load_settings.builder.processor;
    let max_samples = n_samples(args, tour.is_some());
    let vsync = args.vsync == Switch::On;
    let settings = Settings {
        options: loaded.built.options.clone(),
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
            on_cpu: args.cpu,
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
    let tell = || {
        let profile = Profile { schema: SCHEMA, scene: &scene_name, budget_ms: args.budget_ms, vsync, view: &report };
        write_json(args.profile.as_ref(), &profile)?;
        if let Some(choices) = report.choices.as_ref().filter(|_| !args.quiet) {
            print(&format!("{choices}\n"))?;
        }
        report.validation.iter().for_each(|message| print_line("validation", message));
        match report.validation.len() {
            0 => Ok(()),
            n => Err(CliError::Validation(n)),
        }
    };
    if report.is_abandoned { end_at_once(&tell()) } else { tell() }
}

/// Ends the process without the handlers of its libraries, since a driver that still compiles uses what they release.
fn end_at_once(outcome: &Result<(), CliError>) -> ! {
    let code = outcome.as_ref().err().map_or(0, CliError::exit_code);
    outcome.as_ref().err().into_iter().for_each(|error| print_line("error", &error.to_string()));
    output::remove_temporaries();
    #[cfg(unix)]
    signal_hook::low_level::exit(code.into());
    #[cfg(not(unix))]
    std::process::exit(code.into())
}

/// Returns the function that loads the files which the user opens in the window. The options of pictures on the
/// command line apply to them, too.
fn opener(args: &ViewArgs, processor: Processor) -> Opener {
    let mut settings = load_settings(args, processor, Default::default());
    // The camera and the scene on the command line are those of the first file.
    let first = settings.request.scene;
    let look = Look { eye: None, target: None, ..first.look };
    settings.request.scene = LoadOptions { scene: None, camera: None, look, ..first };
    Arc::new(move |path, progress| {
        let mut settings = settings.clone();
        settings.request.scene.progress = progress.clone();
        settings.builder.progress = progress;
        LoadedScene::load(path, &settings).map_err(|error| error.to_string())
    })
}

/// Returns how files are loaded. `progress` shows the reading.
fn load_settings(args: &ViewArgs, processor: Processor, progress: util::progress::Progress) -> LoadSettings {
    let mut request = args.load.pictures(&args.picture, &args.look, progress);
    request.work = engine::Work::Window { n_samples: None };
    LoadSettings { request, builder: Builder::new(processor, args.picture.request()) }
}

/// What the window shows first.
struct Start {
    loaded: LoadedScene,
    tour: Option<Tour>,
}

/// Loads the scene and builds its structure, or returns the start of a window that waits for a file.
fn load(args: &ViewArgs, progress: &Progress) -> Result<Start, CliError> {
    let device = chosen_device(args.device.as_ref())?;
    let processor = if args.cpu { Processor::Cpu } else { Processor::of_device(&device) };
    if processor == Processor::SoftwareDriver && args.device.is_none() {
        progress.note(&software_note(&device.name));
    }
    let Some(path) = &args.scene else {
        let settings = load_settings(args, processor, Default::default());
        return Ok(Start { loaded: LoadedScene::none(&settings)?, tour: None });
    };
    let loading = format!("loading {}", path.display());
    let observer = progress.observer(&loading, &[Work::Reading, Work::Images]);
    let mut settings = load_settings(args, processor, observer);
    let (opened, _) = progress.stage(&loading, || Opened::read(path, &settings.request));
    let opened = opened?;
    let tour = tour(args, &opened.scene)?;
    if let Some(tour) = &tour {
        let n_samples = u64::from(tour.n_frames()) * u64::from(n_samples(args, true));
        settings.request.work = engine::Work::Window { n_samples: Some(n_samples) };
    }
    let building = settings.builder.describe(&opened.scene);
    settings.builder.progress = progress.observer(&building, &[Work::Building]);
    let (loaded, _) = progress.stage(&building, || LoadedScene::build(Some(path), opened, &settings));
    let loaded = loaded?;
    loaded.built.notes.iter().for_each(|note| progress.note(note));
    Ok(Start { loaded, tour })
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
    schema: u32,
    scene: &'a str,
    budget_ms: f64,
    vsync: bool,
    #[serde(flatten)]
    view: &'a ViewReport,
}

/// Refuses options that choose a part of the scene's file if there is none.
fn check_scene(args: &ViewArgs) -> Result<(), CliError> {
    if args.scene.is_none() && (args.load.camera.is_some() || args.load.scene_name.is_some()) {
        return CliError::refuse("--camera and --scene choose a part of SCENE, which is missing");
    }
    Ok(())
}

/// Refuses a checkout that has no shaders.
fn check_shaders(args: &ViewArgs) -> Result<(), CliError> {
    match &args.shaders {
        Some(checkout) if !checkout.join("glsl").is_dir() => {
            CliError::refuse(format!("--shaders {}: there is no folder glsl in it", checkout.display()))
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
