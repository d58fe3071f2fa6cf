//! `kdray bench traversal`: compares all search algorithms for kd-trees and grids.

use kdray::{
    accel::{Search, kdtree::BuildOptions},
    bench::{
        rays::ray_sets,
        stage::Stage,
        traversal::{InstancesReport, Report, SetResult, StepsARay, Tracers, VariantResult},
    },
    engine::choices::TreeKind,
    gpu::{ContextOptions, Device, GpuError},
    world::{FlatScene, World},
};

use super::args::TraversalArgs;
use super::processor;
use crate::cli::{
    device_args::open_device,
    error::CliError,
    print,
    progress::Progress,
    table::{decimal, table},
};

/// Loads the mesh, makes the rays and casts each set of rays with each algorithm.
pub fn run(args: &TraversalArgs) -> Result<(), CliError> {
    args.files.check(&[&args.mesh], &args.load.options())?;
    let variants = variants(&args.variants, args.cpu)?;
    let progress = Progress::new(false, 7);
    let scene = progress.read(&args.mesh, &args.load.rays())?.scene;
    let kept = args.instances.then(|| FlatScene::with_instances(&scene)).transpose().map_err(GpuError::from)?;
    let flat = FlatScene::new(&scene).map_err(GpuError::from)?;

    let options = ContextOptions::new(args.device.clone(), false);
    let device = if args.cpu { None } else { Some(open_device(&options, &progress)?) };
    let build_options = TreeKind::Best.options(processor(device.as_ref()));
    let building = format!("building the kd-tree of {} triangles", flat.triangles.len());
    let (stage, _) = progress.stage(&building, || stage(args, flat, &build_options));
    let (sets, _) = progress.stage("making rays", || ray_sets(&stage));

    let kept = kept.map(|kept| World::of_flat(kept, &build_options)).transpose().map_err(GpuError::from)?;
    let mut tracers = Tracers::new(device.as_ref(), &stage, &variants)?;
    let mut report = empty_report(args, &stage, device.as_ref());
    if let Some(kept) = &kept {
        tracers = tracers.with_instances(device.as_ref(), kept)?;
        let measured = InstancesReport::measure(&scene, kept, args.repeat).map_err(GpuError::from)?;
        report.instances = Some(measured);
    }
    for set in &sets {
        let casting = format!("casting {} {} rays", set.rays.len(), set.kind.name());
        let (result, _) = progress.stage(&casting, || tracers.measure(set, args.repeat));
        report.sets.push(result?);
    }
    drop(progress);
    args.files.write(&report, || report.chart().svg())?;
    print(&text(&report))?;
    check_hits(&report)
}

/// Returns the user's variants, each once. Without any, returns all but brute force.
fn variants(asked: &[Search], on_cpu: bool) -> Result<Vec<Search>, CliError> {
    if asked.is_empty() {
        return Ok(Search::all(on_cpu));
    }
    if asked.contains(&Search::Wide) && !on_cpu {
        return CliError::refuse(format!("--variants {}: only the CPU has it, with --cpu", Search::Wide));
    }
    let mut variants = Vec::new();
    for variant in asked {
        if !variants.contains(variant) {
            variants.push(*variant);
        }
    }
    Ok(variants)
}

fn stage(args: &TraversalArgs, scene: FlatScene, build_options: &BuildOptions) -> Stage {
    let size = (args.size.width, args.size.height);
    let make = if args.no_room { Stage::open } else { Stage::in_room };
    make(scene, size, build_options)
}

fn empty_report(args: &TraversalArgs, stage: &Stage, device: Option<&Device>) -> Report {
    let n_triangles = stage.scene().triangles.len();
    let info = device.map(Device::info);
    Report {
        suite: "traversal",
        device: info.map_or_else(|| format!("CPU, {} threads", rayon::current_num_threads()), |info| info.name.clone()),
        driver: info.map(|info| info.driver.clone()),
        scene: stage.scene().name.clone(),
        room: !args.no_room,
        width: args.size.width,
        height: args.size.height,
        n_triangles,
        tree: stage.tree_statistics(),
        instances: None,
        n_times: args.repeat,
        sets: Vec::new(),
    }
}

/// The report as text that ends with a line break.
fn text(report: &Report) -> String {
    let room = if report.room { " in a closed room" } else { "" };
    let mut text = format!("{}: {} triangles{room}", report.scene, report.n_triangles);
    text += &format!("; kd-tree: {} nodes, depth {}\n", report.tree.n_nodes, report.tree.depth);
    if let Some(kept) = &report.instances {
        text += &format!(
            "As {} instances: {} triangles, kd-trees {:.1} MB beside {:.1} MB; moving all takes {:.2} ms\n",
            kept.n_instances,
            kept.n_stored,
            kept.bytes as f64 / 1e6,
            report.tree.bytes as f64 / 1e6,
            kept.move_ms.median
        );
    }
    text += &format!("{}x{} on {}", report.width, report.height, report.device);
    text += &report.driver.as_ref().map_or_else(String::new, |driver| format!(", {driver}"));
    text += &format!(", medians of {}\n\n", report.n_times);
    let rows: Vec<_> =
        report.sets.iter().flat_map(|set| set.variants.iter().map(|variant| cells(set, variant))).collect();
    let header = [
        "rays",
        "number",
        "hits",
        "variant",
        "Mrays/s",
        "nodes",
        "links",
        "boxes",
        "tests",
        "registers",
        "differing",
        "grazing",
    ];
    text += &table(header, &rows);
    text += "\nNodes and slabs, or cells; links to parents or neighbours, boxes, triangle tests: the mean of a ray, \
             counted on the CPU.\nDiffering: from the CPU's hits.\n";
    if report.sets.iter().flat_map(|set| &set.variants).any(|variant| variant.ms.is_none()) {
        text += "This device has no timestamps: speeds are unknown.\n";
    }
    text
}

fn cells(set: &SetResult, variant: &VariantResult) -> [String; 12] {
    let steps = |of: fn(&StepsARay) -> f64| decimal(variant.steps_a_ray.as_ref().map(of), 1);
    [
        set.rays.name().to_owned(),
        set.n_rays.to_string(),
        set.n_hits.to_string(),
        variant.traversal.clone(),
        decimal(variant.mrays_per_s.map(|rate| rate.median), 2),
        steps(|steps| steps.nodes),
        steps(|steps| steps.links),
        steps(|steps| steps.boxes),
        steps(|steps| steps.triangles),
        variant.registers().map_or_else(|| "-".to_owned(), |registers| registers.to_string()),
        variant.difference.n_differing.to_string(),
        variant.difference.n_grazing.to_string(),
    ]
}

/// Fails if more hits differ from the CPU's than rounding explains: the speed of wrong hits has no meaning.
fn check_hits(report: &Report) -> Result<(), CliError> {
    let Some((set, variant)) = report.first_wrong() else { return Ok(()) };
    Err(CliError::WrongHits(format!(
        "{} of {} {} rays have other hits with `{}` than on the CPU",
        variant.difference.n_differing,
        set.n_rays,
        set.rays.name(),
        variant.traversal
    )))
}
