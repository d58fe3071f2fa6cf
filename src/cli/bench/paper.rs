//! `kdray bench paper`: the table of the paper, measured on this machine.

use std::path::Path;

use kdray::{
    bench::{
        Spread,
        paper::{Report, Reported, Row, SCENES, SIZES, draw_on_cpu, draw_on_gpu, options},
    },
    engine::{
        Builder, LoadError, LoadRequest, Opened, Work,
        choices::{BuildPolicy, Processor, Request, traversal_by_rule},
    },
    frame::RenderOptions,
    gpu::{ContextOptions, Device},
    scene::LoadOptions,
    world::World,
};

use super::args::PaperArgs;
use crate::cli::{
    device_args::open_device,
    error::CliError,
    print,
    progress::Progress,
    table::{decimal, table},
};

/// Draws each scene at each size on the GPU and the CPU, and reports the times.
pub fn run(args: &PaperArgs) -> Result<(), CliError> {
    let scenes = SCENES.map(|name| args.scenes.join(name).with_extension("toml"));
    args.files.check(&scenes.each_ref().map(|scene| scene.as_path()), &LoadOptions::default())?;
    let sizes: Vec<_> = match &args.size[..] {
        [] => SIZES.to_vec(),
        asked => asked.iter().map(|size| (size.width, size.height)).collect(),
    };
    let progress = Progress::new(false, (SCENES.len() * (1 + sizes.len())) as u64);
    let device = open_device(&ContextOptions::new(args.device.clone(), false), &progress)?;
    let traversal = args.traversal.unwrap_or_else(|| traversal_by_rule(Processor::of_device(device.info())));
    let mut report = Report {
        suite: "paper",
        device: device.info().name.clone(),
        driver: device.info().driver.clone(),
        traversal: traversal.to_string(),
        n_gpu_frames: args.repeat,
        n_cpu_frames: if args.no_cpu { 0 } else { args.cpu_repeat },
        rows: Vec::new(),
    };
    // CPU and device use the same tree. If the CPU draws, the tree has slabs, even if the device does not read them.
    let processor = if args.no_cpu { Processor::of_device(device.info()) } else { Processor::Cpu };
    for (name, path) in SCENES.into_iter().zip(&scenes) {
        let (loaded, _) = progress.stage(&format!("loading {}", path.display()), || load(path, processor));
        let world = loaded?;
        for &size in &sizes {
            let drawing = format!("drawing {name}, {}x{}", size.0, size.1);
            let (row, _) = progress
                .stage(&drawing, || measure(&device, &world, &options(world.scene(), size, traversal), &report));
            report.rows.push(row?);
        }
    }
    drop(progress);
    args.files.write(&report, || report.chart().svg())?;
    print(&text(&report))
}

fn load(path: &Path, processor: Processor) -> Result<World, CliError> {
    let choices = Request { build: BuildPolicy::Best, ..Request::default() };
    let opened = Opened::read(path, &LoadRequest::rays(0)).map_err(LoadError::from)?;
    Ok(Builder::new(processor, choices).build(opened, &Work::Rays(0))?.world)
}

fn measure(device: &Device, world: &World, options: &RenderOptions, report: &Report) -> Result<Row, CliError> {
    let on_gpu = draw_on_gpu(device, world, options, report.n_gpu_frames)?;
    let on_cpu = draw_on_cpu(world, options, report.n_cpu_frames)
        .map_err(|error| CliError::Usage(format!("cannot start a thread: {error}")))?;
    Ok(Row::new(world.scene(), options, &on_gpu, &on_cpu))
}

/// The report as text that ends with a line break.
fn text(report: &Report) -> String {
    let header = ["scene", "size", "rays", "Mrays/s", "GPU ms", "CPU ms", "speed-up", "paper's GPU", "CPU", "speed-up"];
    let rows: Vec<_> = report.rows.iter().map(cells).collect();
    let mut text = format!("{}, {}\n\n", report.device, report.driver);
    text += &table(header, &rows);
    text += &format!(
        "\nMedians; frames on the GPU: {}, on one CPU thread: {}.\n",
        report.n_gpu_frames, report.n_cpu_frames
    );
    text += "The paper's times: a GTX 285 and one CPU thread, scenes of the same triangle counts.\n";
    if report.rows.iter().any(|row| row.gpu_ms.is_none()) {
        text += "This device has no timestamps: its times are unknown.\n";
    }
    text
}

fn cells(row: &Row) -> [String; 10] {
    let median = |spread: Option<Spread>, decimals| decimal(spread.map(|spread| spread.median), decimals);
    let paper = |value: fn(&Reported) -> f64, decimals| decimal(row.paper.as_ref().map(value), decimals);
    [
        row.scene.clone(),
        format!("{}x{}", row.width, row.height),
        row.n_rays().to_string(),
        median(row.mrays_per_s, 1),
        median(row.gpu_ms, 3),
        median(row.cpu_ms, 0),
        decimal(row.speedup, 1),
        paper(|paper| paper.gpu_ms, 0),
        paper(|paper| paper.cpu_ms, 0),
        paper(|paper| paper.speedup, 1),
    ]
}
