//! Path trace: finds the closest hits of paths, and tests the shadow rays to lights of the bounce before.

use std::sync::Arc;

use super::{kernel, search_constants, searching};
use crate::{
    buffers::Resources,
    frame::RenderOptions,
    gpu::{BindingLayout, Commands, ComputePipeline, Context, GpuError},
    layout::{Batch, constants},
};

/// The pipeline of the pass.
pub struct PathTrace {
    kernel: ComputePipeline,
}

impl PathTrace {
    pub(super) fn new(
        context: &Arc<Context>,
        bindings: &Arc<BindingLayout>,
        options: &RenderOptions,
    ) -> Result<Self, GpuError> {
        let shader = searching("path_trace", bindings, options.traversal, Some(constants::SHADOW_ALPHA_TEST));
        let constants = search_constants(context)?
            .set(constants::COUNTS, options.profile)
            .set(constants::COUNT_COSTS, options.pixel_aovs);
        Ok(Self { kernel: kernel(context, bindings, "path_trace", shader, &constants)? })
    }

    /// Needs `rays` of the paths that are alive, `shadow_rays`, and in `live_paths` the lists of this bounce and of the
    /// shadow rays. Leaves `hits`. Updates `shadow_rays` and `path_states`, the counters if the options ask for a
    /// profile, and `pixel_aovs` if they ask for AOVs. A ray that was suspended leaves a mark in place of its
    /// hit, a shadow ray in place of its state. `batch.resume_pass`: which of them are traced, all or those that were
    /// suspended.
    pub fn record(&self, commands: &Commands, resources: &Resources, batch: &Batch) {
        commands.dispatch(&self.kernel, Some(batch.depth), batch, resources.trace_dispatch(batch));
    }
}
