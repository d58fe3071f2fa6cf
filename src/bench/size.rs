//! The benchmark of cost against size: one shape cut into more and more triangles, with the same number of rays each
//! time. In a good tree, the time of a ray grows like the logarithm of the number of triangles.

use std::{path::Path, time::Instant};

use glam::Vec3;
use serde::Serialize;

use super::{
    Spread,
    chart::{BarChart, Scale, Series},
    difference::Difference,
    rays::{RaySet, RaySetKind},
    stage::Stage,
    traversal::{SetResult, StepsARay, Tracers},
};
use crate::{
    accel::{Accel, Search, Statistics, kdtree::BuildOptions},
    gpu::{Device, GpuError},
    scene::{
        Camera, Instance, Material, Projection, Scene,
        generate::{Generator, MAX_TRIANGLES, TriangleBudget},
    },
    world::FlatScene,
};

/// Numbers of triangles that are measured by default.
pub const SIZES: [u32; 3] = [10_000, 100_000, 1_000_000];
/// Smallest number of triangles of the knot; with fewer it no longer looks like a knot.
pub const MIN_TRIANGLES: u32 = 1000;
/// Largest number of triangles of the knot, which is the generators' limit.
pub const MOST_TRIANGLES: u32 = MAX_TRIANGLES as u32;

/// Makes a rippled torus knot of `n_triangles` triangles, or one fewer if the number is odd. Its quads are about as
/// long as wide.
///
/// # Panics
/// The number is not within [`MIN_TRIANGLES`] to [`MOST_TRIANGLES`].
pub fn knot(n_triangles: u32) -> Scene {
    assert!((MIN_TRIANGLES..=MOST_TRIANGLES).contains(&n_triangles), "no knot has {n_triangles} triangles");
    // The knot is 13.5 times as long as the tube's circumference, and has n / 2 quads that are as long as wide.
    let segments = (13.5 * f64::from(n_triangles) / 2.0).sqrt() as u32;
    let description = format!(
        "generator = \"torus_knot\"\np = 2\nq = 5\nradius = 1.35\nswing = 0.62\ntube = 0.36\nsegments = {segments}\n\
         triangles = {}\nripples = [14, 4]\nripple_depth = 0.07\n",
        n_triangles & !1
    );
    let generator: Generator = toml::from_str(&description).expect("the generator knows its words");
    let mesh = generator.build(&TriangleBudget::default()).expect("numbers within its limits and memory");
    Scene {
        meshes: vec![mesh],
        instances: vec![Instance { materials: vec![0], ..Instance::default() }],
        materials: vec![Material::default()],
        camera: Camera {
            eye: Vec3::Z,
            target: Vec3::ZERO,
            up: Vec3::Y,
            projection: Projection::Perspective { vertical_fov_degrees: 60.0 },
        },
        ..Scene::empty(Path::new("knot"))
    }
}

/// The knot in a closed room, and the time of making it.
pub struct KnotStage {
    pub stage: Stage,
    n_triangles: usize,
    generate_ms: f64,
}

impl KnotStage {
    /// Makes the knot and the room. `size` is in pixels; each pixel has one primary ray.
    pub fn new(n_triangles: u32, size: (u32, u32), build_options: &BuildOptions) -> Self {
        let begin = Instant::now();
        let scene = FlatScene::new(&knot(n_triangles)).expect("a knot of a few units");
        let generate_ms = begin.elapsed().as_secs_f64() * 1e3;
        Self { n_triangles: scene.triangles.len(), stage: Stage::in_room(scene, size, build_options), generate_ms }
    }

    /// Casts the rays `n_times` on a device, or on the current rayon pool if there is none.
    ///
    /// # Errors
    /// Fails as [`Tracers::new`] and [`Tracers::measure`] do.
    pub fn measure(
        &self,
        device: Option<&Device>,
        variant: Search,
        sets: &[RaySet],
        n_times: u16,
    ) -> Result<Row, GpuError> {
        let variants = [variant];
        let begin = Instant::now();
        let mut tracers = Tracers::new(device, &self.stage, &variants)?; // builds a grid if there is a device
        let accel = self.stage.statistics(variant); // builds a grid if there is none
        let grid_ms = begin.elapsed().as_secs_f64() * 1e3;
        let build_ms = match self.stage.geometry(variant).accel() {
            Accel::KdTree(_) | Accel::TwoLevel(_) => self.stage.tree_build_ms,
            accel @ (Accel::LazyTree(_) | Accel::Grid(_)) => {
                accel.device_build().and_then(|build| build.ms).unwrap_or(grid_ms)
            }
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

/// The result for one size.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Number of the knot's triangles; the room has 12 more.
    pub n_triangles: usize,
    /// Wall-clock time of generating the mesh.
    pub generate_ms: f64,
    /// Time of building the structure. For a kd-tree it is wall-clock; for a grid it is GPU time, or wall-clock where
    /// the host builds the grid.
    pub build_ms: f64,
    /// Statistics of the structure, serialized under the key `tree` or `grid`.
    #[serde(flatten)]
    pub accel: Statistics,
    /// One entry per set.
    pub rays: Vec<RayCost>,
}

/// The cost of the rays of a set.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RayCost {
    pub rays: RaySetKind,
    pub n_rays: usize,
    /// Time of the whole set; none where the device has no timestamps.
    pub ms: Option<Spread>,
    /// Time of the whole set divided by the number of rays, in nanoseconds.
    pub ns_a_ray: Option<Spread>,
    pub steps_a_ray: StepsARay,
    /// Difference from the CPU's hits.
    #[serde(flatten)]
    pub difference: Difference,
}

impl RayCost {
    /// Takes the cost from a set with a single variant.
    fn new(set: &SetResult) -> Self {
        let variant = &set.variants[0];
        let ns = |ms: f64| ms * 1e6 / set.n_rays as f64;
        let ns_a_ray = variant.ms.map(|ms| Spread { median: ns(ms.median), min: ns(ms.min), max: ns(ms.max) });
        Self {
            rays: set.rays,
            n_rays: set.n_rays,
            ms: variant.ms,
            ns_a_ray,
            steps_a_ray: variant.steps_a_ray.expect("steps of a search that devices have"),
            difference: variant.difference,
        }
    }
}

/// The suite's report.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Name of the suite: `size`.
    pub suite: &'static str,
    /// The device's own name, or the number of CPU threads.
    pub device: String,
    /// The driver's name and version; none on the CPU.
    pub driver: Option<String>,
    pub traversal: String,
    /// Width of the picture in pixels, with one primary ray each.
    pub width: u32,
    /// Height of the picture in pixels.
    pub height: u32,
    /// Number of CPU threads that build the tree.
    pub n_threads: usize,
    /// Number of timed casts of each set.
    pub n_times: u16,
    /// One row per size.
    pub rows: Vec<Row>,
}

/// Growth from the first size to the last, as ratios.
#[derive(Clone, Debug, PartialEq)]
pub struct Growth {
    /// Ratio of the logarithms of the numbers of triangles.
    pub logarithm: f64,
    /// Growth of each kind of ray.
    pub rays: Vec<RayGrowth>,
}

/// Growth of the mean ray of a kind, as ratios.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayGrowth {
    pub kind: RaySetKind,
    /// Ratio of its times; none without timestamps.
    pub time: Option<f64>,
    /// Ratio of the numbers of nodes that it visits, which does not depend on caches.
    pub nodes: f64,
}

impl Report {
    /// Returns the name of the structure's elements: `nodes` or `cells`.
    pub fn elements(&self) -> &'static str {
        self.rows.first().map_or("nodes", |row| row.accel.elements())
    }

    /// Returns the growth, or `None` if there are fewer than two sizes.
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

    /// Returns a chart of the times of a ray, with one group per size and one bar per kind of ray.
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

    /// Returns the first size and kind of rays for which more hits differ from the CPU's than rounding explains.
    pub fn first_wrong(&self) -> Option<(&Row, &RayCost)> {
        let mut pairs = self.rows.iter().flat_map(|row| row.rays.iter().map(move |cost| (row, cost)));
        pairs.find(|(_, cost)| !cost.difference.is_rounding(cost.n_rays))
    }
}
