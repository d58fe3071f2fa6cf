//! Grid: builds a uniform grid or a grid of two levels over triangles, in one command buffer.
//! [`accel::grid`](crate::accel::grid) is the twin of these kernels on the CPU: both make the same grid, bit for bit.
//!
//! ```text
//! bounds             finds the box of the triangles
//! lattice            chooses the size of the cells
//! each level
//!   descend          (lower level) turns the pairs of the upper level into the items of the lower level
//!   4 attempts       each with larger cells than the one before, until no count exceeds its limit
//!     resolutions    (lower level) chooses into how many cells each upper cell is cut
//!     columns        counts the columns of cells in each item's box
//!     count          counts the pairs of a cell and a triangle in each column
//!   emit             writes the pairs
//!   sort             puts the pairs in the order of their cells, digit by digit
//!   cells            finds each cell's pairs
//!   blocks           (lower level) writes into each upper cell where its lower cells are
//! leaves             writes triangles and planes in the order of the pairs
//! relocate, if wanted   makes the indices those of arrays that hold several grids
//! ```
//!
//! An item is a triangle with a lattice, into whose cells the triangle is put. At the upper level, this is the
//! lattice of the whole grid. At the lower level, it is the lattice into which an upper cell is cut, the block of
//! that cell. A pair is a cell and a triangle in it. A column is a line of cells along one axis within the box of an
//! item.
//!
//! Scans find where each item's columns and each column's pairs begin, so that the order of all pairs is fixed. A
//! scan is two kernels. The one that counts also writes the sum of each block of entries, and each entry's position
//! within its block. The spine then turns the sums into the positions of the blocks. Kernels that read a position
//! add the two. (These blocks have nothing to do with the blocks of upper cells.) A pass of the sort has three
//! kernels, as compaction has: the third computes the positions within the blocks.
//!
//! The spine also compares the total with its limit and sizes the dispatches that follow: either the next count of
//! the attempt, or another attempt with larger cells. When everything is counted, the counting kernels of further
//! attempts have no workgroups, and their spines do nothing.
//!
//! Kalojanov and Slusallek, "A parallel algorithm for construction of uniform grids", 2009; Kalojanov, Billeter and
//! Slusallek, "Two-level grids for ray tracing on GPUs", 2011.

mod builder;
mod level;
mod report;

use std::{mem::offset_of, sync::Arc};

pub use self::builder::{BuiltGrid, GridBuilder};
use self::level::Level;
use super::{Kernels, ONE_GROUP, spirv, then};
use crate::{
    buffers::{GridBuffers, GridCapacities, PairSets},
    gpu::{Access, BindingLayout, Commands, ComputePipeline, Constants, Context, Dispatch, GpuError},
    layout::{
        GRID_BLOCK_SIZE, GRID_GROUPS_X, GRID_MAX_ATTEMPTS, GRID_SCANS_CELLS, GridBuild, GridSort, StructurePlace,
        constants,
    },
};

/// All kernels of a build.
struct GridPasses {
    bounds: ComputePipeline,
    lattice: ComputePipeline,
    upper: Level,
    /// None for a uniform grid.
    lower: Option<Lower>,
    leaves: ComputePipeline,
    relocate: ComputePipeline,
}

/// The kernels of the lower level.
struct Lower {
    descend: ComputePipeline,
    cut: Cut,
    level: Level,
    blocks: ComputePipeline,
}

/// The kernels that cut the upper cells, before each attempt at the lower level.
struct Cut {
    resolutions: ComputePipeline,
    spine: ComputePipeline,
}

impl GridPasses {
    /// Creates the pipelines for a grid of `n_levels` levels, 1 or 2.
    ///
    /// # Errors
    /// The driver refuses a shader.
    fn new(context: &Arc<Context>, bindings: &Arc<BindingLayout>, n_levels: u32) -> Result<Self, GpuError> {
        let none = Constants::new();
        let levels = Constants::new().set(constants::LOWER_LEVEL, n_levels == 2);
        let kernels = Kernels { context, bindings };
        let lower = if n_levels == 2 { Some(Lower::new(&kernels)?) } else { None };
        Ok(Self {
            bounds: kernels.of_blocks("grid_bounds", spirv!("grid_bounds.comp"), &none)?,
            lattice: kernels.of_one("grid_lattice", spirv!("grid_lattice.comp"), &none)?,
            upper: Level::upper(&kernels)?,
            lower,
            leaves: kernels.of_blocks("grid_leaves", spirv!("grid_leaves.comp"), &none)?,
            relocate: kernels.of_blocks("grid_relocate", spirv!("grid_relocate.comp"), &levels)?,
        })
    }

    /// Records the build. Needs the first `triangles`, as many as `own` says. Leaves `build`, `cells`, `leaf_triangles`
    /// and `leaf_planes`.
    fn record(&self, commands: &Commands, buffers: &GridBuffers, own: &GridCapacities) {
        commands.bind(buffers.levels[0].writing_unsorted());
        self.bounds(commands, buffers, own);
        then(commands);
        dispatch(commands, &self.lattice, ONE_GROUP);
        then(commands);
        self.upper.record(commands, buffers, &buffers.levels[0], None);
        if let Some(lower) = &self.lower {
            then(commands);
            dispatch(commands, &lower.descend, ONE_GROUP);
            then(commands);
            lower.level.record(commands, buffers, &buffers.levels[1], Some(&lower.cut));
            then(commands);
            dispatch(commands, &lower.blocks, sized_by(buffers, offset_of!(GridBuild, counted_cell_groups_x)));
        }
        // No barrier: the kernel `leaves` reads nothing that the kernels `cells` and `blocks` write.
        dispatch(commands, &self.leaves, sized_by(buffers, offset_of!(GridBuild, counted_pair_groups_x)));
    }

    /// Returns the number of dispatches of a build.
    fn n_stages(&self, buffers: &GridBuffers) -> u32 {
        let of_level = |sets: &PairSets| Level::n_stages(sets);
        let own = if self.lower.is_some() { 5 + 2 * GRID_MAX_ATTEMPTS } else { 3 };
        own + buffers.levels.iter().map(of_level).sum::<u32>()
    }

    /// Needs `triangles`. Leaves their bounding box in `build`, and `cells` cleared to zero.
    fn bounds(&self, commands: &Commands, buffers: &GridBuffers, own: &GridCapacities) {
        let reset = || {
            commands.update_buffer(buffers.build.any(), &[buffers.initial(own)]);
            commands.clear_buffer(buffers.cells.any());
            commands.barrier(Access::TransferWrite, Access::KernelUpdate); // build, cells
        };
        commands.dispatch_after(reset, &self.bounds, None, &GridSort::default(), over_blocks(own.n_triangles));
    }

    /// Records the relocation of a grid of at most `n` cells and entries. Needs `build`. Updates `cells` and
    /// `leaf_triangles`.
    fn relocate(&self, commands: &Commands, buffers: &GridBuffers, n: u32, place: &StructurePlace) {
        commands.bind(buffers.levels[0].writing_unsorted());
        commands.dispatch(&self.relocate, None, place, over_blocks(n));
    }
}

impl Lower {
    fn new(kernels: &Kernels) -> Result<Self, GpuError> {
        let lower = Constants::new().set(constants::LOWER_LEVEL, true);
        let scans_cells = lower.clone().set(constants::SCANS, GRID_SCANS_CELLS);
        Ok(Self {
            descend: kernels.of_one("grid_descend", spirv!("grid_descend.comp"), &lower)?,
            cut: Cut {
                resolutions: kernels.of_blocks("grid_resolutions", spirv!("grid_resolutions.comp"), &lower)?,
                spine: kernels.of_blocks("grid_spine_cells", spirv!("grid_spine.comp"), &scans_cells)?,
            },
            level: Level::lower(kernels)?,
            blocks: kernels.of_blocks("grid_blocks", spirv!("grid_blocks.comp"), &lower)?,
        })
    }
}

impl Cut {
    /// Needs `build` and `cells`. Leaves `blocks`, and in `build` the number of lower cells and the sizes of the
    /// attempt's next dispatches.
    fn record(&self, commands: &Commands, buffers: &GridBuffers, attempt: u32) {
        let cells = sized_by(buffers, offset_of!(GridBuild, cell_groups_x));
        commands.dispatch(&self.resolutions, Some(attempt), &GridSort::default(), cells);
        then(commands);
        commands.dispatch(&self.spine, Some(attempt), &GridSort::default(), ONE_GROUP);
        then(commands);
    }
}

/// Returns a dispatch of a workgroup for each block of `n` entries.
fn over_blocks(n: u32) -> Dispatch<'static> {
    let n_groups = n.div_ceil(GRID_BLOCK_SIZE);
    Dispatch::Threads([n_groups.min(GRID_GROUPS_X), n_groups.div_ceil(GRID_GROUPS_X), 1], [1, 1, 1])
}

/// Returns the indirect dispatch whose size is at a byte offset of `build`.
fn sized_by(buffers: &GridBuffers, offset: usize) -> Dispatch<'_> {
    Dispatch::Indirect(buffers.build.any(), offset as u64)
}

fn dispatch(commands: &Commands, kernel: &ComputePipeline, dispatch: Dispatch) {
    commands.dispatch(kernel, None, &GridSort::default(), dispatch);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{gpu::Shader, passes::tests::n_contractible};

    #[test]
    fn no_arithmetic_may_be_contracted() {
        let kernels = [
            spirv!("grid_columns.comp"),
            spirv!("grid_count.comp"),
            spirv!("grid_emit.comp"),
            spirv!("grid_lattice.comp"),
            spirv!("grid_leaves.comp"),
            spirv!("grid_resolutions.comp"),
            spirv!("grid_spine.comp"),
        ];
        for Shader { file, spirv } in kernels {
            assert_eq!(n_contractible(spirv), 0, "{file}");
        }
        assert!(n_contractible(spirv!("shade.comp").spirv) > 0, "shading is not precise");
    }
}
