//! Shadow (the paper's section 2.1): is there anything between a hit and a light?

use std::sync::Arc;

use super::{kernel, spirv, traversal_constants};
use crate::{
    buffers::Resources,
    frame::RenderOptions,
    gpu::{BindingLayout, Commands, ComputePipeline, Context, GpuError},
    layout::{Batch, constants},
};

/// The pass's kernel.
pub struct Shadow {
    kernel: ComputePipeline,
}

impl Shadow {
    pub(super) fn new(
        context: &Arc<Context>,
        bindings: &Arc<BindingLayout>,
        options: &RenderOptions,
    ) -> Result<Self, GpuError> {
        // Shade counts the segments.
        let constants = traversal_constants(context, options.traversal)?.set(constants::COUNT_COSTS, options.features);
        Ok(Self { kernel: kernel(context, bindings, "shadow", spirv!("shadow.comp"), &constants)? })
    }

    /// Needs rays, hits of all the batch's bounces. Leaves light_visibility, and marks where segments have stalled; updates
    /// pixel_features where the options ask for them. `batch.round` says which segments run.
    pub fn record(&self, commands: &Commands, resources: &Resources, batch: &Batch) {
        commands.dispatch(&self.kernel, None, batch, resources.shadow_dispatch(batch));
    }
}
