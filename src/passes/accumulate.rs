//! Accumulate: the mean of the samples so far.

use std::sync::Arc;

use super::{kernel, spirv};
use crate::{
    buffers::Resources,
    gpu::{BindingLayout, Commands, ComputePipeline, Constants, Context, GpuError},
    layout::Batch,
};

/// The pass's kernel.
pub struct Accumulate {
    kernel: ComputePipeline,
}

impl Accumulate {
    pub(super) fn new(context: &Arc<Context>, bindings: &Arc<BindingLayout>) -> Result<Self, GpuError> {
        Ok(Self { kernel: kernel(context, bindings, "accumulate", spirv!("accumulate.comp"), &Constants::new())? })
    }

    /// Needs pixel_radiance (a sample), pixel_accumulated (the sum of those before it), bounces. Leaves
    /// pixel_accumulated (with the sample), pixel_radiance (the mean).
    pub fn record(&self, commands: &Commands, resources: &Resources) {
        commands.dispatch(&self.kernel, None, &Batch::default(), resources.pixel_dispatch());
    }
}
