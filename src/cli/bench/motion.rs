//! `kdray bench motion`: the frames of an animation, without a window and without files.

use kdray::{
    bench::motion::{Phase, Report, measure, moments},
    engine::{AnimatedWorld, Engine, Loaded},
    frame::RenderOptions,
    gpu::{ContextOptions, Device},
};

use super::args::MotionArgs;
use crate::cli::{
    device_args::open_device,
    error::CliError,
    print,
    progress::Progress,
    table::{decimal, table},
};

/// Loads the scene, draws its frames and reports their times.
pub fn run(args: &MotionArgs) -> Result<(), CliError> {
    args.files.check(&[&args.scene], &args.load.options())?;
    args.picture.check(args.cpu)?;
    let progress = Progress::new(false, 3);
    let (scene, n_frames) = (args.scene.display(), args.frames);
    let mut request = args.load.pictures(&args.picture, &args.look, Default::default());
    let first = request.scene.at;
    request.scene.at = first.or(Some(0.0));
    let opened = progress.read(&args.scene, &request)?;
    if !args.load.plays(&opened.scene.animations) {
        return CliError::refuse(format!("{scene}: nothing moves, so there are no frames to measure"));
    }
    let fps = args.load.frames_a_second();
    let animations = &opened.scene.animations;
    let moments = moments(&request.scene.animation, animations, (n_frames, fps), first);

    let options = ContextOptions::new(args.device.clone(), false);
    let device = if args.cpu { None } else { Some(open_device(&options, &progress)?) };
    let engine = device.clone().map_or_else(Engine::on_cpu, Engine::on_device);
    let (request_of_motion, note) = opened.for_motion(args.picture.request(), engine.processor(), 1);
    note.iter().for_each(|note| progress.note(note));
    let engine = engine.with_request(request_of_motion);
    let (n_triangles, scene) = (opened.scene.n_triangles(), opened.scene.clone());
    let building = format!("building the structure of {n_triangles} triangles");
    let (built, _) = progress.stage(&building, || engine.build(opened, &request.work));
    let (Loaded { world, options, .. }, methods) = built?;
    let options = methods.apply(&options);
    let mut animated = AnimatedWorld::new(&args.scene, &request, scene, &world);
    let drawing = format!("drawing {n_frames} frames");
    let (times, _) = progress.stage(&drawing, || measure(&engine, (&mut animated, &world), &options, &moments));
    let times = times?;
    drop(progress);
    let info = device.as_ref().map(Device::info);
    let RenderOptions { width, height, integrator, .. } = options;
    let report = Report {
        suite: "motion",
        device: engine.device_name(),
        driver: info.map(|info| info.driver.clone()),
        scene: world.scene().name.clone(),
        n_triangles,
        keeps_instances: world.scene().instances.is_some(),
        n_moved: 0,
        n_deformed: 0,
        integrator: integrator.to_string(),
        width,
        height,
        fps,
        n_frames: 0,
        parts: Vec::new(),
        passes: Vec::new(),
        wall_ms: None,
        frames_per_s: 0.0,
    };
    let report = report.with_times(&times);
    args.files.write(&report, || report.chart().svg())?;
    print(&text(&report))
}

/// The report as text that ends with a line break.
fn text(report: &Report) -> String {
    let kept = if report.keeps_instances { "kept apart" } else { "stored as one" };
    let Report { scene, n_triangles, n_moved, n_deformed, .. } = report;
    let mut text = format!("{scene}: {n_triangles} triangles, meshes {kept}\n");
    text += &format!("in a frame, at most {n_moved} instances move and {n_deformed} meshes are deformed\n");
    text += &format!("{}x{} by {} on {}", report.width, report.height, report.integrator, report.device);
    text += &report.driver.as_ref().map_or_else(String::new, |driver| format!(", {driver}"));
    text += &format!(", {} frames, {} a second of the animation\n\n", report.n_frames, report.fps);
    let wall = Phase { name: "wall clock", ms: report.wall_ms };
    text +=
        &table(["part", "median ms", "min", "max"], &report.parts.iter().chain([&wall]).map(cells).collect::<Vec<_>>());
    text += "\n";
    text += &table(["pass", "median ms", "min", "max"], &report.passes.iter().map(cells).collect::<Vec<_>>());
    text += &format!("\n{:.1} frames a second\n", report.frames_per_s);
    text
}

fn cells(part: &Phase) -> [String; 4] {
    let ms = |of: fn(&kdray::bench::Spread) -> f64| decimal(part.ms.as_ref().map(of), 3);
    [part.name.to_owned(), ms(|it| it.median), ms(|it| it.min), ms(|it| it.max)]
}
