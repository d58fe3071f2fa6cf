//! Cast: each given ray's closest hit through the kd-tree, or any hit; without a frame.

use std::sync::Arc;

use super::{kernel, spirv, traversal_constants};
use crate::{
    accel::{Query, kdtree::Traversal},
    buffers::Round,
    frame::bounce::lanes_log2,
    gpu::{BindingLayout, BindingSet, Commands, ComputePipeline, Context, Dispatch, GpuError, Statistic},
    layout::{CastBatch, RAY_GROUP_SIZE, constants},
};

/// The pass's kernel.
pub struct Cast {
    kernel: ComputePipeline,
    /// That the device shares out among rays.
    n_lanes: u32,
}

impl Cast {
    /// # Errors
    /// The driver refuses the shader.
    pub fn new(
        context: &Arc<Context>,
        bindings: &Arc<BindingLayout>,
        traversal: Traversal,
        query: Query,
    ) -> Result<Self, GpuError> {
        let constants = traversal_constants(context, traversal)?.set(constants::ANY_HIT, query == Query::Any);
        let n_lanes = context.n_lanes()?;
        Ok(Self { kernel: kernel(context, bindings, "cast", spirv!("cast.comp"), &constants)?, n_lanes })
    }

    /// What the driver tells of the kernel.
    ///
    /// # Errors
    /// As [`ComputePipeline::statistics`].
    pub fn statistics(&self) -> Result<Vec<Statistic>, GpuError> {
        self.kernel.statistics()
    }

    /// Needs the first `n_rays` of cast_rays. Leaves as many cast_hits, and marks where rays have stalled.
    pub fn record(&self, commands: &Commands, set: &BindingSet, n_rays: u32, round: Round) {
        commands.bind(set);
        let lanes_log2 = lanes_log2(n_rays, self.n_lanes);
        let dispatch = Dispatch::Threads([n_rays << lanes_log2, 1, 1], [RAY_GROUP_SIZE, 1, 1]);
        commands.dispatch(&self.kernel, None, &CastBatch { n_rays, lanes_log2, round: round.constant() }, dispatch);
    }
}
