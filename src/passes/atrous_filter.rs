//! Edge filter: blurs the light within surfaces, in several steps.

use std::sync::Arc;

use super::{kernel, spirv};
use crate::{
    buffers::Resources,
    gpu::{BindingLayout, Commands, ComputePipeline, Constants, Context, GpuError},
    layout::EdgeStep,
};

/// The pipeline of the pass.
pub struct AtrousFilter {
    kernel: ComputePipeline,
}

impl AtrousFilter {
    pub(super) fn new(context: &Arc<Context>, bindings: &Arc<BindingLayout>) -> Result<Self, GpuError> {
        Ok(Self {
            kernel: kernel(context, bindings, "atrous_filter", spirv!("atrous_filter.comp"), &Constants::new())?,
        })
    }

    /// Needs `pixel_aux`, and the half of `pixel_filtered` that the step before has left: the second half for
    /// even steps. Leaves the other half.
    pub fn record(&self, commands: &Commands, resources: &Resources, step_ix: u32) {
        commands.dispatch(&self.kernel, None, &EdgeStep { step_ix }, resources.pixel_dispatch());
    }
}
