//! Primary hit (the paper's section 2.2): camera rays, and their hits with the planes of the rasterized triangles.

use std::sync::Arc;

use super::{kernel, spirv};
use crate::{
    gpu::{Bindings, Commands, ComputePipeline, Context, Dispatch, GpuError},
    layout::{Batch, RAY_GROUP_SIZE},
};

/// The pass's kernel.
pub struct PrimaryHit {
    kernel: ComputePipeline,
}

impl PrimaryHit {
    /// `from_raster`: find the hits too; otherwise only make the rays, for [`super::Trace`].
    pub(super) fn new(context: &Arc<Context>, bindings: &Arc<Bindings>, from_raster: bool) -> Result<Self, GpuError> {
        let constants = [u32::from(from_raster)];
        Ok(Self { kernel: kernel(context, bindings, "primary_hit", spirv!("primary_hit.comp"), &constants)? })
    }

    /// Needs triangle_ids. Leaves rays and, from raster, hits; updates counters.
    pub fn record(&self, commands: &Commands, batch: &Batch) {
        let dispatch = Dispatch::Threads([batch.n_pixels, 1, 1], [RAY_GROUP_SIZE, 1, 1]);
        commands.dispatch(&self.kernel, Some(batch.depth), batch, dispatch);
    }
}
