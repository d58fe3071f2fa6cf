//! A grid of which the host knows how it is built. A device builds it for itself; the host does, too, when it needs the
//! grid. Both have the same bits.

use std::sync::OnceLock;

use glam::Vec3;
use serde::Serialize;

use super::{Grid, GridOptions, Statistics};
use crate::{accel::bounds::Bounds, layout::Triangle};

/// How a grid over some triangles is built, and what has been learnt of it so far.
#[derive(Clone, Debug, PartialEq)]
pub struct LazyGrid {
    options: GridOptions,
    n_triangles: usize,
    bounds: [Vec3; 2],
    on_host: OnceLock<Grid>,
    on_device: OnceLock<DeviceBuild>,
}

/// What a device tells of a grid that it has built.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DeviceBuild {
    /// The grid in numbers.
    #[serde(skip)]
    pub statistics: Statistics,
    /// The milliseconds of the build; none where the device has no timestamps.
    pub ms: Option<f64>,
    /// The stages in the order of execution.
    pub stages: Vec<BuildStage>,
}

/// A kernel of a build, all of its dispatches together.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BuildStage {
    /// The kernel's name.
    pub name: &'static str,
    /// Milliseconds; none where the device has no timestamps.
    pub ms: Option<f64>,
}

impl LazyGrid {
    /// Notes how the grid of these triangles is to be built.
    pub fn new(triangles: &[Triangle], options: GridOptions) -> Self {
        let bounds = Bounds::of_all(triangles);
        let Bounds { min, max } = bounds.grown(bounds.margin());
        Self {
            options,
            n_triangles: triangles.len(),
            bounds: [min.into(), max.into()],
            on_host: OnceLock::new(),
            on_device: OnceLock::new(),
        }
    }

    /// The host's grid. The first call builds it on the current rayon pool.
    ///
    /// # Panics
    /// There are more or fewer triangles than the grid is over.
    pub fn get(&self, triangles: &[Triangle]) -> &Grid {
        assert_eq!(triangles.len(), self.n_triangles, "the triangles of the grid");
        self.on_host.get_or_init(|| Grid::build(triangles, &self.options))
    }

    /// Keeps what a device tells of its build, if it is the first one.
    pub(crate) fn note(&self, build: DeviceBuild) {
        // Later builds are over the same triangles by the same options.
        let _ = self.on_device.set(build);
    }

    /// What the first device that has built the grid tells of it.
    pub fn device_build(&self) -> Option<&DeviceBuild> {
        self.on_device.get()
    }

    /// The grid in numbers, by a device that has built it. If there is none, the host builds the grid.
    pub fn statistics(&self, triangles: &[Triangle]) -> Statistics {
        match self.on_device.get() {
            Some(build) => build.statistics.clone(),
            None => self.get(triangles).statistics(),
        }
    }

    /// How the grid is built.
    pub fn options(&self) -> &GridOptions {
        &self.options
    }

    /// The number of triangles that the grid is over.
    pub fn n_triangles(&self) -> usize {
        self.n_triangles
    }

    /// The least and the greatest corner of the grid's box, which holds all triangles (world units).
    pub fn bounds(&self) -> [Vec3; 2] {
        self.bounds
    }
}
