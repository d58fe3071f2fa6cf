//! Auxiliary buffers: adds the first hits of paths to what the noise filter `edge` knows of their pixels.

use std::sync::Arc;

use super::{kernel, spirv};
use crate::{
    gpu::{BindingLayout, Commands, ComputePipeline, Constants, Context, Dispatch, GpuError},
    layout::{Batch, RAY_GROUP_SIZE},
};

/// The pipeline of the pass.
pub struct Auxiliary {
    kernel: ComputePipeline,
}

impl Auxiliary {
    pub(super) fn new(context: &Arc<Context>, bindings: &Arc<BindingLayout>) -> Result<Self, GpuError> {
        Ok(Self { kernel: kernel(context, bindings, "auxiliary", spirv!("auxiliary.comp"), &Constants::new())? })
    }

    /// Needs `hits` of the camera rays, and `path_states` with the light that these have met. Updates
    /// `pixel_aux`.
    pub fn record(&self, commands: &Commands, batch: &Batch) {
        let dispatch = Dispatch::Threads([batch.n_pixels, 1, 1], [RAY_GROUP_SIZE, 1, 1]);
        commands.dispatch(&self.kernel, Some(batch.depth), batch, dispatch);
    }
}
