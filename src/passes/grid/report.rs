//! Statistics and times of a grid that a device has built.

use super::BuiltGrid;
use crate::{
    accel::{self, DeviceBuild, grid::Statistics},
    layout::AccelConstants,
    passes::device_build,
};

impl BuiltGrid {
    /// The numbers of cells and of entries.
    pub fn sizes(&self) -> (usize, usize) {
        (self.n_cells as usize, self.n_references as usize)
    }

    /// Returns the constants for kernels that trace rays through the grid. `origin_reach`: that of the grid's triangles
    /// (accel/kdtree/scales.rs), world units.
    pub fn constants(&self, origin_reach: f32) -> AccelConstants {
        self.lattice.constants(origin_reach)
    }

    /// Returns the grid's statistics, which are the same as those of the host's grid.
    pub fn statistics(&self, n_triangles: usize) -> Statistics {
        let n_upper = self.lattice.n_cubes() as u64;
        let [n_filled_upper, n_filled_lower] = self.n_filled.map(u64::from);
        // An upper cell with triangles is cut, and its lower cells count in its place. An empty one counts as one
        // cell.
        let (n_cells, n_filled) = match self.n_levels {
            1 => (n_upper, n_filled_upper),
            _ => (u64::from(self.n_cells) - n_filled_upper, n_filled_lower),
        };
        let n_references = u64::from(self.n_references);
        Statistics {
            resolution: self.lattice.n_cells,
            n_levels: self.n_levels,
            n_upper_cells: n_upper,
            n_cells,
            n_empty_cells: n_cells - n_filled,
            n_references,
            references_per_triangle: n_references as f64 / n_triangles.max(1) as f64,
            n_coarser: self.n_coarser,
            bytes: Statistics::bytes_of(self.n_cells as usize, self.n_references as usize),
        }
    }

    /// Returns the grid's statistics and the times of its build, by kernel.
    pub fn report(&self, n_triangles: usize) -> DeviceBuild {
        device_build::report(accel::Statistics::Grid(self.statistics(n_triangles)), &self.stages)
    }
}
