//! `kdray doctor`: checks whether this machine can render, and whether it can render a scene.
//!
//! ```text
//! host       the machine: operating system, threads, memory
//! facts      signs of GPUs, manifests of drivers
//! quota      the quota of CPU time
//! probe      asks a driver for its devices in a process of its own
//! causes     from the facts to why there is no GPU
//! check      draws the sample picture on a processor and compares it with the CPU's
//! examine    finds the memory that a picture of the user's scene takes on a processor, and draws a part of it
//! findings   what was found, as text and as JSON
//! ```
//!
//! A processor is a Vulkan device or the CPU.

mod causes;
mod check;
mod examine;
mod facts;
mod findings;
mod host;
pub mod probe;
mod quota;

use std::path::Path;

use kdray::{
    engine::{self, Engine, Loaded, Opened},
    gpu::{self, ContextOptions, Device, DeviceInfo, DeviceSelector},
    scene::pack_hash,
    util::progress::Work,
};

use self::{
    causes::causes,
    check::Sample,
    examine::ScenePicture,
    facts::Facts,
    findings::{Findings, Problem, ProcessorFindings, SceneFindings, Verdict},
    host::Host,
};
use super::{
    args::DoctorArgs, error::CliError, load_args::LoadArgs, print, print_raw, progress::Progress, report::json,
};

/// Examines the machine and, if the user names one, a scene. Prints what was found even if that is an error.
pub fn run(args: &DoctorArgs) -> Result<(), CliError> {
    let progress = Progress::new(false, 4);
    let (facts, _) = progress.stage("asking the Vulkan drivers", Facts::of_machine);
    let devices = devices(&facts);
    let (mut processors, _) = progress.stage("checking the CPU and the Vulkan devices", || check_all(&devices));
    let (mut scene, mut error) = (None, None);
    if let Some(path) = &args.scene {
        let examined = examine_scene(path, &args.load, &mut processors, &progress);
        scene = Some(Verdict(examined.map_err(|refused| {
            let problem = Problem::of_scene(&refused.to_string());
            error = Some(refused);
            problem
        })));
    }
    drop(progress);
    let host = Host::of_machine();
    let findings = Findings {
        vulkan: Verdict(devices.map(|_| ())),
        causes: causes(&facts, host.cpu_threads),
        facts,
        host,
        processors: processors.into_iter().map(|processor| processor.findings).collect(),
        scene,
    };
    match args.json {
        true => print_raw(&json(&findings))?,
        false => print(&findings.text())?,
    }
    match error {
        Some(error) => Err(error),
        None if findings.can_render() => Ok(()),
        None => Err(CliError::NoProcessor(findings.refusal())),
    }
}

/// Returns the Vulkan devices. Drivers that end the process which loads them are not loaded.
fn devices(facts: &Facts) -> Result<Vec<DeviceInfo>, Problem> {
    match facts.end_of_all() {
        Some(how) => Err(Problem::of_ended_drivers(&how)),
        None => gpu::devices().map_err(|error| Problem::of_vulkan(&error)),
    }
}

/// A processor that was found.
struct Processor {
    /// The engine that draws on the processor. `None` if the processor cannot be used.
    engine: Option<Engine>,
    findings: ProcessorFindings,
}

/// Checks the CPU and all devices with the sample picture. The CPU comes last.
fn check_all(devices: &Result<Vec<DeviceInfo>, Problem>) -> Vec<Processor> {
    let sample = Sample::on_cpu();
    let mut processors: Vec<_> = (devices.iter().flatten()).map(|device| check_device(&sample, device)).collect();
    processors.push(Processor {
        engine: Some(Engine::on_cpu()),
        findings: ProcessorFindings::new(None, sample.check_of_cpu()),
    });
    processors
}

/// Opens a device, and checks it with the sample picture.
fn check_device(sample: &Sample, device: &DeviceInfo) -> Processor {
    let opened = match device.missing.is_empty() {
        true => Device::open(&ContextOptions::new(Some(DeviceSelector::Index(device.index)), false))
            .map_err(|error| Problem::of_device(&error)),
        false => Err(Problem::of_lacking(device)),
    };
    let engine = opened.map(Engine::on_device);
    let checked = match &engine {
        Ok(engine) => sample.check(engine),
        Err(problem) => Err(problem.clone()),
    };
    Processor { engine: engine.ok(), findings: ProcessorFindings::new(Some(device.clone()), checked) }
}

/// Loads the scene, builds its structure, and examines it on each processor that has passed its check.
///
/// # Errors
/// The scene cannot be loaded, or the system has too little memory for its structure.
fn examine_scene(
    path: &Path,
    load_args: &LoadArgs,
    processors: &mut [Processor],
    progress: &Progress,
) -> Result<SceneFindings, CliError> {
    let loading = format!("loading {}", path.display());
    let observer = progress.observer(&loading, &[Work::Reading, Work::Images]);
    let (opened, _) = progress.stage(&loading, || Opened::read(path, &load_args.scene(observer)));
    let opened = opened?;
    let pack_hash = pack_hash(path)?;
    // The first processor that has passed its check may build the structure.
    let engine = processors.iter().find(|it| it.findings.is_ok()).and_then(|it| it.engine.clone());
    let builder = engine.unwrap_or_else(Engine::on_cpu).builder();
    let n_samples = opened.scene.defaults.for_integrator(None).samples;
    let building = builder.describe(&opened.scene);
    // Whether the picture fits into the memory is a question of each processor.
    let work = engine::Work::Window { n_samples: Some(1) };
    let (loaded, _) = progress.stage(&building, || builder.build(opened, &work));
    let Loaded { world, options, workload, load_ms, build_ms, .. } = loaded?;
    let picture = ScenePicture { options, n_samples, workload };
    for processor in processors.iter_mut().filter(|it| it.findings.is_ok()) {
        let engine = processor.engine.as_ref().expect("a processor that has passed its check has an engine");
        processor.findings.examine(picture.examine(engine, &world));
    }
    let (scene, options) = (world.scene(), &picture.options);
    Ok(SceneFindings {
        name: scene.name.clone(),
        hash: scene.hash(),
        pack_hash,
        triangles: scene.n_triangles(),
        structure_bytes: world.statistics().bytes(),
        width: options.width,
        height: options.height,
        load_ms,
        build_ms,
    })
}
