//! Shade (the paper's section 2.1): local light at each hit, and the next level's rays, scattered.

use std::sync::Arc;

use super::{Resources, kernel, spirv};
use crate::{
    gpu::{Bindings, Commands, ComputePipeline, Context, GpuError},
    layout::Batch,
};

/// The pass's kernel.
pub struct Shade {
    kernel: ComputePipeline,
}

impl Shade {
    pub(super) fn new(context: &Arc<Context>, bindings: &Arc<Bindings>) -> Result<Self, GpuError> {
        Ok(Self { kernel: kernel(context, bindings, "shade", spirv!("shade.comp"), &[])? })
    }

    /// Needs rays, hits, light_visibility. Leaves ray_radiance, child_rays, child_counts.
    pub fn record(&self, commands: &Commands, resources: &Resources, batch: &Batch) {
        commands.dispatch(&self.kernel, Some(batch.depth), batch, resources.ray_dispatch(batch));
    }
}
