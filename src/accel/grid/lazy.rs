//! Grids that are built when they are needed. The host keeps the options; each device builds the grid for itself, and
//! the host builds one at the first [`LazyGrid::get`]. Both grids have the same bits, unless the device had to lower
//! the limit of references ([`GridOptions::max_references`]).

use std::sync::OnceLock;

use glam::Vec3;
use serde::Serialize;

use super::{Grid, GridOptions, Statistics};
use crate::{
    accel::{bounds::Bounds, kdtree::scales::Scales},
    layout::Triangle,
};

/// A grid over some triangles that is built on demand: its options, the host's grid if that is built, and the report
/// of the first device that has built one.
#[derive(Clone, Debug, PartialEq)]
pub struct LazyGrid {
    options: GridOptions,
    n_triangles: usize,
    bounds: [Vec3; 2],
    origin_reach: f32,
    on_host: OnceLock<Grid>,
    on_device: OnceLock<DeviceBuild>,
}

/// Report of a device on a grid that it has built.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DeviceBuild {
    /// The grid's statistics.
    #[serde(skip)]
    pub statistics: Statistics,
    /// The duration of the build, milliseconds; none if the device has no timestamps.
    pub ms: Option<f64>,
    /// The stages of the build, in the order of execution.
    pub stages: Vec<BuildStage>,
}

/// Stage of a build: all dispatches of one kernel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BuildStage {
    /// The kernel's name.
    pub name: &'static str,
    /// The duration of the stage, milliseconds; none if the device has no timestamps.
    pub ms: Option<f64>,
}

impl LazyGrid {
    /// Keeps the options of a grid over these triangles. The grid itself is not built.
    pub fn new(triangles: &[Triangle], options: GridOptions) -> Self {
        let exact_bounds = Bounds::of_all(triangles);
        let bounds = exact_bounds.grown(exact_bounds.margin());
        Self {
            options,
            n_triangles: triangles.len(),
            bounds: [bounds.min.into(), bounds.max.into()],
            origin_reach: Scales::new(triangles, &exact_bounds).origin_reach(bounds.largest_coordinate()),
            on_host: OnceLock::new(),
            on_device: OnceLock::new(),
        }
    }

    /// Returns the host's grid, which the first call builds on the current rayon pool. `triangles`: those of
    /// [`LazyGrid::new`].
    ///
    /// # Panics
    /// There are more or fewer triangles than [`LazyGrid::new`] was given.
    pub fn get(&self, triangles: &[Triangle]) -> &Grid {
        assert_eq!(triangles.len(), self.n_triangles, "the triangles of the grid");
        self.on_host.get_or_init(|| Grid::build(triangles, &self.options))
    }

    /// Keeps a device's report, if it is the first one.
    pub(crate) fn note(&self, build: DeviceBuild) {
        // Later builds have the same triangles and options. Their statistics are the same, unless another device has
        // a lower limit of references.
        let _ = self.on_device.set(build);
    }

    /// The report of the first device that has built the grid, if there is one.
    pub fn device_build(&self) -> Option<&DeviceBuild> {
        self.on_device.get()
    }

    /// Returns the grid's statistics, from a device that has built it if there is one. If there is none, the host
    /// builds the grid.
    pub fn statistics(&self, triangles: &[Triangle]) -> Statistics {
        match self.on_device.get() {
            Some(build) => build.statistics.clone(),
            None => self.get(triangles).statistics(),
        }
    }

    /// The options that the grid is built with.
    pub fn options(&self) -> &GridOptions {
        &self.options
    }

    /// The number of triangles that the grid is made for.
    pub fn n_triangles(&self) -> usize {
        self.n_triangles
    }

    /// The least and the greatest corner of the grid's box, which holds all triangles, world units.
    pub fn bounds(&self) -> [Vec3; 2] {
        self.bounds
    }

    /// The greatest magnitude of a coordinate of a ray's origin up to which a search does not move the origin, world
    /// units.
    pub fn origin_reach(&self) -> f32 {
        self.origin_reach
    }
}
