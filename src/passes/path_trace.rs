//! Path trace: finds the closest hits of paths, and tests the shadow rays to lights of the bounce before.

use std::sync::Arc;

use super::{is_set, kernel, search_constants, searching};
use crate::{
    buffers::Resources,
    frame::RenderOptions,
    gpu::{BindingLayout, Commands, ComputePipeline, Context, GpuError},
    layout::{Batch, constants},
};

/// The pipelines of the pass.
pub struct PathTrace {
    kernel: ComputePipeline,
    /// The kernel of camera rays, if they pass through back faces or instances.
    from_camera: Option<ComputePipeline>,
}

impl PathTrace {
    pub(super) fn new(
        context: &Arc<Context>,
        bindings: &Arc<BindingLayout>,
        options: &RenderOptions,
    ) -> Result<Self, GpuError> {
        let constants = search_constants(context)?
            .set(constants::COUNTS, options.profile)
            .set(constants::COUNT_COSTS, options.pixel_aovs);
        let from = |camera: bool| {
            let tests = [constants::SHADOW_ALPHA_TEST].into_iter().chain(camera.then_some(constants::CULLS_BACK_FACES));
            let shader = searching("path_trace", bindings, options.traversal, tests);
            let constants = constants.clone().set(constants::FROM_CAMERA, camera);
            kernel(context, bindings, "path_trace", shader, &constants)
        };
        let from_camera =
            is_set(bindings, [constants::CULLS_BACK_FACES, constants::INSTANCED]).then(|| from(true)).transpose()?;
        Ok(Self { kernel: from(false)?, from_camera })
    }

    /// Needs `rays` of the paths that are alive, `shadow_rays`, and in `live_paths` the lists of this bounce and of the
    /// shadow rays. Leaves `hits`. Updates `shadow_rays` and `path_states`, the counters if the options ask for a
    /// profile, and `pixel_aovs` if they ask for AOVs. A ray that was suspended leaves a mark in place of its
    /// hit, a shadow ray in place of its state. `batch.resume_pass`: which of them are traced, all or those that were
    /// suspended.
    pub fn record(&self, commands: &Commands, resources: &Resources, batch: &Batch) {
        let of_camera = self.from_camera.as_ref().filter(|_| batch.depth == 0);
        commands.dispatch(of_camera.unwrap_or(&self.kernel), Some(batch.depth), batch, resources.trace_dispatch(batch));
    }
}
