//! Grids. A uniform grid is a box that is cut into cubes of one size, its cells. Each cell has a list of the
//! triangles that come near to it. In a grid of two levels, each cell of the upper level is cut once more, into a
//! block of cells. The more triangles the upper cell has, the finer is its block.
//!
//! ```text
//! triangles ─> lattice ───> overlap ─────────> build ─> Grid
//!              size of the  pairs of a cell    pairs in the order
//!              cells        and a triangle     of the cells
//! ```
//!
//! The build is the twin of the kernels that build grids on a device (passes/grid): both make the same grid, bit for
//! bit. So its arithmetic is in f32, no result depends on a division's last bit, and all sums and sorts have a fixed
//! order.
//!
//! Kalojanov and Slusallek, "A parallel algorithm for construction of uniform grids", 2009; Kalojanov, Billeter and
//! Slusallek, "Two-level grids for ray tracing on GPUs", 2011.

mod build;
mod lattice;
mod overlap;
mod planes;
mod statistics;

use glam::Vec3;

pub use self::{lattice::Lattice, statistics::Statistics};
use crate::accel::Lazy;
use crate::layout::{AccelConstants, GRID_COLUMNS_PER_REFERENCE, GRID_MAX_COUNT, GridCell, Plane};

/// A grid over triangles, as the kernels read it. Only [`Grid::build`] makes one, and nothing can change it
/// afterwards.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    lattice: Lattice,
    n_levels: u32,
    cells: Vec<GridCell>,
    leaf_triangles: Vec<u32>,
    leaf_planes: Vec<Plane>,
    n_triangles: usize,
    n_coarser: u32,
    origin_reach: f32,
}

/// A grid that each device builds for itself.
pub type LazyGrid = Lazy<Grid>;

/// Build options of a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct GridOptions {
    /// The levels of cells, and the densities of their cells.
    pub levels: GridLevels,
    /// Limit of the number of references, as a multiple of the number of triangles, plus 1024. A grid that would have
    /// more references gets larger cells.
    pub max_references_per_triangle: u32,
    /// Second limit of the number of references; the smaller limit counts. One reference for each triangle is always
    /// allowed. A device lowers this limit to the number of references that the device can bind.
    pub max_references: u32,
}

/// Levels of a grid's cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GridLevels {
    /// One level.
    Uniform {
        /// The number of cells divided by the number of triangles.
        density: f32,
    },
    /// Two levels: each cell of the upper level is cut into a block of cells.
    Two {
        /// The number of cells of the upper level divided by the number of triangles.
        upper_density: f32,
        /// The number of cells of a block divided by the number of triangles of its upper cell.
        lower_density: f32,
    },
}

impl GridLevels {
    /// The number of levels.
    pub fn n_levels(&self) -> u32 {
        match self {
            Self::Uniform { .. } => 1,
            Self::Two { .. } => 2,
        }
    }

    /// The number of cells divided by the number of triangles, for the only level or the upper one.
    pub fn upper_density(&self) -> f32 {
        match *self {
            Self::Uniform { density } => density,
            Self::Two { upper_density, .. } => upper_density,
        }
    }
}

impl GridOptions {
    /// Returns the options of a uniform grid.
    pub fn uniform() -> Self {
        let levels = GridLevels::Uniform { density: 4.0 };
        Self { levels, max_references_per_triangle: 8, max_references: 1 << 28 }
    }

    /// Returns the options of a grid of two levels.
    pub fn two_level() -> Self {
        Self { levels: GridLevels::Two { upper_density: 1.0 / 32.0, lower_density: 2.0 }, ..Self::uniform() }
    }

    /// Returns the most references that a grid of `n_triangles` triangles may have.
    pub(crate) fn max_references_of(&self, n_triangles: usize) -> u32 {
        let n_triangles = n_triangles as u64;
        let most = n_triangles * u64::from(self.max_references_per_triangle) + 1024;
        most.min(u64::from(self.max_references)).max(n_triangles).min(u64::from(GRID_MAX_COUNT)) as u32
    }

    /// Returns the most columns of cells that all triangles may have together in a grid of at most `max_references`
    /// references. A triangle's columns are those of its bounds (overlap.rs).
    pub(crate) fn max_columns_of(max_references: u32) -> u32 {
        max_references.saturating_mul(GRID_COLUMNS_PER_REFERENCE).min(GRID_MAX_COUNT)
    }
}

impl Grid {
    /// Returns the uniform constants that kernels need in addition to the grid's arrays.
    pub fn constants(&self) -> AccelConstants {
        self.lattice.constants(self.origin_reach)
    }

    /// The lattice of the upper level's cells.
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// The number of levels of cells, 1 or 2.
    pub fn n_levels(&self) -> u32 {
        self.n_levels
    }

    /// The cells of the upper level, x fastest, then y. After them come the cells of the lower level, block by block
    /// in the order of the upper cells. [`GridCell`] says what the members mean.
    pub fn cells(&self) -> &[GridCell] {
        &self.cells
    }

    /// The indices of the triangles in the cells of the lowest level, cell after cell, ascending in each cell.
    pub fn leaf_triangles(&self) -> &[u32] {
        &self.leaf_triangles
    }

    /// The plane of each triangle in [`Grid::leaf_triangles`].
    pub fn leaf_planes(&self) -> &[Plane] {
        &self.leaf_planes
    }

    /// The least and the greatest corner of the grid's box, which holds all triangles, world units.
    pub fn bounds(&self) -> [Vec3; 2] {
        self.lattice.bounds()
    }

    /// The number of triangles that the grid was built from.
    pub fn n_triangles(&self) -> usize {
        self.n_triangles
    }
}
