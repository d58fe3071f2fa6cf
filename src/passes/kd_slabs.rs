//! Slabs of a kd-tree: computes them on a device, for a tree that is there already. They are those of
//! [`accel::kdtree`](crate::accel::kdtree) but for rounding and for the mean of normals, which here does not depend on
//! an order. [`reference::kd_slabs`](crate::reference::kd_slabs) is the twin of these kernels on the CPU.
//!
//! ```text
//! begin          sizes the dispatches: only the device knows how many nodes and entries there are
//! ranges         nodes     the entries below each node, and the leaf of each entry
//! patches        nodes     cells, and the next candidate above each candidate and leaf
//! areas          entries   clips each triangle to its leaf: an area vector
//! normals        nodes     normals of candidates with few entries
//! large_normals            normals of larger candidates, a workgroup each
//! extents        entries   clips each triangle again: extents along the normals of all candidates above, by atomics
//! write          nodes     slabs of the candidates that are flat enough
//! ```
//!
//! kdtree/slab_build.glsl defines the terms. The result does not depend on the order of threads: sums have a fixed
//! order, and atomics only take minima and maxima, and list candidates that do not depend on one another.

use std::{mem::offset_of, sync::Arc};

use super::{ONE_GROUP, kernel, spirv, then};
use crate::{
    buffers::{KdSlabBuffers, TreeBuffers},
    gpu::{
        Access, CommandBuffer, Commands, ComputePipeline, Constants, Context, Dispatch, GpuError, Shader, Timer,
        TimerRow,
    },
    layout::{KD_SLAB_GROUPS, KdSlabBuild},
};

/// Kernels and memory that compute the slabs of a tree. The computation can be repeated any number of times.
pub struct SlabBuilder {
    context: Arc<Context>,
    buffers: KdSlabBuffers,
    begin: ComputePipeline,
    ranges: ComputePipeline,
    patches: ComputePipeline,
    areas: ComputePipeline,
    normals: ComputePipeline,
    large_normals: ComputePipeline,
    extents: ComputePipeline,
    write: ComputePipeline,
}

impl SlabBuilder {
    /// The number of a timer's rows that the computation needs, one per dispatch.
    pub const N_STAGES: u32 = 8;

    /// Creates the kernels, and memory for the most nodes and entries that the tree's buffers can hold.
    ///
    /// # Errors
    /// A buffer exceeds the device's limits; out of memory; the driver refuses a shader.
    pub fn new(context: &Arc<Context>, tree: &TreeBuffers) -> Result<Self, GpuError> {
        let bindings = KdSlabBuffers::bindings(context)?;
        let kernel = |name, shader: Shader| kernel(context, &bindings, name, shader, &Constants::new());
        Ok(Self {
            buffers: KdSlabBuffers::new(context, &bindings, tree)?,
            begin: kernel("kd_slab_begin", spirv!("kd_slab_begin.comp"))?,
            ranges: kernel("kd_slab_ranges", spirv!("kd_slab_ranges.comp"))?,
            patches: kernel("kd_slab_patches", spirv!("kd_slab_patches.comp"))?,
            areas: kernel("kd_slab_areas", spirv!("kd_slab_areas.comp"))?,
            normals: kernel("kd_slab_normals", spirv!("kd_slab_normals.comp"))?,
            large_normals: kernel("kd_slab_large_normals", spirv!("kd_slab_large_normals.comp"))?,
            extents: kernel("kd_slab_extents", spirv!("kd_slab_extents.comp"))?,
            write: kernel("kd_slab_write", spirv!("kd_slab_write.comp"))?,
            context: context.clone(),
        })
    }

    /// Records the computation. Needs all arrays of the tree but `slabs`. Leaves `slabs`, and updates `nodes`: those
    /// with slabs are marked.
    pub fn record(&self, commands: &Commands) {
        let of_nodes = || self.sized_by(offset_of!(KdSlabBuild, node_groups_x));
        let of_entries = || self.sized_by(offset_of!(KdSlabBuild, entry_groups_x));
        commands.bind(&self.buffers.set);
        self.begin(commands);
        then(commands);
        dispatch(commands, &self.ranges, of_nodes());
        then(commands);
        dispatch(commands, &self.patches, of_nodes());
        then(commands);
        dispatch(commands, &self.areas, of_entries());
        then(commands);
        dispatch(commands, &self.normals, of_nodes());
        then(commands);
        dispatch(commands, &self.large_normals, self.over_large());
        then(commands);
        dispatch(commands, &self.extents, of_entries());
        then(commands);
        dispatch(commands, &self.write, of_nodes());
    }

    /// Computes the slabs and waits for the device. `timer`: takes the times of the dispatches; it must have room for
    /// [`SlabBuilder::N_STAGES`] rows. Returns these times.
    ///
    /// # Errors
    /// Out of memory; a Vulkan call fails.
    pub fn build(&self, timer: Option<&Timer>) -> Result<Vec<TimerRow>, GpuError> {
        let commands = CommandBuffer::record(&self.context, "kd_slabs", timer, |commands| {
            commands.reset_timer();
            self.record(commands);
            commands.barrier(Access::ComputeWrite, Access::AnyUse); // nodes, slabs
        })?;
        self.context.wait_for(self.context.submit(vec![commands])?)?;
        timer.map_or(Ok(Vec::new()), Timer::rows)
    }

    /// Needs `tree`. Leaves the sizes of the dispatches, no large candidates, and no leaf for any entry.
    fn begin(&self, commands: &Commands) {
        let reset = || {
            commands.fill_buffer(self.buffers.entry_leaves.any(), u32::MAX);
            commands.barrier(Access::TransferWrite, Access::KernelUpdate); // entry_leaves
        };
        commands.dispatch_after(reset, &self.begin, None, &0u32, ONE_GROUP);
    }

    /// Returns the indirect dispatch whose size is at a byte offset of `build`.
    fn sized_by(&self, offset: usize) -> Dispatch<'_> {
        Dispatch::Indirect(self.buffers.build.any(), offset as u64)
    }

    /// Returns the dispatch over large candidates.
    fn over_large(&self) -> Dispatch<'static> {
        let n_groups = (self.buffers.entry_leaves.len() as u32).clamp(1, KD_SLAB_GROUPS);
        Dispatch::Threads([n_groups, 1, 1], [1, 1, 1])
    }
}

fn dispatch(commands: &Commands, kernel: &ComputePipeline, dispatch: Dispatch) {
    commands.dispatch(kernel, None, &0u32, dispatch);
}
