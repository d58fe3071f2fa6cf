//! Structures that are built when they are needed. The host keeps the options; each device builds the structure for
//! itself, and the host builds one at the first [`Lazy::get`]. The host's grid and the device's have the same bits,
//! unless the device had to lower the limit of references
//! ([`GridOptions::max_references`](super::grid::GridOptions::max_references)). Their kd-trees differ a little, and
//! lead rays to the same hits.

use std::sync::OnceLock;

use glam::Vec3;
use serde::Serialize;

use super::{
    Statistics,
    bounds::Bounds,
    grid::{Grid, GridOptions},
    kdtree::{BuildOptions, KdTree, scales::Scales},
};
use crate::{layout::Triangle, util::once::made_once};

/// A structure that the host can build.
pub trait Structure: Sized {
    /// The options of a build.
    type Options;

    /// Builds the structure on the current rayon pool.
    fn of(triangles: &[Triangle], options: &Self::Options) -> Self;

    /// Returns the statistics of the structure that [`Structure::of`] has built with the same arguments.
    fn statistics(&self, n_triangles: usize, options: &Self::Options) -> Statistics;
}

impl Structure for Grid {
    type Options = GridOptions;

    fn of(triangles: &[Triangle], options: &GridOptions) -> Self {
        Self::build(triangles, options)
    }

    fn statistics(&self, _: usize, _: &GridOptions) -> Statistics {
        Statistics::Grid(self.statistics())
    }
}

impl Structure for KdTree {
    type Options = BuildOptions;

    fn of(triangles: &[Triangle], options: &BuildOptions) -> Self {
        Self::build(triangles, options)
    }

    fn statistics(&self, n_triangles: usize, options: &BuildOptions) -> Statistics {
        Statistics::KdTree(self.statistics(n_triangles, options))
    }
}

/// A structure over some triangles that is built on demand: its options, the host's structure if that is built, and
/// the report of the first device that has built one.
#[derive(Clone, Debug, PartialEq)]
pub struct Lazy<S: Structure> {
    options: S::Options,
    n_triangles: usize,
    bounds: [Vec3; 2],
    origin_reach: f32,
    on_host: OnceLock<S>,
    on_device: OnceLock<DeviceBuild>,
}

/// Report of a device on a structure that it has built.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DeviceBuild {
    /// The structure's statistics.
    #[serde(skip)]
    pub statistics: Statistics,
    /// The duration of the build, milliseconds; none if the device has no timestamps.
    pub ms: Option<f64>,
    /// The stages of the build, in the order of execution.
    pub stages: Vec<BuildStage>,
}

impl DeviceBuild {
    /// Returns the report of builds of structures of one kind that a device has made one after the other: the sums of
    /// their sizes and times. None if there are none.
    pub(crate) fn sum(builds: Vec<Self>) -> Option<Self> {
        builds.into_iter().reduce(|mut sum, build| {
            sum.ms = sum.ms.zip(build.ms).map(|(sum, ms)| sum + ms);
            build.stages.into_iter().for_each(|stage| stage.add_to(&mut sum.stages));
            match (&mut sum.statistics, &build.statistics) {
                (Statistics::KdTree(sum), Statistics::KdTree(own)) => sum.add(own),
                (Statistics::Grid(sum), Statistics::Grid(own)) => sum.add(own),
                _ => unreachable!("all geometries have one kind of structure"),
            }
            sum
        })
    }
}

/// Stage of a build: all dispatches of one kernel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BuildStage {
    /// The kernel's name.
    pub name: &'static str,
    /// The duration of the stage, milliseconds; none if the device has no timestamps.
    pub ms: Option<f64>,
}

impl BuildStage {
    /// Adds the duration to that of the stage of this name, or the stage to the others if there is none.
    pub(crate) fn add_to(self, stages: &mut Vec<Self>) {
        match stages.iter_mut().find(|stage| stage.name == self.name) {
            Some(stage) => stage.ms = stage.ms.zip(self.ms).map(|(sum, ms)| sum + ms),
            None => stages.push(self),
        }
    }
}

impl<S: Structure> Lazy<S> {
    /// Keeps the options of a structure over these triangles. The structure itself is not built.
    pub fn new(triangles: &[Triangle], options: S::Options) -> Self {
        Self::of_each(triangles.len(), |ix| triangles[ix], options)
    }

    /// Does what [`Lazy::new`] does, for `n` triangles whose corners a function returns.
    pub(crate) fn of_corners(
        n: usize,
        corners: impl Fn(usize) -> [Vec3; 3] + Sync + Send,
        options: S::Options,
    ) -> Self {
        let triangle = |ix| {
            let [v0, v1, v2] = corners(ix);
            Triangle { v0, v1, v2, ..Triangle::default() }
        };
        Self::of_each(n, triangle, options)
    }

    fn of_each(n: usize, triangle: impl Fn(usize) -> Triangle + Sync + Send, options: S::Options) -> Self {
        let exact_bounds = Bounds::of_each(n, &triangle);
        let bounds = exact_bounds.grown(exact_bounds.margin());
        Self {
            options,
            n_triangles: n,
            bounds: [bounds.min.into(), bounds.max.into()],
            origin_reach: Scales::of_each(n, triangle, &exact_bounds).origin_reach(bounds.largest_coordinate()),
            on_host: OnceLock::new(),
            on_device: OnceLock::new(),
        }
    }

    /// Returns the host's structure, which the first call builds on the current rayon pool. `triangles`: those of
    /// [`Lazy::new`].
    ///
    /// # Panics
    /// There are more or fewer triangles than [`Lazy::new`] was given.
    pub fn get(&self, triangles: &[Triangle]) -> &S {
        assert_eq!(triangles.len(), self.n_triangles, "the triangles of the structure");
        made_once(&self.on_host, || S::of(triangles, &self.options))
    }

    /// The host's structure, if it is built.
    pub(crate) fn on_host(&self) -> Option<&S> {
        self.on_host.get()
    }

    /// Keeps a device's report, if it is the first one.
    pub(crate) fn note(&self, build: DeviceBuild) {
        // Later builds have the same triangles and options. Their statistics are the same, unless another device has
        // a lower limit of references.
        let _ = self.on_device.set(build);
    }

    /// The report of the first device that has built the structure, if there is one.
    pub fn device_build(&self) -> Option<&DeviceBuild> {
        self.on_device.get()
    }

    /// Returns the structure's statistics, from a device that has built it if there is one. If there is none, the host
    /// builds the structure.
    pub fn statistics(&self, triangles: &[Triangle]) -> Statistics {
        match self.on_device.get() {
            Some(build) => build.statistics.clone(),
            None => self.get(triangles).statistics(triangles.len(), &self.options),
        }
    }

    /// The options that the structure is built with.
    pub fn options(&self) -> &S::Options {
        &self.options
    }

    /// The number of triangles that the structure is made for.
    pub fn n_triangles(&self) -> usize {
        self.n_triangles
    }

    /// The least and the greatest corner of the structure's box, which holds all triangles, world units.
    pub fn bounds(&self) -> [Vec3; 2] {
        self.bounds
    }

    /// The greatest magnitude of a coordinate of a ray's origin up to which a search does not move the origin, world
    /// units.
    pub fn origin_reach(&self) -> f32 {
        self.origin_reach
    }
}
