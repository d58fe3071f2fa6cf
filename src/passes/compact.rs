//! Compact (the paper's section 2.1): the next level's rays, without gaps behind this one's, by a prefix sum.

use std::sync::Arc;

use super::spirv;
use crate::{
    buffers::Resources,
    gpu::{Access, Bindings, Commands, ComputeDesc, ComputePipeline, Context, Dispatch, GpuError},
    layout::Batch,
};

/// The pass's three kernels.
pub struct Compact {
    reduce: ComputePipeline,
    spine: ComputePipeline,
    scatter: ComputePipeline,
}

impl Compact {
    pub(super) fn new(context: &Arc<Context>, bindings: &Arc<Bindings>) -> Result<Self, GpuError> {
        let kernel = |name, shader| {
            let desc = ComputeDesc { name, shader, constants: &[], full_subgroups: true };
            ComputePipeline::new(context, bindings, &desc)
        };
        Ok(Self {
            reduce: kernel("compact_reduce", spirv!("compact_reduce.comp"))?,
            spine: kernel("compact_spine", spirv!("compact_spine.comp"))?,
            scatter: kernel("compact_scatter", spirv!("compact_scatter.comp"))?,
        })
    }

    /// Needs rays, hits. Leaves the next row of bounces and its rays, first_children.
    pub fn record(&self, commands: &Commands, resources: &Resources, batch: &Batch) {
        let bounce = Some(batch.depth);
        commands.dispatch(&self.reduce, bounce, batch, resources.scan_dispatch(batch));
        commands.barrier(Access::ComputeWrite, Access::ComputeUpdate); // child_kinds, scan_blocks
        commands.barrier(Access::IndirectRead, Access::ComputeWrite); // bounces
        commands.dispatch(&self.spine, bounce, batch, Dispatch::Threads([1, 1, 1], [1, 1, 1]));
        commands.barrier(Access::ComputeWrite, Access::ComputeRead); // scan_blocks, bounces
        commands.barrier(Access::ComputeWrite, Access::IndirectRead); // bounces
        commands.dispatch(&self.scatter, bounce, batch, resources.scan_dispatch(batch));
    }
}
