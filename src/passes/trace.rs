//! Trace (the paper's section 2.3): each ray's closest hit through the kd-tree.

use std::sync::Arc;

use super::{Resources, kernel, spirv, traversal_constants};
use crate::{
    frame::RenderOptions,
    gpu::{Bindings, Commands, ComputePipeline, Context, GpuError},
    layout::Batch,
};

/// The pass's kernel.
pub struct Trace {
    kernel: ComputePipeline,
}

impl Trace {
    pub(super) fn new(
        context: &Arc<Context>,
        bindings: &Arc<Bindings>,
        options: &RenderOptions,
    ) -> Result<Self, GpuError> {
        let constants = traversal_constants(context, options.traversal, [options.profile, options.features])?;
        Ok(Self { kernel: kernel(context, bindings, "trace", spirv!("trace.comp"), &constants)? })
    }

    /// Needs rays. Leaves hits; updates counters, and pixel_features where the options ask for them.
    pub fn record(&self, commands: &Commands, resources: &Resources, batch: &Batch) {
        commands.dispatch(&self.kernel, Some(batch.depth), batch, resources.trace_dispatch(batch));
    }
}
