//! What a grid holds.

use serde::Serialize;

use super::Grid;
use crate::layout::{GridCell, Plane};

/// A grid in numbers.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Statistics {
    /// The number of cells of the upper level along x, y and z.
    pub resolution: [u32; 3],
    /// The number of levels of cells, 1 or 2.
    pub n_levels: u32,
    /// Cells of the upper level.
    pub n_upper_cells: u64,
    /// Cells that hold triangles or could: those of the lowest level, and cells of the upper one that are not cut.
    pub n_cells: u64,
    /// Those of `n_cells` without triangles.
    pub n_empty_cells: u64,
    /// Entries of all cells.
    pub n_references: u64,
    /// References by the number of triangles; 0 for none.
    pub references_per_triangle: f64,
    /// How many times the edges of all cells had to be doubled to keep to the limits of memory.
    pub n_coarser: u32,
    /// Cells, leaves and their planes, in memory.
    pub bytes: u64,
}

impl Statistics {
    /// What so many cells, and so many references with their planes, take of memory.
    pub(crate) fn bytes_of(n_cells: usize, n_references: usize) -> u64 {
        (n_cells * size_of::<GridCell>() + n_references * (size_of::<u32>() + size_of::<Plane>())) as u64
    }
}

impl Grid {
    /// The grid in numbers.
    pub fn statistics(&self) -> Statistics {
        let n_upper = self.lattice.n_cubes();
        let (upper, lower) = self.cells.split_at(n_upper);
        let n_uncut = if self.n_levels == 1 { 0 } else { upper.iter().filter(|cell| cell.count == 0).count() };
        let lowest = if self.n_levels == 1 { upper } else { lower };
        Statistics {
            resolution: self.lattice.n_cells,
            n_levels: self.n_levels,
            n_upper_cells: n_upper as u64,
            n_cells: (lowest.len() + n_uncut) as u64,
            n_empty_cells: (lowest.iter().filter(|cell| cell.count == 0).count() + n_uncut) as u64,
            n_references: self.leaf_triangles.len() as u64,
            references_per_triangle: self.leaf_triangles.len() as f64 / self.n_triangles.max(1) as f64,
            n_coarser: self.n_coarser,
            bytes: Statistics::bytes_of(self.cells.len(), self.leaf_triangles.len()),
        }
    }
}
