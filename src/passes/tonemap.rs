//! Tonemap: encodes radiance as sRGB bytes.

use std::sync::Arc;

use super::{kernel, spirv};
use crate::{
    buffers::Resources,
    frame,
    gpu::{BindingLayout, Commands, ComputePipeline, Constants, Context, GpuError},
    layout::{Batch, constants},
};

/// The pipeline of the pass.
pub struct Tonemap {
    kernel: ComputePipeline,
}

impl Tonemap {
    pub(super) fn new(
        context: &Arc<Context>,
        bindings: &Arc<BindingLayout>,
        curve: frame::Tonemap,
    ) -> Result<Self, GpuError> {
        let constants = Constants::new().set(constants::CURVE, curve.constant());
        Ok(Self { kernel: kernel(context, bindings, "tonemap", spirv!("tonemap.comp"), &constants)? })
    }

    /// Needs `pixel_filtered`. Leaves `pixel_display`.
    pub fn record(&self, commands: &Commands, resources: &Resources) {
        commands.dispatch(&self.kernel, None, &Batch::default(), resources.pixel_dispatch());
    }
}
