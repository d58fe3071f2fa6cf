//! False colour: displays an AOV of each pixel in place of the picture.

use std::sync::Arc;

use super::{kernel, spirv};
use crate::{
    buffers::Resources,
    gpu::{BindingLayout, Commands, ComputePipeline, Constants, Context, GpuError},
    layout,
};

/// The pipeline of the pass.
pub struct FalseColor {
    kernel: ComputePipeline,
}

impl FalseColor {
    pub(super) fn new(context: &Arc<Context>, bindings: &Arc<BindingLayout>) -> Result<Self, GpuError> {
        Ok(Self { kernel: kernel(context, bindings, "false_color", spirv!("false_color.comp"), &Constants::new())? })
    }

    /// Needs `pixel_aovs`. Leaves `pixel_display`.
    pub fn record(&self, commands: &Commands, resources: &Resources, push: &layout::FalseColor) {
        commands.dispatch(&self.kernel, None, push, resources.pixel_dispatch());
    }
}
