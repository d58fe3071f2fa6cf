//! Edge filter: blurs the light within surfaces, in several iterations.

use std::sync::Arc;

use super::{kernel, spirv};
use crate::{
    buffers::Resources,
    gpu::{BindingLayout, Commands, ComputePipeline, Constants, Context, GpuError},
    layout::AtrousIteration,
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

    /// Needs `pixel_aux`, and the half of `pixel_filtered` that the iteration before has left: the second half for
    /// even iterations. Leaves the other half.
    pub fn record(&self, commands: &Commands, resources: &Resources, iteration_ix: u32) {
        commands.dispatch(&self.kernel, None, &AtrousIteration { iteration_ix }, resources.pixel_dispatch());
    }
}
