//! Resolve: a bounce's radiance onto the image, the rays of a pixel in the queue's order.

use std::sync::Arc;

use super::{Resources, kernel, spirv};
use crate::{
    gpu::{Bindings, Commands, ComputePipeline, Context, GpuError},
    layout::Batch,
};

/// The pass's kernel.
pub struct Resolve {
    kernel: ComputePipeline,
}

impl Resolve {
    pub(super) fn new(context: &Arc<Context>, bindings: &Arc<Bindings>) -> Result<Self, GpuError> {
        Ok(Self { kernel: kernel(context, bindings, "resolve", spirv!("resolve.comp"), &[])? })
    }

    /// Needs rays, ray_radiance. Updates pixel_radiance; bounce 0 sets it.
    pub fn record(&self, commands: &Commands, resources: &Resources, batch: &Batch) {
        commands.dispatch(&self.kernel, Some(batch.depth), batch, resources.ray_dispatch(batch));
    }
}
