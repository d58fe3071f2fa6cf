//! Triangles to a grid: a box cut into cubes of one size, of which each has the list of its triangles; and in a grid of two
//! levels, each such cube is cut once more, the finer the more triangles it has.
//!
//! ```text
//! triangles ─> lattice ───> overlap ─────────> build ─> Grid
//!              size of the  pairs of a cell    pairs in the order
//!              cells        and a triangle     of the cells
//! ```
//!
//! The build is the twin of the kernels that build grids on a device. So its arithmetic is that of f32, it has no division
//! whose last bit matters, and the order of all that it adds up or sorts is fixed.
//!
//! Kalojanov and Slusallek, "A parallel algorithm for construction of uniform grids", 2009; Kalojanov, Billeter and Slusallek,
//! "Two-level grids for ray tracing on GPUs", 2011.

mod build;
mod lattice;
mod lazy;
mod overlap;
mod planes;
mod statistics;

use glam::Vec3;

pub use self::{lattice::Lattice, lazy::LazyGrid, statistics::Statistics};
use crate::layout::{
    AccelConstants, GRID_MAX_BLOCK_RESOLUTION, GRID_MAX_RESOLUTION, GridCell, KD_PLANE_EPSILON, Plane,
};

/// A grid over triangles, as the kernels read it. It comes from [`Grid::build`] alone, and nothing can change it afterwards.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    lattice: Lattice,
    n_levels: u32,
    cells: Vec<GridCell>,
    leaf_triangles: Vec<u32>,
    leaf_planes: Vec<Plane>,
    n_triangles: usize,
    n_coarser: u32,
}

/// How a grid is built.
#[derive(Clone, Debug, PartialEq)]
pub struct GridOptions {
    /// How many levels of cells there are, 1 or 2.
    pub n_levels: u32,
    /// The number of cells for each triangle, in a grid of one level.
    pub density: f32,
    /// The number of cells of the upper level for each triangle, in a grid of two levels.
    pub upper_density: f32,
    /// The number of cells of the lower level for each triangle of a cell of the upper one.
    pub lower_density: f32,
    /// The most references, as a multiple of the triangles; 1024 more are allowed in any case. Where a grid would have more,
    /// its cells become larger.
    pub max_references_per_triangle: u32,
}

impl GridOptions {
    /// A uniform grid.
    pub fn uniform() -> Self {
        Self { n_levels: 1, density: 4.0, upper_density: 0.125, lower_density: 2.0, max_references_per_triangle: 16 }
    }

    /// A grid of two levels.
    pub fn two_level() -> Self {
        Self { n_levels: 2, ..Self::uniform() }
    }

    /// The most references that a grid of so many triangles may have.
    fn max_references(&self, n_triangles: usize) -> u64 {
        (n_triangles as u64 * u64::from(self.max_references_per_triangle) + 1024).min(1 << 28).max(n_triangles as u64)
    }
}

impl Grid {
    /// What kernels know of a grid beside its arrays.
    pub fn constants(&self) -> AccelConstants {
        let Lattice { min, max, cell_size, n_cells } = self.lattice;
        let (cell_min, cell_max) = (Vec3::from(min), Vec3::from(max));
        AccelConstants {
            cell_min,
            plane_epsilon: KD_PLANE_EPSILON * cell_min.abs().max(cell_max.abs()).max_element(),
            cell_max,
            n_cells_x: n_cells[0],
            n_cells_y: n_cells[1],
            n_cells_z: n_cells[2],
            cell_size,
            ..AccelConstants::default()
        }
    }

    /// The cells of the upper level.
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// The number of levels of cells, 1 or 2.
    pub fn n_levels(&self) -> u32 {
        self.n_levels
    }

    /// The cells of the upper level, x fastest, then y; after them the cells of the lower level, block by block in the
    /// order of the upper cells. See [`GridCell`] for what a cell says.
    pub fn cells(&self) -> &[GridCell] {
        &self.cells
    }

    /// The triangles' indices, cell after cell, ascending in each cell.
    pub fn leaf_triangles(&self) -> &[u32] {
        &self.leaf_triangles
    }

    /// The plane of each of [`Grid::leaf_triangles`].
    pub fn leaf_planes(&self) -> &[Plane] {
        &self.leaf_planes
    }

    /// The least and the greatest corner of the grid's box, which holds all triangles (world units).
    pub fn bounds(&self) -> [Vec3; 2] {
        self.lattice.bounds()
    }

    /// The number of triangles that the grid was built from.
    pub fn n_triangles(&self) -> usize {
        self.n_triangles
    }
}
