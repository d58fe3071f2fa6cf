//! Path compact: lists the paths that go on and those with a shadow ray, without gaps and in order, by a prefix sum.
//! The kernels path_scatter and compact_spine have made the sum.

use std::sync::Arc;

use super::{spine::Spine, spirv};
use crate::{
    buffers::Resources,
    gpu::{BindingLayout, Commands, ComputeDesc, ComputePipeline, Constants, Context, GpuError},
    layout::Batch,
};

/// The pipelines of the pass and of the prefix sum.
pub struct PathCompact {
    pub(super) spine: Spine,
    list: ComputePipeline,
}

impl PathCompact {
    pub(super) fn new(context: &Arc<Context>, bindings: &Arc<BindingLayout>) -> Result<Self, GpuError> {
        let kernel = |name, shader| {
            let desc = ComputeDesc { name, shader, constants: &Constants::new(), full_subgroups: true };
            ComputePipeline::new(context, bindings, &desc)
        };
        Ok(Self { spine: Spine::new(context, bindings)?, list: kernel("path_compact", spirv!("path_compact.comp"))? })
    }

    /// Needs `child_flags`, `scan_blocks` and the list of this bounce in `live_paths`. Leaves that of the next bounce
    /// and that of the shadow rays.
    pub fn record(&self, commands: &Commands, resources: &Resources, batch: &Batch) {
        commands.dispatch(&self.list, Some(batch.depth), batch, resources.scan_dispatch(batch));
    }
}
