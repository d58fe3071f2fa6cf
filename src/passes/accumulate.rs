//! Accumulate: turns each pixel's sample into the mean of all samples so far.

use std::sync::Arc;

use super::{kernel, spirv};
use crate::{
    buffers::Resources,
    gpu::{BindingLayout, Commands, ComputePipeline, Constants, Context, GpuError},
    layout::Batch,
};

/// The pipeline of the pass.
pub struct Accumulate {
    kernel: ComputePipeline,
}

impl Accumulate {
    pub(super) fn new(context: &Arc<Context>, bindings: &Arc<BindingLayout>) -> Result<Self, GpuError> {
        Ok(Self { kernel: kernel(context, bindings, "accumulate", spirv!("accumulate.comp"), &Constants::new())? })
    }

    /// Needs `pixel_radiance` with the sample, `pixel_accumulated` with the sum of the samples before it, and
    /// `bounces`. Leaves the sum of all samples in `pixel_accumulated` and their mean in `pixel_radiance`. If a
    /// bounce of the frame has overflowed, it leaves both as they are.
    pub fn record(&self, commands: &Commands, resources: &Resources) {
        commands.dispatch(&self.kernel, None, &Batch::default(), resources.layer_dispatch());
    }
}
