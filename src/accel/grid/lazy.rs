//! A grid that the host builds when it needs it: a device builds its own, of the same bits.

use std::sync::OnceLock;

use glam::Vec3;

use super::{Grid, GridOptions};
use crate::{accel::bounds::Bounds, layout::Triangle};

/// How a grid over some triangles is built, and the host's grid as soon as it has been asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct LazyGrid {
    options: GridOptions,
    n_triangles: usize,
    bounds: [Vec3; 2],
    built: OnceLock<Grid>,
}

impl LazyGrid {
    /// Notes how the grid of these triangles is to be built.
    pub fn new(triangles: &[Triangle], options: GridOptions) -> Self {
        let bounds = Bounds::of_all(triangles);
        let Bounds { min, max } = bounds.grown(bounds.margin());
        Self { options, n_triangles: triangles.len(), bounds: [min.into(), max.into()], built: OnceLock::new() }
    }

    /// The host's grid. The first call builds it on the current rayon pool.
    ///
    /// # Panics
    /// There are more or fewer triangles than the grid is over.
    pub fn get(&self, triangles: &[Triangle]) -> &Grid {
        assert_eq!(triangles.len(), self.n_triangles, "the triangles of the grid");
        self.built.get_or_init(|| Grid::build(triangles, &self.options))
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
