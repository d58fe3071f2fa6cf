//! Path begin: makes the camera rays of a batch's paths.

use std::sync::Arc;

use super::{kernel, spirv};
use crate::{
    buffers::Resources,
    gpu::{BindingLayout, Commands, ComputePipeline, Constants, Context, GpuError},
    layout::Batch,
};

/// The pipeline of the pass.
pub struct PathBegin {
    kernel: ComputePipeline,
}

impl PathBegin {
    pub(super) fn new(context: &Arc<Context>, bindings: &Arc<BindingLayout>) -> Result<Self, GpuError> {
        Ok(Self { kernel: kernel(context, bindings, "path_begin", spirv!("path_begin.comp"), &Constants::new())? })
    }

    /// Leaves `rays`, `path_states`, `shadow_rays` and the list of all paths in `live_paths`.
    pub fn record(&self, commands: &Commands, resources: &Resources, batch: &Batch) {
        commands.dispatch(&self.kernel, Some(batch.depth), batch, resources.paths_dispatch(batch));
    }
}
