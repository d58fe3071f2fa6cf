//! Kd-tree: builds a kd-tree over triangles by the surface area heuristic, breadth-first, without the host.
//! [`reference::kdtree_build`](crate::reference::kdtree_build) is the twin of these kernels. The trees that
//! [`accel::kdtree`](crate::accel::kdtree) builds on the CPU differ: it tries more planes, and clips more exactly.
//!
//! ```text
//! bounds             finds the box of the triangles, and counts the finite ones
//! scales             counts how many triangles need each scale
//! root               opens the first level: the root's cell
//! gather             writes its references
//! each level, 0 to 32; without open cells, its dispatches have no workgroups
//!   bins             counts the references of large cells by bins
//!   choose           finds the split of each cell that is not small, a workgroup for up to four cells
//!   choose_small     finds the split of each small cell, an invocation a reference
//!   sort_out         finds each reference's sides of its cell's plane, and clips triangles that the plane cuts
//!   count_cells      counts splits, open children and references in leaves, and opens the next level
//!   split_cells      writes nodes and the cells of the next level
//!   scatter          writes the references of the next level, and those in leaves
//! sum                counts pairs and entries below each node
//! place              writes the nodes in depth-first order
//! leaves             writes the entries of leaves, with triangles and planes
//! slabs, if wanted   src/passes/kd_slabs.rs
//! relocate, if wanted   makes the indices those of arrays that hold several trees
//! ```
//!
//! Prefix sums give all places. Atomics only add, combine bits, find a least or greatest integer, or find which
//! workgroup or invocation comes last, and the result does not depend on which one that is. So the same device builds
//! the same tree, bit for bit. The last workgroup of `bounds`, `sort_out` and `count_cells` computes the prefix sums
//! over all blocks (kdtree_build/kd_spine.glsl). From the first group of a level's cells whose children would pass a
//! capacity on, all cells of the level become leaves.
//!
//! Zhou, Hou, Wang and Guo, "Real-time KD-tree construction on graphics hardware", 2008; Wu, Zhao and Liu, "SAH KD-tree
//! construction on GPU", 2011.

mod builder;

use std::{mem::offset_of, sync::Arc};

pub use self::builder::{BuiltTree, KdTreeBuilder, KdTreeBuilderOptions};
use super::{Kernels, ONE_GROUP, spirv, then};
use crate::{
    buffers::KdTreeBuffers,
    gpu::{Access, BindingLayout, Commands, ComputePipeline, Constants, Context, Dispatch, GpuError},
    layout::{
        KD_BIN_BLOCK, KD_BIN_WORDS, KD_BINS, KD_BLOCK_SIZE, KD_CHOOSE_BLOCK, KD_GROUPS_X, KD_ROWS, KD_SMALL_CELL,
        KdBuild, KdLevel, KdStage, SCAN_GROUP_SIZE, StructurePlace,
    },
};

/// All kernels of a build.
struct KdTreePasses {
    bounds: ComputePipeline,
    scales: ComputePipeline,
    root: ComputePipeline,
    gather: ComputePipeline,
    bins: ComputePipeline,
    choose: ComputePipeline,
    choose_small: ComputePipeline,
    sort_out: ComputePipeline,
    count_cells: ComputePipeline,
    split_cells: ComputePipeline,
    scatter: ComputePipeline,
    sum: ComputePipeline,
    place: ComputePipeline,
    leaves: ComputePipeline,
    relocate: ComputePipeline,
}

// What the kernels need of the constants of the layout.
const _: () = {
    assert!(KD_BINS == SCAN_GROUP_SIZE && KD_BIN_WORDS == 12 * KD_BINS);
    assert!(KD_SMALL_CELL <= SCAN_GROUP_SIZE && KD_SMALL_CELL <= KD_BIN_BLOCK);
    assert!(KD_CHOOSE_BLOCK.is_multiple_of(KD_SMALL_CELL));
    assert!(KD_BLOCK_SIZE == KD_ROWS * SCAN_GROUP_SIZE && KD_BLOCK_SIZE <= 1 << 10);
};

/// Dispatches before the first level, of a level, and after all levels.
const N_STAGES: [u32; 3] = [4, 7, 3];

impl KdTreePasses {
    /// Creates the pipelines.
    ///
    /// # Errors
    /// The driver refuses a shader.
    fn new(context: &Arc<Context>, bindings: &Arc<BindingLayout>) -> Result<Self, GpuError> {
        let kernels = Kernels { context, bindings };
        let none = Constants::new();
        Ok(Self {
            bounds: kernels.of_blocks("kdtree_bounds", spirv!("kdtree_bounds.comp"), &none)?,
            scales: kernels.of_blocks("kdtree_scales", spirv!("kdtree_scales.comp"), &none)?,
            root: kernels.of_one("kdtree_root", spirv!("kdtree_root.comp"), &none)?,
            gather: kernels.of_blocks("kdtree_gather", spirv!("kdtree_gather.comp"), &none)?,
            bins: kernels.of_blocks("kdtree_bins", spirv!("kdtree_bins.comp"), &none)?,
            choose: kernels.of_blocks("kdtree_choose", spirv!("kdtree_choose.comp"), &none)?,
            choose_small: kernels.of_blocks("kdtree_choose_small", spirv!("kdtree_choose_small.comp"), &none)?,
            sort_out: kernels.of_blocks("kdtree_sort_out", spirv!("kdtree_sort_out.comp"), &none)?,
            count_cells: kernels.of_blocks("kdtree_count_cells", spirv!("kdtree_count_cells.comp"), &none)?,
            split_cells: kernels.of_blocks("kdtree_split_cells", spirv!("kdtree_split_cells.comp"), &none)?,
            scatter: kernels.of_blocks("kdtree_scatter", spirv!("kdtree_scatter.comp"), &none)?,
            sum: kernels.of_blocks("kdtree_sum", spirv!("kdtree_sum.comp"), &none)?,
            place: kernels.of_blocks("kdtree_place", spirv!("kdtree_place.comp"), &none)?,
            leaves: kernels.of_blocks("kdtree_leaves", spirv!("kdtree_leaves.comp"), &none)?,
            relocate: kernels.of_blocks("kdtree_relocate", spirv!("kdtree_relocate.comp"), &none)?,
        })
    }

    /// Returns the number of dispatches of a build of levels 0 to `max_depth`.
    fn n_stages(max_depth: u32) -> u32 {
        let [before, of_level, after] = N_STAGES;
        before + of_level * (max_depth + 1) + after
    }

    /// Records what comes before the first level. Needs the first `n_triangles` of `triangles`. Leaves the root's
    /// level, its cell, and its references.
    fn setup(&self, commands: &Commands, buffers: &KdTreeBuffers, n_triangles: u32) {
        let reset = || {
            commands.update_buffer(buffers.build.any(), &[KdBuild { n_triangles, ..*buffers.initial() }]);
            for buffer in [buffers.levels.any(), buffers.scale_counts.any(), buffers.bins.any()] {
                commands.clear_buffer(buffer);
            }
            commands.barrier(Access::TransferWrite, Access::KernelUpdate); // build, levels, scale_counts, bins
        };
        let blocks = || over_blocks(n_triangles);
        let none = KdStage::default();
        commands.bind(buffers.set_of(0));
        commands.dispatch_after(reset, &self.bounds, None, &none, blocks());
        then(commands);
        commands.dispatch(&self.scales, None, &none, blocks());
        then(commands);
        commands.dispatch(&self.root, None, &none, ONE_GROUP);
        then(commands);
        commands.dispatch(&self.gather, None, &none, blocks());
        then(commands);
    }

    /// Records a level. Needs its record in `levels`, `cells_from`, `references_from` and `bins` of zeros. Leaves the
    /// same for the next level, and the nodes and leaves of this one.
    fn level(&self, commands: &Commands, buffers: &KdTreeBuffers, level_ix: u32) {
        let run = |kernel: &ComputePipeline, groups: usize| {
            let offset = level_ix as usize * size_of::<KdLevel>() + groups;
            let dispatch = Dispatch::Indirect(buffers.levels.any(), offset as u64);
            commands.dispatch(kernel, Some(level_ix), &KdStage { level_ix }, dispatch);
        };
        let cells = offset_of!(KdLevel, cell_groups_x);
        commands.bind(buffers.set_of(level_ix));
        run(&self.bins, offset_of!(KdLevel, bin_groups_x));
        then(commands);
        run(&self.choose, offset_of!(KdLevel, choose_groups_x));
        run(&self.choose_small, offset_of!(KdLevel, small_groups_x)); // of other cells: no barrier
        then(commands);
        run(&self.sort_out, offset_of!(KdLevel, block_groups_x));
        then(commands);
        run(&self.count_cells, cells);
        then(commands);
        run(&self.split_cells, cells);
        run(&self.scatter, offset_of!(KdLevel, reference_groups_x)); // of other arrays: no barrier
        then(commands);
    }

    /// Records what comes after the last level. Needs the built nodes, and the references in leaves. Leaves `nodes`,
    /// `parents`, `leaf_triangles` and `leaf_planes`.
    fn finish(&self, commands: &Commands, buffers: &KdTreeBuffers) {
        let run = |kernel: &ComputePipeline, groups: usize| {
            let dispatch = Dispatch::Indirect(buffers.build.any(), groups as u64);
            commands.dispatch(kernel, None, &KdStage::default(), dispatch);
        };
        let pairs = offset_of!(KdBuild, pair_groups_x);
        run(&self.sum, pairs);
        then(commands);
        run(&self.place, pairs);
        then(commands);
        run(&self.leaves, offset_of!(KdBuild, entry_groups_x));
    }

    /// Records the relocation of a tree of at most `n` nodes and entries. Needs `build`. Updates `nodes`, `parents` and
    /// `leaf_triangles`.
    fn relocate(&self, commands: &Commands, buffers: &KdTreeBuffers, n: u32, place: &StructurePlace) {
        commands.bind(buffers.set_of(0));
        commands.dispatch(&self.relocate, None, place, over_blocks(n));
    }
}

/// Returns a dispatch of a workgroup for each block of `n` entries.
fn over_blocks(n: u32) -> Dispatch<'static> {
    let n_groups = n.div_ceil(KD_BLOCK_SIZE);
    Dispatch::Threads([n_groups.min(KD_GROUPS_X), n_groups.div_ceil(KD_GROUPS_X), 1], [1, 1, 1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{gpu::Shader, passes::tests::n_contractible};

    #[test]
    fn no_arithmetic_may_be_contracted() {
        let kernels = [
            spirv!("kdtree_bins.comp"),
            spirv!("kdtree_choose.comp"),
            spirv!("kdtree_choose_small.comp"),
            spirv!("kdtree_gather.comp"),
            spirv!("kdtree_leaves.comp"),
            spirv!("kdtree_root.comp"),
            spirv!("kdtree_scales.comp"),
            spirv!("kdtree_sort_out.comp"),
        ];
        for Shader { file, spirv } in kernels {
            assert_eq!(n_contractible(spirv), 0, "{file}");
        }
    }
}
