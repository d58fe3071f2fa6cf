//! Shadow (the paper's section 2.1): tests whether anything is between each hit and each light. A shadow ray is the
//! shadow ray from a hit to a light.

use std::sync::Arc;

use super::{kernel, search_constants, searching};
use crate::{
    buffers::Resources,
    frame::RenderOptions,
    gpu::{BindingLayout, Commands, ComputePipeline, Context, GpuError},
    layout::{Batch, constants},
};

/// The pipeline of the pass.
pub struct Shadow {
    kernel: ComputePipeline,
}

impl Shadow {
    pub(super) fn new(
        context: &Arc<Context>,
        bindings: &Arc<BindingLayout>,
        options: &RenderOptions,
    ) -> Result<Self, GpuError> {
        let shader = searching("shadow", bindings, options.traversal, [constants::SHADOW_ALPHA_TEST]);
        // `COUNTS` is not set, since the pass shade counts the shadow rays.
        let constants = search_constants(context)?.set(constants::COUNT_COSTS, options.pixel_aovs);
        Ok(Self { kernel: kernel(context, bindings, "shadow", shader, &constants)? })
    }

    /// Needs `rays` and `hits` of all bounces of the batch. Leaves `light_visibility`; a shadow ray that was suspended
    /// leaves a mark in place of its visibility. Updates `pixel_aovs` if the options ask for AOVs.
    /// `batch.resume_pass`: which shadow rays are traced, all or those that were suspended.
    pub fn record(&self, commands: &Commands, resources: &Resources, batch: &Batch) {
        commands.dispatch(&self.kernel, None, batch, resources.shadow_dispatch(batch));
    }
}
