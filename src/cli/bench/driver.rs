//! `kdray bench driver`: compares kdray's search algorithms with the driver's own ray tracing.

use kdray::{
    accel::kdtree::BuildOptions,
    bench::{
        difference::T_TOLERANCE,
        driver::{
            DeviceStage,
            builds::Builds,
            changing::{Ahead, ChangingFrames, MRAYS, changing_frames},
            report::{RasterResult, Report, SetResult, Timing},
        },
        rays::{RaySetKind, ray_sets},
        stage::Stage,
    },
    engine::choices::{Processor, TreeKind},
    gpu::{ContextOptions, Device, GpuError},
    world::FlatScene,
};

use super::args::DriverArgs;
use crate::cli::{
    error::CliError,
    print,
    progress::Progress,
    table::{decimal, table},
};

/// Opens the device, which must have ray tracing. Then loads the mesh, makes the rays, and lets kdray and the driver
/// trace each set of rays.
pub fn run(args: &DriverArgs) -> Result<(), CliError> {
    args.files.check(&[&args.mesh], &args.load.options())?;
    let device = Device::with_ray_tracing(&ContextOptions::new(args.device.clone(), false))?;
    let progress = Progress::new(false, 8);
    let opened = progress.read(&args.mesh, &args.load.rays())?;
    let scene = FlatScene::new(&opened.scene).map_err(GpuError::from)?;
    let build_options = TreeKind::Best.options(Processor::of_device(device.info()));
    let building = format!("building the kd-tree of {} triangles", scene.triangles.len());
    let (stage, _) = progress.stage(&building, || stage(args, scene, &build_options));
    let (arena, _) = progress.stage("letting the driver build its tree", || DeviceStage::new(&device, &stage));
    let mut arena = arena?;
    let (sets, _) = progress.stage("making rays", || ray_sets(&stage));

    let mut report = empty_report(args, &stage, &device, arena.builds().clone());
    for set in &sets {
        let casting = format!("casting {} {} rays", set.rays.len(), set.kind.name());
        let (result, _) = progress.stage(&casting, || arena.measure(set, args.repeat));
        let (set, rasters) = result?;
        report.sets.push(set);
        report.raster.extend(rasters);
    }
    drop(progress);
    report.changing = changing_frames(&report.builds, &report.sets);
    args.files.write(&report, || report.chart().svg())?;
    print(&text(&report))?;
    check_hits(&report)
}

fn stage(args: &DriverArgs, scene: FlatScene, build_options: &BuildOptions) -> Stage {
    let size = (args.size.width, args.size.height);
    let make = if args.no_room { Stage::open } else { Stage::in_room };
    make(scene, size, build_options)
}

fn empty_report(args: &DriverArgs, stage: &Stage, device: &Device, builds: Builds) -> Report {
    let n_triangles = stage.scene().triangles.len();
    Report {
        suite: "driver",
        device: device.info().name.clone(),
        driver: device.info().driver.clone(),
        scene: stage.scene().name.clone(),
        room: !args.no_room,
        width: args.size.width,
        height: args.size.height,
        n_triangles,
        tree: stage.tree_statistics(),
        n_times: args.repeat,
        t_tolerance: T_TOLERANCE,
        builds,
        sets: Vec::new(),
        raster: Vec::new(),
        changing: Vec::new(),
    }
}

/// The report as text that ends with a line break.
fn text(report: &Report) -> String {
    let room = if report.room { " in a closed room" } else { "" };
    let mut text = format!("{}: {} triangles{room}\n", report.scene, report.n_triangles);
    text += &format!("{}x{} on {}, {}", report.width, report.height, report.device, report.driver);
    text += &format!(", medians of {}\n\n", report.n_times);
    let mut rows = Vec::new();
    for set in &report.sets {
        rows.push(cells(set, "driver", &set.driver, set.driver.mrays_per_s.map(|_| 1.0), None));
        rows.extend(
            set.kdray
                .iter()
                .map(|rival| cells(set, &rival.traversal, &rival.timing, rival.ratio, Some(rival.apart.n_differing()))),
        );
        let rasters = if set.rays == RaySetKind::Primary { &report.raster[..] } else { &[] };
        rows.extend(rasters.iter().map(|raster| cells(set, &raster.primary, &raster.timing, raster.ratio, None)));
    }
    text += &table(["rays", "number", "hits", "by", "ms", "Mrays/s", "ratio", "differing"], &rows);
    text +=
        "\nRatio: speed in speeds of the driver. Differing from the driver's: a hit for a miss, a miss for a hit, or\n";
    text += &format!("another distance by more than {:.1e} of it.\n", report.t_tolerance);
    text.extend(report.raster.iter().map(passes_text));
    text += &builds_text(&report.builds);
    text + &changing_text(&report.changing)
}

/// A table of the frames of a changing scene; nothing without timestamps.
fn changing_text(frames: &[ChangingFrames]) -> String {
    if frames.is_empty() {
        return String::new();
    }
    let row = |frame: &ChangingFrames| {
        let [a, b, c, d] = frame.ms.map(|ms| format!("{ms:.2}"));
        let ahead = match frame.ahead {
            None => "-".to_owned(),
            Some(Ahead::Always) => "always".to_owned(),
            Some(Ahead::Never) => "never".to_owned(),
            Some(Ahead::From(mrays)) => format!("from {mrays:.1} M"),
            Some(Ahead::UpTo(mrays)) => format!("to {mrays:.1} M"),
        };
        [frame.rays.name().to_owned(), frame.by.clone(), format!("{:.2}", frame.build_ms), a, b, c, d, ahead]
    };
    let [a, b, c, d] = MRAYS.map(|mrays| format!("{mrays} M"));
    let rows: Vec<_> = frames.iter().map(row).collect();
    "\nA frame in which all triangles have moved, ms: the build of a structure, and so many rays. Ahead: for which\n\
     numbers of rays it takes less time than the driver's structure, rebuilt.\n\n"
        .to_owned()
        + &table(["rays", "by", "build", &a, &b, &c, &d, "ahead"], &rows)
}

fn cells(set: &SetResult, by: &str, timing: &Timing, ratio: Option<f64>, n_differing: Option<u64>) -> [String; 8] {
    [
        set.rays.name().to_owned(),
        set.n_rays.to_string(),
        set.n_hits.to_string(),
        by.to_owned(),
        decimal(timing.ms.map(|ms| ms.median), 3),
        decimal(timing.mrays_per_s.map(|rate| rate.median), 1),
        decimal(ratio, 2),
        n_differing.map_or_else(|| "-".to_owned(), |n| n.to_string()),
    ]
}

fn passes_text(raster: &RasterResult) -> String {
    let passes = raster.passes.iter().map(|pass| format!("{} {:.3} ms", pass.name, pass.ms.median));
    let passes: Vec<_> = passes.collect();
    if passes.is_empty() { String::new() } else { format!("`{}`: {}.\n", raster.primary, passes.join(", ")) }
}

fn builds_text(builds: &Builds) -> String {
    let Builds { tree_ms, n_threads, bvh_ms, n_bvh_builds, on_device, .. } = builds;
    let bvh_ms = decimal(bvh_ms.map(|ms| ms.median), 3);
    let mut text = format!(
        "Built: the driver's tree in {bvh_ms} ms of the GPU (median of {n_bvh_builds}), the kd-tree in {tree_ms:.0} ms \
         of {n_threads} CPU threads"
    );
    for built in on_device {
        text += &format!(", `{}` in {} ms of the GPU", built.accel, decimal(built.ms.map(|ms| ms.median), 3));
    }
    text + ".\n"
}

/// Fails if more hits of an algorithm differ from the driver's than rounding explains: the speed of wrong hits has no
/// meaning.
fn check_hits(report: &Report) -> Result<(), CliError> {
    let Some((set, rival)) = report.first_wrong() else { return Ok(()) };
    Err(CliError::WrongHits(format!(
        "{} of {} {} rays have other hits with `{}` than with the driver",
        rival.apart.n_differing(),
        set.n_rays,
        set.rays.name(),
        rival.traversal
    )))
}

#[cfg(test)]
mod tests {
    use kdray::{
        accel::kdtree::KdTree,
        bench::{
            Spread,
            driver::{builds::DeviceBuilds, contest::ContenderResult, report::PassSpread},
        },
        cast::Hit,
    };

    use super::*;

    /// Returns a report of four rays of each kind. The driver takes 4, 8 and 12 ms, `mask` half of that and `stack`
    /// the same. `stack` has `n_wrong` wrong hits among its primary rays.
    fn report(n_wrong: usize) -> Report {
        let trial = |name: &str, ms: f64, n_wrong: usize| ContenderResult {
            name: name.to_owned(),
            ms: Spread::of([ms, 2.0 * ms, 3.0 * ms]),
            hits: (0..4)
                .map(|i| Hit { t: if i < n_wrong { 2.0 } else { 1.0 }, triangle_ix: 0, u: 0.0, v: 0.0 })
                .collect(),
        };
        let set = |kind: RaySetKind| {
            let n_wrong = if kind == RaySetKind::Primary { n_wrong } else { 0 };
            let grid = trial("grid", 1.0, 0);
            SetResult::new(kind, &[trial("driver", 4.0, 0), trial("mask", 2.0, 0), trial("stack", 4.0, n_wrong), grid])
        };
        let sets = RaySetKind::ALL.map(set);
        let ms = |ms| Spread::of([ms]);
        let builds = Builds {
            tree_ms: 1234.5,
            n_threads: 2,
            bvh_ms: ms(1.5),
            refit_ms: ms(0.25),
            n_bvh_builds: 5,
            on_device: vec![DeviceBuilds { accel: "grid".to_owned(), ms: ms(0.5), stages: Vec::new() }],
        };
        let pass = |name, pass_ms| PassSpread { name, ms: ms(pass_ms).unwrap() };
        Report {
            suite: "driver",
            device: "d < e".to_owned(),
            driver: "v 1".to_owned(),
            scene: "s".to_owned(),
            room: true,
            width: 2,
            height: 2,
            n_triangles: 14,
            tree: KdTree::build(&[], &BuildOptions::default()).statistics(0, &BuildOptions::default()),
            n_times: 3,
            t_tolerance: T_TOLERANCE,
            changing: changing_frames(&builds, &sets),
            builds,
            raster: vec![
                RasterResult::new(
                    "raster".to_owned(),
                    vec![pass("visibility", 0.5), pass("primary_hit", 1.5)],
                    ms(2.0),
                    &sets[0],
                ),
                RasterResult::new("compute".to_owned(), Vec::new(), ms(1.0), &sets[0]),
            ],
            sets: sets.to_vec(),
        }
    }

    #[test]
    fn the_table_has_a_row_for_each_tracer_of_each_set() {
        let text = text(&report(0));
        let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split_whitespace().collect()).collect();
        assert!(rows.contains(&vec!["primary", "4", "4", "driver", "8.000", "0.0", "1.00", "-"]), "{text}");
        assert!(rows.contains(&vec!["primary", "4", "4", "raster", "2.000", "0.0", "4.00", "-"]), "{text}");
        assert!(rows.contains(&vec!["diffuse", "4", "4", "mask", "4.000", "0.0", "2.00", "0"]), "{text}");
        assert_eq!(rows.iter().filter(|row| row.get(1) == Some(&"4")).count(), 4 * 4 + 2, "{text}");
        assert!(
            text.contains(
                "in 1.500 ms of the GPU (median of 5), the kd-tree in 1234 ms of 2 CPU threads, `grid` in 0.500 ms"
            ),
            "{text}"
        );
        // The grid is built in 0.5 ms for the driver's 1.5, and takes 0.5 s a million rays for the driver's 2.
        let grid = ["diffuse", "grid", "0.50", "500000.50", "2500000.50", "10000000.50", "25000000.50", "always"];
        assert!(rows.contains(&grid.to_vec()), "{text}");
        assert!(text.contains("`raster`: visibility 0.500 ms, primary_hit 1.500 ms."), "{text}");
    }

    #[test]
    fn json_and_chart_hold_what_the_table_holds() {
        let report = report(1);
        let json = serde_json::to_value(&report).unwrap();
        assert_eq!((&json["suite"], json["sets"].as_array().unwrap().len()), (&"driver".into(), 4));
        let stack = &json["sets"][0]["kdray"][1];
        assert_eq!(
            (&stack["traversal"], &stack["ratio"], &stack["n_distance"]),
            (&"stack".into(), &1.0.into(), &1.into())
        );
        assert_eq!(stack["ms"]["median"], 8.0);
        assert_eq!((&json["raster"][0]["ratio"], &json["builds"]["bvh_ms"]["median"]), (&4.0.into(), &1.5.into()));
        let chart = report.chart();
        let names: Vec<_> = chart.series.iter().map(|series| series.name.as_str()).collect();
        assert_eq!(names, ["driver", "kdray, mask", "kdray, stack", "kdray, grid", "kdray, raster", "kdray, compute"]);
        assert_eq!(chart.series[4].values, [Some(0.002), None, None, None]);
        assert!(chart.svg().contains("d &lt; e"));
    }

    #[test]
    fn wrong_hits_fail() {
        assert!(check_hits(&report(0)).is_ok());
        let error = check_hits(&report(1)).unwrap_err();
        assert_eq!(error.to_string(), "1 of 4 primary rays have other hits with `stack` than with the driver");
        assert_eq!(error.exit_code(), 4);
    }
}
