//! Cast: finds the closest hit, or any hit, of each ray of an array, through the acceleration structure. It is not
//! a pass of a frame.

use std::sync::Arc;

use super::{kernel, search_constants, searching};
use crate::{
    accel::{Query, kdtree::Traversal},
    buffers::ResumePass,
    frame::bounce::lanes_log2,
    gpu::{BindingLayout, BindingSet, Commands, ComputePipeline, Context, Dispatch, GpuError, Statistic},
    layout::{CastBatch, RAY_GROUP_SIZE, constants},
};

/// The pipeline of the pass.
pub struct Cast {
    kernel: ComputePipeline,
    /// Number of lanes of the device, over which the rays are spread ([`lanes_log2`]). If it is 0, each ray gets one
    /// lane.
    n_lanes: u32,
}

impl Cast {
    /// Creates the pipeline.
    ///
    /// # Errors
    /// The driver refuses the shader.
    pub fn new(
        context: &Arc<Context>,
        bindings: &Arc<BindingLayout>,
        traversal: Traversal,
        query: Query,
    ) -> Result<Self, GpuError> {
        let shader = searching("cast", bindings, traversal, []);
        let constants = search_constants(context)?.set(constants::ANY_HIT, query == Query::Any);
        let n_lanes = context.n_lanes()?;
        Ok(Self { kernel: kernel(context, bindings, "cast", shader, &constants)?, n_lanes })
    }

    /// Returns the driver's statistics of the compiled kernel.
    ///
    /// # Errors
    /// Fails as [`ComputePipeline::statistics`] does.
    pub fn statistics(&self) -> Result<Vec<Statistic>, GpuError> {
        self.kernel.statistics()
    }

    /// Needs the first `n_rays` elements of `cast_rays`. Leaves the first `n_rays` elements of `cast_hits`; a ray that
    /// was suspended leaves a mark in place of its hit. `resume_pass`: which rays are traced, all or those that were
    /// suspended.
    pub fn record(&self, commands: &Commands, set: &BindingSet, n_rays: u32, pass: ResumePass) {
        commands.bind(set);
        record_batch(commands, &self.kernel, (n_rays, self.n_lanes), pass);
    }
}

/// Records a kernel of a [`CastBatch`] of so many rays or points, on a device with so many lanes.
pub(super) fn record_batch(
    commands: &Commands,
    kernel: &ComputePipeline,
    (n_rays, n_lanes): (u32, u32),
    pass: ResumePass,
) {
    let lanes_log2 = lanes_log2(n_rays, n_lanes);
    let dispatch = Dispatch::Threads([n_rays << lanes_log2, 1, 1], [RAY_GROUP_SIZE, 1, 1]);
    commands.dispatch(kernel, None, &CastBatch { n_rays, lanes_log2, resume_pass: pass.constant() }, dispatch);
}
