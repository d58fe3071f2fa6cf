//! Denoise (the paper's section 2.4): smooths pixels that differ much from their neighbours.

use std::sync::Arc;

use super::{kernel, spirv};
use crate::{
    buffers::Resources,
    gpu::{BindingLayout, Commands, ComputePipeline, Constants, Context, GpuError},
    layout::Batch,
};

/// The pipeline of the pass.
pub struct Denoise {
    kernel: ComputePipeline,
}

impl Denoise {
    pub(super) fn new(context: &Arc<Context>, bindings: &Arc<BindingLayout>) -> Result<Self, GpuError> {
        Ok(Self { kernel: kernel(context, bindings, "denoise", spirv!("denoise.comp"), &Constants::new())? })
    }

    /// Needs `pixel_radiance`. Leaves `pixel_filtered`.
    pub fn record(&self, commands: &Commands, resources: &Resources) {
        commands.dispatch(&self.kernel, None, &Batch::default(), resources.pixel_dispatch());
    }
}
