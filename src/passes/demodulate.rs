//! Demodulate: divides the light of each pixel by the albedo of what it shows, and estimates its variance.

use std::sync::Arc;

use super::{kernel, spirv};
use crate::{
    buffers::Resources,
    gpu::{BindingLayout, Commands, ComputePipeline, Constants, Context, GpuError},
    layout::Batch,
};

/// The pipeline of the pass.
pub struct Demodulate {
    kernel: ComputePipeline,
}

impl Demodulate {
    pub(super) fn new(context: &Arc<Context>, bindings: &Arc<BindingLayout>) -> Result<Self, GpuError> {
        Ok(Self { kernel: kernel(context, bindings, "demodulate", spirv!("demodulate.comp"), &Constants::new())? })
    }

    /// Needs `pixel_radiance` and `pixel_aux`. Leaves the second half of `pixel_filtered`.
    pub fn record(&self, commands: &Commands, resources: &Resources) {
        commands.dispatch(&self.kernel, None, &Batch::default(), resources.pixel_dispatch());
    }
}
