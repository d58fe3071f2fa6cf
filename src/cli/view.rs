//! `kdray view`: a scene in a window.

use std::path::Path;

use kdray::{
    engine::choices::{Processor, Workload},
    frame::View,
    gpu::{ContextOptions, chosen_device},
    output::{self, Format, OutputError},
    scene::{Camera, CameraPath, Scene},
    view::{Display, LoadOptions, LoadedScene, Settings, Tour, ViewOptions, ViewReport},
};
use serde::Serialize;

use super::{
    build,
    error::CliError,
    file_roles::FileRoles,
    print, print_line,
    progress::Progress,
    render::set_threads,
    view_args::{Switch, ViewArgs},
};

/// Default number of samples per pixel while the camera rests.
const SAMPLES_AT_REST: u32 = 256;

/// Runs `kdray view`: loads the scene, builds its structure and shows it. Arguments and files are checked before the
/// work that an error would waste.
pub fn run(args: &ViewArgs) -> Result<(), CliError> {
    args.picture.check()?;
    check_outputs(args)?;
    set_threads(args.threads)?;
    let display = Display::open()?;

    let progress = Progress::new(args.quiet, 2);
    let (scene, _) = progress.stage(&format!("loading {}", args.scene.display()), || {
        Scene::load_with(&args.scene, &args.load.options_for(&args.picture, &args.look))
    });
    let scene = scene?;
    scene.warn_if_unlit(&args.scene);
    args.look.note_up(&args.scene, &scene).into_iter().for_each(|note| progress.note(&note));
    let mut options = args.picture.options(&scene);
    let tour = tour(args, scene.camera)?;
    let max_samples = args.spp.unwrap_or(if tour.is_some() { 1 } else { SAMPLES_AT_REST });
    let workload = match &tour {
        Some(tour) => {
            let n_pictures = u64::from(tour.n_frames()) * u64::from(max_samples);
            Workload::of_pictures(&options, scene.lights.len(), n_pictures)
        }
        None => Workload::of_window((options.width, options.height)),
    };
    let processor = Processor::of_device(&chosen_device(args.device.as_ref())?);
    let load_options = LoadOptions {
        request: args.picture.request(),
        processor,
        workload,
        scene: args.load.options_for(&args.picture, &args.look),
    };
    let accel = load_options.request.choose_accel(processor, scene.n_triangles(), &workload);
    build::check_memory(accel, scene.n_triangles())?;
    let building = build::building(accel, scene.n_triangles());
    let (loaded, _) = progress.stage(&building, || LoadedScene::with_tree(&args.scene, scene, &load_options));
    args.picture.meter(&loaded.world, &mut options).into_iter().for_each(|note| progress.note(&note));
    drop(progress);

    let vsync = args.vsync == Switch::On;
    let settings = Settings { options, max_samples, budget_ms: args.budget_ms, vsync, view: View::Picture, gain: 1.0 };
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

/// Returns the camera tour of `--path` and `--frames`, or none if neither is given.
fn tour(args: &ViewArgs, start: Camera) -> Result<Option<Tour>, CliError> {
    let Some(file) = &args.path else { return Ok(args.frames.map(|n_frames| Tour::around(start, n_frames))) };
    let path = CameraPath::load(file)?;
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
    roles.read_scene("SCENE", &args.scene, args.load.options());
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
