//! Path accumulate: adds the sum of the frame's samples to those of earlier frames, and replaces it by the mean of all.

use std::sync::Arc;

use super::{kernel, spirv};
use crate::{
    buffers::Resources,
    gpu::{BindingLayout, Commands, ComputePipeline, Constants, Context, GpuError},
    layout::Batch,
};

/// The pipeline of the pass.
pub struct PathAccumulate {
    kernel: ComputePipeline,
}

impl PathAccumulate {
    pub(super) fn new(context: &Arc<Context>, bindings: &Arc<BindingLayout>) -> Result<Self, GpuError> {
        let shader = spirv!("path_accumulate.comp");
        Ok(Self { kernel: kernel(context, bindings, "path_accumulate", shader, &Constants::new())? })
    }

    /// Updates `pixel_accumulated` and `pixel_radiance`.
    pub fn record(&self, commands: &Commands, resources: &Resources) {
        commands.dispatch(&self.kernel, None, &Batch::default(), resources.layer_dispatch());
    }
}
