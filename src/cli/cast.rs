//! `kdray cast`: casts rays from a file into a scene and writes their hits to a file, or finds the closest points to
//! the points of a file.

use std::time::Instant;

use kdray::{
    accel::Query,
    cast::{
        CastResult, Hit, HitListWriter, HitWriter, NO_TRIANGLE, PointReader, RAYS_PER_BATCH, RayReader, count_invalid,
    },
    engine::{Caster, Engine, Loaded, Work, choices::Choices},
    gpu::ContextOptions,
    output,
    world::FlatScene,
};

use super::{
    args::{CastArgs, ListArgs},
    cast_report::{CastReport, Times},
    device_args::open_device,
    error::CliError,
    file_roles::FileRoles,
    print,
    progress::Progress,
    render::{report_validation, set_threads},
    report::write_json,
};

/// Runs `kdray cast`: loads the scene, builds its structure, casts the rays batch by batch, writes and reports.
/// Arguments and files are checked before the work that an error would waste.
pub fn run(args: &CastArgs) -> Result<(), CliError> {
    args.check()?;
    check_roles(args)?;
    output::check(&args.output)?;
    args.json.as_deref().map_or(Ok(()), output::check)?;
    set_threads(args.threads)?;
    args.check_device()?;

    let queries = Queries::open(args)?;
    let progress = Progress::new(args.quiet, 3);
    let opened = progress.read(&args.mesh, &args.load.rays())?;
    let options = ContextOptions::new(args.device.clone(), args.validate);
    let device = if args.cpu { None } else { Some(open_device(&options, &progress)?) };

    let engine = device.clone().map_or_else(Engine::on_cpu, Engine::on_device).with_request(args.request());
    let (n_triangles, load_ms) = (opened.scene.n_triangles(), opened.load_ms);
    let building = engine.builder().describe(&opened.scene);
    let (built, _) = progress.stage(&building, || engine.build(opened, &Work::Rays(queries.n())));
    let (Loaded { world, accel, build_ms, .. }, methods) = built?;
    let casting = format!("casting {} {}", queries.n(), args.noun());
    let traversal = methods.traversal.value;
    let caster = engine.caster(world.geometry(), traversal)?;
    let (done, cast_ms) = progress.stage(&casting, || match (args.list(), queries) {
        (Some(list), Queries::Rays(rays)) => list_all(args, list, rays, caster, world.scene()),
        (_, queries) => cast_all(args, queries, caster, world.scene()),
    });
    let totals = done?;
    drop(progress);

    let report = CastReport {
        scene: world.scene().name.clone(),
        rays: args.rays.clone(),
        hits: args.output.clone(),
        query: args.query_word(),
        noun: args.noun(),
        traversal: accel.tree_kind().map(|_| traversal.to_string()),
        choices: Choices::of_rays(accel, methods),
        device: engine.device_name(),
        triangles: n_triangles,
        accel: world.statistics(),
        device_build: world.device_build().cloned(),
        n_rays: totals.n_rays,
        n_hits: totals.n_hits,
        n_invalid: totals.n_invalid,
        times: totals.ms.and_then(|ms| Times::of(ms, totals.n_rays)),
        load_ms,
        build_ms,
        cast_ms,
    };
    write_json(args.json.as_ref(), &report)?;
    if !args.quiet {
        print(&report.text())?;
    }
    device.as_ref().map_or(Ok(()), report_validation)
}

/// Refuses an output that the command also reads, or that it writes twice.
fn check_roles(args: &CastArgs) -> Result<(), CliError> {
    let mut roles = FileRoles::default();
    roles.read_scene("MESH", &args.mesh, args.load.options());
    roles.read("RAYS", &args.rays);
    roles.write("--output", &args.output)?;
    args.json.iter().try_for_each(|path| roles.write("--json", path))
}

/// Sums over all batches.
struct Totals {
    n_rays: u64,
    n_hits: u64,
    n_invalid: u64,
    /// Milliseconds of casting, one entry per repetition; none if the device has no timestamps.
    ms: Option<Vec<f64>>,
}

impl Totals {
    fn add(&mut self, cast: &CastResult) {
        self.n_rays += cast.hits.len() as u64;
        self.n_hits += cast.hits.iter().filter(|hit: &&Hit| hit.triangle_ix != NO_TRIANGLE).count() as u64;
        self.n_invalid += cast.n_invalid;
        let sums = self.ms.take().zip(cast.gpu_ms.as_ref());
        self.ms = sums.map(|(sums, batch)| sums.iter().zip(batch).map(|(a, b)| a + b).collect());
    }
}

/// The file of rays or points.
enum Queries {
    Rays(RayReader),
    Points(PointReader),
}

impl Queries {
    fn open(args: &CastArgs) -> Result<Self, CliError> {
        Ok(match args.closest {
            true => Self::Points(PointReader::open(&args.rays)?),
            false => Self::Rays(RayReader::open(&args.rays)?),
        })
    }

    /// Returns the number of rays or points in the whole file.
    fn n(&self) -> u64 {
        match self {
            Self::Rays(rays) => rays.n_rays(),
            Self::Points(points) => points.n_points(),
        }
    }

    /// Reads a batch and casts it. The result has no hits after the last batch.
    fn cast_next(&mut self, caster: &mut Caster, query: Query, n_times: u32) -> Result<CastResult, CliError> {
        Ok(match self {
            Self::Rays(rays) => caster.cast(&rays.next_batch(RAYS_PER_BATCH)?, query, n_times)?,
            Self::Points(points) => caster.closest_points(&points.next_batch(RAYS_PER_BATCH)?, n_times)?,
        })
    }
}

/// Reads rays or points, casts them and writes their hits, one batch at a time.
fn cast_all(args: &CastArgs, mut queries: Queries, mut caster: Caster, scene: &FlatScene) -> Result<Totals, CliError> {
    let (query, n_times) = (args.query(), u32::from(args.repeat));
    let mut totals = Totals { n_rays: 0, n_hits: 0, n_invalid: 0, ms: Some(vec![0.0; n_times as usize]) };
    let mut hits = HitWriter::new(&args.output)?;
    loop {
        let cast = queries.cast_next(&mut caster, query, n_times)?;
        if cast.hits.is_empty() {
            break;
        }
        totals.add(&cast);
        hits.push(&cast.hits)?;
    }
    hits.finish(scene, query)?;
    Ok(totals)
}

/// Reads rays, counts or lists all of their hits and writes them, one batch at a time. The time is wall-clock time.
fn list_all(
    args: &CastArgs,
    list: ListArgs,
    mut rays: RayReader,
    mut caster: Caster,
    scene: &FlatScene,
) -> Result<Totals, CliError> {
    let mut totals = Totals { n_rays: 0, n_hits: 0, n_invalid: 0, ms: None };
    let mut writer = HitListWriter::new(&args.output)?;
    let mut ms = 0.0;
    loop {
        let batch = rays.next_batch(RAYS_PER_BATCH)?;
        if batch.is_empty() {
            break;
        }
        let start = Instant::now();
        match list {
            ListArgs::Count => {
                let counts = caster.count_hits(&batch)?;
                ms += start.elapsed().as_secs_f64() * 1e3;
                totals.n_hits += counts.iter().map(|count| u64::from(*count)).sum::<u64>();
                writer.push_counts(&counts)?;
            }
            ListArgs::All(most_per_ray) => {
                let lists = caster.all_hits(&batch, most_per_ray)?;
                ms += start.elapsed().as_secs_f64() * 1e3;
                totals.n_hits += lists.hits.len() as u64;
                writer.push_lists(&lists)?;
            }
        }
        totals.n_rays += batch.len() as u64;
        totals.n_invalid += count_invalid(&batch);
    }
    match list {
        ListArgs::Count => writer.finish_counts()?,
        ListArgs::All(_) => writer.finish_lists(scene)?,
    }
    totals.ms = Some(vec![ms]);
    Ok(totals)
}
