//! `kdray bench size`: build time and time per ray against the number of triangles.

use kdray::{
    accel::Search,
    bench::{
        rays::ray_sets,
        size::{KnotStage, RayGrowth, Report, Row},
    },
    engine::choices::{Processor, TreeKind, traversal_by_rule},
    gpu::{ContextOptions, Device, GpuError},
    scene::LoadOptions,
};

use super::args::SizeArgs;
use super::processor;
use crate::cli::{
    device_args::open_device,
    error::CliError,
    picture_args::check_traversal,
    print,
    progress::Progress,
    table::{decimal, table},
};

/// Measures each mesh, the smallest first, and reports.
pub fn run(args: &SizeArgs) -> Result<(), CliError> {
    args.files.check(&[], &LoadOptions::default())?;
    check_traversal(args.accel, args.traversal)?;
    let mut sizes = args.triangles.clone();
    sizes.sort_unstable();
    sizes.dedup();
    let progress = Progress::new(false, 3 * sizes.len() as u64);
    let options = ContextOptions::new(args.device.clone(), false);
    let device = if args.cpu { None } else { Some(open_device(&options, &progress)?) };
    let info = device.as_ref().map(Device::info);
    let variant = variant(args, processor(device.as_ref()));
    let n_threads = rayon::current_num_threads();
    let mut report = Report {
        suite: "size",
        device: info.map_or_else(|| format!("CPU, {n_threads} threads"), |info| info.name.clone()),
        driver: info.map(|info| info.driver.clone()),
        traversal: variant.to_string(),
        width: args.size.width,
        height: args.size.height,
        n_threads,
        n_times: args.repeat,
        rows: Vec::new(),
    };
    // If a mesh is too large for the device, the results of the smaller ones are still reported.
    let done = sizes.into_iter().try_for_each(|n_triangles| {
        report.rows.push(measure(args, device.as_ref(), variant, n_triangles, &progress)?);
        Ok(())
    });
    drop(progress);
    if !report.rows.is_empty() {
        args.files.write(&report, || report.chart().svg())?;
        print(&text(&report))?;
    }
    done.and_then(|()| check_hits(&report))
}

/// Returns the user's acceleration structure. For a kd-tree, the traversal is the user's or the one that suits the
/// processor.
fn variant(args: &SizeArgs, processor: Processor) -> Search {
    Search::of(args.accel, args.traversal.unwrap_or_else(|| traversal_by_rule(processor)))
}

fn measure(
    args: &SizeArgs,
    device: Option<&Device>,
    variant: Search,
    n_triangles: u32,
    progress: &Progress,
) -> Result<Row, GpuError> {
    let building = format!("building the kd-tree of {n_triangles} triangles");
    let build_options = TreeKind::Best.options(processor(device));
    let pixels = (args.size.width, args.size.height);
    let (sized, _) = progress.stage(&building, || KnotStage::new(n_triangles, pixels, &build_options));
    let (sets, _) = progress.stage("making rays", || ray_sets(&sized.stage));
    let casting = format!("casting rays at {n_triangles} triangles");
    progress.stage(&casting, || sized.measure(device, variant, &sets, args.repeat)).0
}

/// The report as text that ends with a line break.
fn text(report: &Report) -> String {
    let mut text = format!("{}x{} on {}", report.width, report.height, report.device);
    text += &report.driver.as_ref().map_or_else(String::new, |driver| format!(", {driver}"));
    text += &format!(", `{}`, medians of {}\n\n", report.traversal, report.n_times);
    let header = [
        "triangles",
        report.elements(),
        "references",
        "build ms",
        "primary ns",
        "shadow ns",
        "mirror ns",
        "diffuse ns",
    ];
    text += &table(header, &report.rows.iter().map(cells).collect::<Vec<_>>());
    text += &format!(
        "\nA rippled knot in a closed room; ns: time of a ray. kd-trees are built on {} threads, grids on the \
         device if there is one.\n",
        report.n_threads
    );
    if let Some(growth) = report.growth() {
        let list = |ratio: fn(&RayGrowth) -> Option<f64>| {
            let words = growth.rays.iter().map(|ray| format!("{} {}", ray.kind.name(), decimal(ratio(ray), 2)));
            words.collect::<Vec<_>>().join(", ")
        };
        text += &format!(
            "From the least to the largest mesh, log N grows {:.2} times, the nodes that a ray visits: {}; its \
             time: {}.\n",
            growth.logarithm,
            list(|ray| Some(ray.nodes)),
            list(|ray| ray.time)
        );
    }
    text
}

fn cells(row: &Row) -> [String; 8] {
    let ns = |kind_ix: usize| {
        let cost = row.rays.get(kind_ix).and_then(|cost| cost.ns_a_ray);
        decimal(cost.map(|ns| ns.median), 3)
    };
    [
        row.n_triangles.to_string(),
        row.accel.n_elements().to_string(),
        row.accel.n_references().to_string(),
        decimal(Some(row.build_ms), 1),
        ns(0),
        ns(1),
        ns(2),
        ns(3),
    ]
}

/// Fails if more hits differ from the CPU's than rounding explains: the speed of wrong hits has no meaning.
fn check_hits(report: &Report) -> Result<(), CliError> {
    let Some((row, cost)) = report.first_wrong() else { return Ok(()) };
    Err(CliError::WrongHits(format!(
        "{} of {} {} rays at {} triangles have other hits with `{}` than on the CPU",
        cost.difference.n_differing,
        cost.n_rays,
        cost.rays.name(),
        row.n_triangles,
        report.traversal
    )))
}

#[cfg(test)]
mod tests {
    use kdray::{
        accel::{
            Statistics,
            kdtree::{BuildOptions, KdTree},
        },
        bench::{Spread, difference::Difference, rays::RaySetKind, size::RayCost, traversal::StepsARay},
    };

    use super::*;

    /// Returns a report of two sizes. `ns` is the time of a ray at each size, nanoseconds.
    fn report(ns: [f64; 2], n_differing: u64) -> Report {
        let row = |n_triangles: usize, ns: f64| Row {
            n_triangles,
            generate_ms: 1.0,
            build_ms: 7.0,
            accel: Statistics::KdTree(
                KdTree::build(&[], &BuildOptions::default()).statistics(0, &BuildOptions::default()),
            ),
            rays: RaySetKind::ALL
                .map(|rays| RayCost {
                    rays,
                    n_rays: 1000,
                    ms: Spread::of([ns * 1e-3]),
                    ns_a_ray: Spread::of([ns]),
                    steps_a_ray: StepsARay { nodes: 2.0 + (n_triangles / 1_000_000) as f64, ..StepsARay::default() },
                    difference: Difference { n_differing, n_grazing: 9 },
                })
                .to_vec(),
        };
        Report {
            suite: "size",
            device: "d".to_owned(),
            driver: None,
            traversal: "mask".to_owned(),
            width: 40,
            height: 25,
            n_threads: 2,
            n_times: 1,
            rows: vec![row(1000, ns[0]), row(1_000_000, ns[1])],
        }
    }

    #[test]
    fn growth_is_that_of_the_last_over_the_first() {
        let text = text(&report([8.0, 20.0], 0));
        assert!(text.contains("log N grows 2.00 times, the nodes that a ray visits: primary 1.50, "), "{text}");
        assert!(text.contains("; its time: primary 2.50, shadow 2.50, "), "{text}");
        assert!(text.contains("\n1000000 "), "{text}");
        let single = Report { rows: report([8.0, 20.0], 0).rows[..1].to_vec(), ..report([8.0, 20.0], 0) };
        assert_eq!(single.growth(), None);
    }

    #[test]
    fn wrong_hits_fail() {
        assert!(check_hits(&report([8.0, 20.0], 0)).is_ok());
        let error = check_hits(&report([8.0, 20.0], 1)).unwrap_err();
        assert_eq!(
            error.to_string(),
            "1 of 1000 primary rays at 1000 triangles have other hits with `mask` than on the CPU"
        );
        assert_eq!(error.exit_code(), 4);
    }
}
