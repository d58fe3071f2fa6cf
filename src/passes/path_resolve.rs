//! Path resolve: adds up the radiance of each pixel's paths, in a binary tree over the samples.

use std::sync::Arc;

use super::{kernel, spirv};
use crate::{
    gpu::{BindingLayout, Commands, ComputePipeline, Constants, Context, Dispatch, GpuError},
    layout::{Batch, RAY_GROUP_SIZE},
};

/// The pipeline of the pass.
pub struct PathResolve {
    kernel: ComputePipeline,
}

impl PathResolve {
    pub(super) fn new(context: &Arc<Context>, bindings: &Arc<BindingLayout>) -> Result<Self, GpuError> {
        Ok(Self { kernel: kernel(context, bindings, "path_resolve", spirv!("path_resolve.comp"), &Constants::new())? })
    }

    /// Needs `path_states` of the batch. Leaves `pixel_radiance`: the sum of the frame's samples.
    pub fn record(&self, commands: &Commands, batch: &Batch) {
        let dispatch = Dispatch::Threads([batch.n_pixels, 1, 1], [RAY_GROUP_SIZE, 1, 1]);
        commands.dispatch(&self.kernel, None, batch, dispatch);
    }
}
