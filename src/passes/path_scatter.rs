//! Path scatter: adds the light that paths meet, samples lights at their hits, and the directions in which they go on.

use std::sync::Arc;

use super::spirv;
use crate::{
    buffers::Resources,
    gpu::{BindingLayout, Commands, ComputeDesc, ComputePipeline, Constants, Context, GpuError},
    layout::Batch,
};

/// The pipeline of the pass.
pub struct PathScatter {
    kernel: ComputePipeline,
}

impl PathScatter {
    pub(super) fn new(context: &Arc<Context>, bindings: &Arc<BindingLayout>) -> Result<Self, GpuError> {
        let shader = spirv!("path_scatter.comp");
        let desc = ComputeDesc { name: "path_scatter", shader, constants: &Constants::new(), full_subgroups: true };
        Ok(Self { kernel: ComputePipeline::new(context, bindings, &desc)? })
    }

    /// Needs `hits` and `live_paths` of the bounce. Updates `rays` and `path_states`. Leaves `shadow_rays`,
    /// `child_flags` and in `scan_blocks` the numbers of each block's paths that go on and that have a shadow ray.
    pub fn record(&self, commands: &Commands, resources: &Resources, batch: &Batch) {
        commands.dispatch(&self.kernel, Some(batch.depth), batch, resources.scan_dispatch(batch));
    }
}
