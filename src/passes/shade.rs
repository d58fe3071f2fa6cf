//! Shade (the paper's section 2.1): computes the local illumination at each hit.

use std::sync::Arc;

use super::{kernel, spirv};
use crate::{
    buffers::Resources,
    frame::RenderOptions,
    gpu::{BindingLayout, Commands, ComputePipeline, Constants, Context, GpuError},
    layout::{Batch, constants},
};

/// The pipeline of the pass.
pub struct Shade {
    kernel: ComputePipeline,
}

impl Shade {
    pub(super) fn new(
        context: &Arc<Context>,
        bindings: &Arc<BindingLayout>,
        options: &RenderOptions,
    ) -> Result<Self, GpuError> {
        let constants = Constants::new().set(constants::COUNTS, options.profile);
        Ok(Self { kernel: kernel(context, bindings, "shade", spirv!("shade.comp"), &constants)? })
    }

    /// Needs `rays`, `hits` and `light_visibility` of all bounces of the batch. Leaves `ray_radiance`. Updates the
    /// counters if the options ask for a profile.
    pub fn record(&self, commands: &Commands, resources: &Resources, batch: &Batch) {
        commands.dispatch(&self.kernel, None, batch, resources.shade_dispatch(batch));
    }
}
