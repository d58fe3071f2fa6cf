//! Cost against size: one shape cut into ever more triangles, as many rays each time. Through a good tree the time of a
//! ray grows like the logarithm of the number of triangles.

use std::{sync::Arc, time::Instant};

use glam::Vec3;
use serde::Serialize;

use super::{
    Spread,
    chart::{BarChart, Scale, Series},
    difference::Difference,
    rays::{RayKind, RaySet},
    stage::Stage,
    traversal::{SetResult, StepsARay, Tracers},
    variant::Variant,
};
use crate::{
    accel::{Accel, Statistics, kdtree::BuildOptions},
    gpu::{Context, GpuError},
    scene::{
        Camera, Instance, Material, RenderDefaults, Scene, Transform,
        generate::{Budget, Generator, MAX_TRIANGLES},
    },
    world::FlatScene,
};

/// Numbers of triangles that are measured unless others are asked for.
pub const SIZES: [u32; 3] = [10_000, 100_000, 1_000_000];
/// Fewest triangles of which the knot can be made so that it still looks like one.
pub const MIN_TRIANGLES: u32 = 1000;
/// The generators' own limit.
pub const MOST_TRIANGLES: u32 = MAX_TRIANGLES as u32;

/// A rippled torus knot of so many triangles, one fewer if they are odd, of about equal sides.
///
/// # Panics
/// On a number beyond [`MIN_TRIANGLES`] and [`MOST_TRIANGLES`].
pub fn knot(n_triangles: u32) -> Scene {
    assert!((MIN_TRIANGLES..=MOST_TRIANGLES).contains(&n_triangles), "no knot has {n_triangles} triangles");
    // The knot is 13.5 times as long as the tube is around: n / 2 quads, as long as they are wide.
    let segments = (13.5 * f64::from(n_triangles) / 2.0).sqrt() as u32;
    let description = format!(
        "generator = \"torus_knot\"\np = 2\nq = 5\nradius = 1.35\nswing = 0.62\ntube = 0.36\nsegments = {segments}\n\
         triangles = {}\nripples = [14, 4]\nripple_depth = 0.07\n",
        n_triangles & !1
    );
    let generator: Generator = toml::from_str(&description).expect("the generator knows its words");
    let mesh = generator.build(&Budget::default()).expect("numbers within its limits and memory");
    Scene {
        name: "knot".to_owned(),
        meshes: vec![mesh],
        instances: vec![Instance { mesh_ix: 0, transform: Transform::IDENTITY, materials: vec![0] }],
        materials: vec![Material::default()],
        lights: Vec::new(),
        camera: Camera { eye: Vec3::Z, target: Vec3::ZERO, up: Vec3::Y, vertical_fov_degrees: 60.0 },
        ambient: Vec3::ZERO,
        background: Vec3::ZERO,
        defaults: RenderDefaults::default(),
    }
}

/// The knot in a closed room, and what it took to make it.
pub struct Sized {
    pub stage: Stage,
    n_triangles: usize,
    generate_ms: f64,
}

impl Sized {
    /// `size`: pixels, one primary ray each.
    pub fn new(n_triangles: u32, size: (u32, u32), build_options: &BuildOptions) -> Self {
        let begin = Instant::now();
        let scene = FlatScene::new(&knot(n_triangles)).expect("a knot of a few units");
        let generate_ms = begin.elapsed().as_secs_f64() * 1e3;
        Self { n_triangles: scene.triangles.len(), stage: Stage::in_room(scene, size, build_options), generate_ms }
    }

    /// Casts the rays `n_times` on a device, or without one on the current rayon pool.
    ///
    /// # Errors
    /// As [`Tracers::new`] and [`Tracers::measure`].
    pub fn measure(
        &self,
        context: Option<&Arc<Context>>,
        variant: Variant,
        sets: &[RaySet],
        n_times: u16,
    ) -> Result<Row, GpuError> {
        let variants = [variant];
        let begin = Instant::now();
        let mut tracers = Tracers::new(context, &self.stage, &variants)?; // on a device it builds a grid
        let accel = self.stage.statistics(variant); // on the host this does
        let grid_ms = begin.elapsed().as_secs_f64() * 1e3;
        let build_ms = match self.stage.geometry(variant).accel() {
            Accel::KdTree(_) => self.stage.tree_build_ms,
            Accel::Grid(grid) => grid.device_build().and_then(|build| build.ms).unwrap_or(grid_ms),
        };
        let rays = sets.iter().map(|set| Ok(RayCost::new(&tracers.measure(set, n_times)?)));
        Ok(Row {
            n_triangles: self.n_triangles,
            generate_ms: self.generate_ms,
            build_ms,
            rays: rays.collect::<Result<_, GpuError>>()?,
            accel,
        })
    }
}

/// One size.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Of the knot; the room has 12 more.
    pub n_triangles: usize,
    /// The mesh, wall-clock.
    pub generate_ms: f64,
    /// The structure: a kd-tree wall-clock; a grid on the GPU, or wall-clock where the host builds it.
    pub build_ms: f64,
    /// As `tree` or `grid`.
    #[serde(flatten)]
    pub accel: Statistics,
    /// One a set.
    pub rays: Vec<RayCost>,
}

/// What the rays of a set cost.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RayCost {
    pub rays: RayKind,
    pub n_rays: usize,
    /// Of the whole set; none where the device has no timestamps.
    pub ms: Option<Spread>,
    /// Nanoseconds.
    pub ns_a_ray: Option<Spread>,
    pub steps_a_ray: StepsARay,
    /// From the CPU's hits.
    #[serde(flatten)]
    pub difference: Difference,
}

impl RayCost {
    /// Of the set's only variant.
    fn new(set: &SetResult) -> Self {
        let variant = &set.variants[0];
        let ns = |ms: f64| ms * 1e6 / set.n_rays as f64;
        let ns_a_ray = variant.ms.map(|ms| Spread { median: ns(ms.median), min: ns(ms.min), max: ns(ms.max) });
        Self {
            rays: set.rays,
            n_rays: set.n_rays,
            ms: variant.ms,
            ns_a_ray,
            steps_a_ray: variant.steps_a_ray,
            difference: variant.difference,
        }
    }
}

/// What the suite found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// `size`.
    pub suite: &'static str,
    /// The device's own name, or the number of CPU threads.
    pub device: String,
    /// The driver's name and version; none on the CPU.
    pub driver: Option<String>,
    pub traversal: String,
    /// Pixels, one primary ray each.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// For building.
    pub n_threads: usize,
    /// Timed casts of each set.
    pub n_times: u16,
    /// By size.
    pub rows: Vec<Row>,
}

/// From the least to the largest mesh, how many times as great as before.
#[derive(Clone, Debug, PartialEq)]
pub struct Growth {
    /// The logarithm of the number of triangles.
    pub logarithm: f64,
    /// By kind of ray.
    pub rays: Vec<RayGrowth>,
}

/// Of [`Growth`]: the mean ray of a kind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayGrowth {
    pub kind: RayKind,
    /// Its time; none without timestamps.
    pub time: Option<f64>,
    /// The nodes that it visits, whatever the caches hold.
    pub nodes: f64,
}

impl Report {
    /// What the structure is made of: `nodes` or `cells`.
    pub fn parts(&self) -> &'static str {
        self.rows.first().map_or("nodes", |row| row.accel.parts())
    }

    /// None of fewer than two sizes.
    pub fn growth(&self) -> Option<Growth> {
        let [first, .., last] = &self.rows[..] else { return None };
        let logarithm = (last.n_triangles as f64).ln() / (first.n_triangles as f64).ln();
        let growth = |(a, b): (&RayCost, &RayCost)| RayGrowth {
            kind: a.rays,
            time: a.ns_a_ray.zip(b.ns_a_ray).map(|(a, b)| b.median / a.median),
            nodes: b.steps_a_ray.nodes / a.steps_a_ray.nodes,
        };
        Some(Growth { logarithm, rays: first.rays.iter().zip(&last.rays).map(growth).collect() })
    }

    /// Times of a ray, a group a size, a bar a kind of rays.
    pub fn chart(&self) -> BarChart {
        let kinds = self.rows.first().map_or(&[][..], |row| &row.rays);
        let series = |(kind_ix, cost): (usize, &RayCost)| Series {
            name: cost.rays.name().to_owned(),
            values: self.rows.iter().map(|row| row.rays[kind_ix].ns_a_ray.map(|ns| ns.median)).collect(),
        };
        BarChart {
            title: format!("Cost of a ray by `{}` on {}", self.traversal, self.device),
            unit: "ns".to_owned(),
            scale: Scale::Linear,
            groups: self.rows.iter().map(|row| format!("{}\ntriangles", row.n_triangles)).collect(),
            series: kinds.iter().enumerate().map(series).collect(),
        }
    }

    /// The first rays whose hits differ from the CPU's on more of them than rounding explains, and the size.
    pub fn first_wrong(&self) -> Option<(&Row, &RayCost)> {
        let mut pairs = self.rows.iter().flat_map(|row| row.rays.iter().map(move |cost| (row, cost)));
        pairs.find(|(_, cost)| !cost.difference.is_rounding(cost.n_rays))
    }
}
