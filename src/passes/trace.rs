//! Trace (the paper's section 2.3): finds each ray's closest hit through the acceleration structure.

use std::sync::Arc;

use super::{kernel, search_constants, searching};
use crate::{
    buffers::Resources,
    frame::{Primary, RenderOptions},
    gpu::{BindingLayout, Commands, ComputePipeline, Context, GpuError},
    layout::{Batch, constants},
};

/// The pipelines of the pass.
pub struct Trace {
    kernel: ComputePipeline,
    /// The kernel of camera rays. None if their triangles are rasterized.
    from_camera: Option<ComputePipeline>,
}

impl Trace {
    pub(super) fn new(
        context: &Arc<Context>,
        bindings: &Arc<BindingLayout>,
        options: &RenderOptions,
    ) -> Result<Self, GpuError> {
        let constants = search_constants(context)?
            .set(constants::COUNTS, options.profile)
            .set(constants::COUNT_COSTS, options.pixel_aovs);
        let from = |camera: bool| {
            let tests = [constants::ALPHA_MASKS].into_iter().chain(camera.then_some(constants::CULLS_BACK_FACES));
            let shader = searching("trace", bindings, options.traversal, tests);
            let constants = constants.clone().set(constants::FROM_CAMERA, camera);
            kernel(context, bindings, "trace", shader, &constants)
        };
        let from_camera = (options.primary == Primary::Trace).then(|| from(true)).transpose()?;
        Ok(Self { kernel: from(false)?, from_camera })
    }

    /// Needs `rays` of the bounce; camera rays are computed, not read. Leaves `hits`; a ray that was suspended leaves a
    /// mark in place of its hit. Updates the counters if the options ask for a profile, and `pixel_aovs` if they
    /// ask for AOVs. `batch.resume_pass`: which rays are traced, all or those that were suspended.
    pub fn record(&self, commands: &Commands, resources: &Resources, batch: &Batch) {
        let of_camera = self.from_camera.as_ref().filter(|_| batch.depth == 0);
        commands.dispatch(of_camera.unwrap_or(&self.kernel), Some(batch.depth), batch, resources.trace_dispatch(batch));
    }
}
