//! `kdray render`: scene file to pictures.

mod draw;
mod files;

use std::time::{Duration, Instant};

use kdray::{
    frame::{Profile, RenderOptions},
    gpu::{Context, ContextOptions},
    kdtree::KdTree,
    output,
    scene::{Camera, CameraPath, Scene},
};
use tracing::info_span;

use self::{
    draw::Drawer,
    files::{Files, check_outputs, default_output, numbered},
};
use super::{
    args::{Frames, RenderArgs},
    complain,
    error::CliError,
    open_device, print,
    progress::Progress,
    report::{Report, Spread},
    spans::Spans,
    trace::trace_json,
};

/// Loads, builds, renders, writes and reports. What can be refused is refused before the work that it would waste.
pub fn run(args: &RenderArgs) -> Result<(), CliError> {
    args.check()?;
    check_outputs(args)?;
    set_threads(args.threads)?;

    let (begun_at, spans) = (Instant::now(), Spans::default());
    let progress = Progress::with_spans(args.quiet, 3, args.trace.is_some().then_some(&spans));
    let loading = format!("loading {}", args.scene.display());
    let (scene, load_ms) = progress.stage(&loading, || info_span!("load scene").in_scope(|| Scene::load(&args.scene)));
    let scene = scene?;
    let views = views(args, &scene)?;
    for view in &views {
        view.files.check()?;
    }
    let options = args.options(&scene)?;
    let device = ContextOptions { device: args.device.clone(), validate: args.validate };
    let opening = || info_span!("create device").in_scope(|| open_device(&device, &progress));
    let context = if args.cpu { None } else { Some(opening()?) };

    let n_triangles = scene.triangles.len();
    let size = (options.width, options.height);
    let options = args.picture.ways().suited(&options, context.as_deref(), n_triangles, size);
    let n_rays = most_rays(args, &options, scene.lights.len(), views.len());
    let build_options = args.build.options(context.as_deref(), n_triangles, n_rays);
    let building = format!("building the kd-tree of {n_triangles} triangles");
    let build = || KdTree::build(&scene.triangles, &build_options);
    let (tree, build_ms) = progress.stage(&building, || info_span!("build tree").in_scope(build));
    let crop = options.crop_or_whole();
    let rendering = format!("rendering {}x{}", crop.width(), crop.height());
    let (drawn, _) = progress.stage(&rendering, || {
        let begin = Instant::now();
        let drawer = Drawer::new(context.as_ref(), &scene, &tree, &options)?;
        draw_and_write(args, drawer, &views, (&progress, &rendering), begin)
    });
    let (profiles, render_ms) = drawn?;
    drop(progress);

    let repeated = Spread::of(&profiles);
    let profile = median(profiles);
    if let Some(path) = &args.trace {
        output::write(path, &trace_json(begun_at, &spans.sorted(), &profile))?;
    }
    let report = Report {
        scene: scene.name,
        pictures: views.iter().map(|view| view.files.picture.clone()).collect(),
        extra_files: views.iter().flat_map(|view| view.files.beside()).cloned().collect(),
        options: (&options).into(),
        samples: args.spp,
        triangles: n_triangles,
        tree: tree.statistics(n_triangles, &build_options),
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
    context.map_or(Ok(()), |context| report_validation(&context))
}

/// Rays of all frames, if every pixel's ray hits and is reflected once.
fn most_rays(args: &RenderArgs, options: &RenderOptions, n_lights: usize, n_views: usize) -> u64 {
    let crop = options.crop_or_whole();
    let n_pixels = u64::from(crop.width()) * u64::from(crop.height());
    let rays_a_sample = u64::from(options.max_depth.min(2)) * (1 + n_lights as u64);
    let n_frames = n_views as u64 * u64::from(args.repeat);
    [u64::from(args.spp), rays_a_sample, n_frames].into_iter().fold(n_pixels, u64::saturating_mul)
}

/// A camera, and where what it sees is written.
struct View {
    camera: Camera,
    files: Files,
}

/// The scene's own view, or one a frame of the path.
fn views(args: &RenderArgs, scene: &Scene) -> Result<Vec<View>, CliError> {
    let output = args.output.clone().unwrap_or_else(|| default_output(&scene.name, args.path.is_some()));
    let Some(path_file) = &args.path else {
        return Ok(vec![View { camera: scene.camera, files: Files::of(output, &args.aov) }]);
    };
    let path = CameraPath::load(path_file)?;
    let Frames { first, last } =
        args.frames.unwrap_or(Frames { first: path.begin().ceil() as u32, last: path.end().floor() as u32 });
    if first > last {
        return Err(CliError::Usage(format!("{}: no whole frame lies between its keyframes", path_file.display())));
    }
    let view = |frame| {
        let camera = path.camera_at(f64::from(frame)).ok_or_else(|| {
            let file = path_file.display();
            CliError::Usage(format!("{file}: at frame {frame}, eye, target and up span no picture"))
        })?;
        Ok(View { camera, files: Files::of(numbered(&output, frame)?, &args.aov) })
    };
    (first..=last).map(view).collect()
}

/// Draws all views, as often as asked, and writes each. Gives the profiles, and how many milliseconds it took since
/// `begin` to have the pictures in memory.
fn draw_and_write(
    args: &RenderArgs,
    mut drawer: Drawer,
    views: &[View],
    (progress, message): (&Progress, &str),
    begin: Instant,
) -> Result<(Vec<Profile>, f64), CliError> {
    let mut steps = progress.steps(message, views.len() as u32 * args.spp * u32::from(args.repeat));
    let (mut profiles, mut drawing, mut last) = (Vec::new(), Duration::ZERO, begin);
    for view in views {
        let mut features = Vec::new();
        for _ in 0..args.repeat {
            let drawn = drawer.draw(&view.camera, args.spp, &mut steps)?;
            profiles.push(drawn.profile);
            features = drawn.features;
        }
        let picture = drawer.picture()?;
        drawing += last.elapsed();
        view.files.write(&args.aov, &picture, &features)?;
        last = Instant::now();
    }
    Ok((profiles, drawing.as_secs_f64() * 1e3))
}

/// Sizes the pool for everything that follows.
pub(super) fn set_threads(n_threads: Option<u16>) -> Result<(), CliError> {
    let Some(n_threads) = n_threads else { return Ok(()) };
    (rayon::ThreadPoolBuilder::new().num_threads(n_threads.into()).build_global())
        .map_err(|error| CliError::Usage(format!("--threads {n_threads}: {error}")))
}

/// The frame of median time; the last one where the device has no timestamps.
fn median(mut profiles: Vec<Profile>) -> Profile {
    profiles.sort_by(|a, b| a.frame_ms.partial_cmp(&b.frame_ms).expect("times are numbers"));
    profiles.swap_remove(profiles.len() / 2)
}

/// Lists what the validation layer said; anything is a failure.
pub(super) fn report_validation(context: &Context) -> Result<(), CliError> {
    let messages = context.validation_messages();
    for message in &messages {
        complain("validation", message);
    }
    if messages.is_empty() { Ok(()) } else { Err(CliError::Validation(messages.len())) }
}
