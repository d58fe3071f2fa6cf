//! Spine: the second step of compaction, a prefix sum over the counts of all blocks by one workgroup.

use std::sync::Arc;

use super::spirv;
use crate::{
    gpu::{BindingLayout, Commands, ComputeDesc, ComputePipeline, Constants, Context, Dispatch, GpuError},
    layout::{Batch, SCAN_GROUP_SIZE, SPINE_MOST_INVOCATIONS, constants},
};

/// The pipeline of the step.
pub struct Spine {
    kernel: ComputePipeline,
}

impl Spine {
    pub(super) fn new(context: &Arc<Context>, bindings: &Arc<BindingLayout>) -> Result<Self, GpuError> {
        let constants = Constants::new().set(constants::SCAN_SIZE, group_size(context));
        let shader = spirv!("compact_spine.comp");
        let desc = ComputeDesc { name: "compact_spine", shader, constants: &constants, full_subgroups: true };
        Ok(Self { kernel: ComputePipeline::new(context, bindings, &desc)? })
    }

    /// Needs `scan_blocks`. Leaves their exclusive prefix sums there, and the next bounce's row of `bounces`. The row
    /// of this bounce gets its number of shadow rays.
    pub fn record(&self, commands: &Commands, batch: &Batch) {
        commands.dispatch(&self.kernel, Some(batch.depth), batch, Dispatch::Threads([1, 1, 1], [1, 1, 1]));
    }
}

/// Returns the number of invocations of the workgroup. A software driver runs them one after the other, so that a
/// barrier costs more with more invocations.
fn group_size(context: &Context) -> u32 {
    let most = context.limits().group_size.min(SPINE_MOST_INVOCATIONS);
    if context.predicates_branches() { SCAN_GROUP_SIZE } else { 1 << most.ilog2() }
}
