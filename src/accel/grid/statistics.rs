//! Statistics of grids.

use serde::Serialize;

use super::Grid;
use crate::layout::{GridCell, Plane};

/// Statistics of a grid.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Statistics {
    /// The number of cells of the upper level along x, y and z. Of the grids of several geometries, the greatest.
    pub resolution: [u32; 3],
    /// The number of levels of cells, 1 or 2.
    pub n_levels: u32,
    /// The number of cells of the upper level.
    pub n_upper_cells: u64,
    /// The number of cells that hold triangles or could hold some: those of the lowest level, and those of the upper
    /// level that are not cut.
    pub n_cells: u64,
    /// The number of cells in `n_cells` without triangles.
    pub n_empty_cells: u64,
    /// References: entries of all cells.
    pub n_references: u64,
    /// References divided by the number of triangles; 0 if there are no triangles.
    pub references_per_triangle: f64,
    /// The number of times that the cells' edges were doubled to keep to the limits of memory. With two levels, this
    /// is the number of the upper level's doublings plus that of the halvings of all blocks' resolutions. Of several
    /// grids, the greatest.
    pub n_coarser: u32,
    /// Size of cells, entries and their planes as the host stores them, bytes.
    pub bytes: u64,
}

impl Statistics {
    /// Adds the figures of another grid, but for `n_levels` and `references_per_triangle`.
    pub(in crate::accel) fn add(&mut self, other: &Self) {
        self.resolution = [0, 1, 2].map(|axis| self.resolution[axis].max(other.resolution[axis]));
        self.n_upper_cells += other.n_upper_cells;
        self.n_cells += other.n_cells;
        self.n_empty_cells += other.n_empty_cells;
        self.n_references += other.n_references;
        self.n_coarser = self.n_coarser.max(other.n_coarser);
        self.bytes += other.bytes;
    }

    /// Returns the size of a grid's cells, and of its references with their planes, as the host stores them, bytes.
    pub(crate) fn bytes_of(n_cells: usize, n_references: usize) -> u64 {
        (n_cells * size_of::<GridCell>() + n_references * (size_of::<u32>() + size_of::<Plane>())) as u64
    }
}

impl Grid {
    /// Computes the grid's statistics.
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
