//! Resolve: adds up the radiance of all rays of each pixel, in the order of the queue.

use std::sync::Arc;

use super::{kernel, spirv};
use crate::{
    gpu::{BindingLayout, Commands, ComputePipeline, Constants, Context, Dispatch, GpuError},
    layout::{Batch, RAY_GROUP_SIZE},
};

/// The pipeline of the pass.
pub struct Resolve {
    kernel: ComputePipeline,
}

impl Resolve {
    pub(super) fn new(context: &Arc<Context>, bindings: &Arc<BindingLayout>) -> Result<Self, GpuError> {
        Ok(Self { kernel: kernel(context, bindings, "resolve", spirv!("resolve.comp"), &Constants::new())? })
    }

    /// Needs `ray_radiance` and `first_children` of all bounces of the batch, and `bounces`. Leaves `pixel_radiance`.
    pub fn record(&self, commands: &Commands, batch: &Batch) {
        let dispatch = Dispatch::Threads([batch.n_pixels, 1, 1], [RAY_GROUP_SIZE, 1, 1]);
        commands.dispatch(&self.kernel, None, batch, dispatch);
    }
}
