//! Cast: finds the closest hit, or any hit, of each ray of an array, through the acceleration structure. It is not
//! a pass of a frame.

use std::sync::Arc;

use super::{kernel, search_constants, searching};
use crate::{
    accel::{Query, kdtree::Traversal},
    buffers::ResumePass,
    frame::bounce::lanes_log2,
    gpu::{BindingLayout, BindingSet, Commands, ComputePipeline, Context, Dispatch, GpuError, Statistic},
    layout::{CastBatch, INSTANCE_MASK_SHIFT, RAY_GROUP_SIZE, constants},
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

    /// Needs the first elements of `cast_rays`. Leaves the first elements of `cast_hits`; a ray that was suspended
    /// leaves a mark in place of its hit. `pass`: which rays are traced, all or those that were suspended.
    pub fn record(&self, commands: &Commands, set: &BindingSet, rays: Masked, pass: ResumePass) {
        self.record_bare(commands, set, rays, Bare::default(), pass);
    }

    /// Does what [`Cast::record`] does with rays or hits that may be bare.
    pub fn record_bare(&self, commands: &Commands, set: &BindingSet, rays: Masked, bare: Bare, pass: ResumePass) {
        commands.bind(set);
        record_batch(commands, &self.kernel, (rays, self.n_lanes), bare, pass);
    }
}

/// The rays or points of a dispatch.
#[derive(Clone, Copy)]
pub struct Masked {
    /// Their number: the first elements of their buffer.
    pub n: u32,
    /// They meet the instances whose masks have a bit in common with this one.
    pub mask: u8,
}

/// What of the rays and hits of a cast is stored.
#[derive(Clone, Copy, Debug, Default)]
pub struct Bare {
    /// Only origins and directions: six floats a ray. Then t is from 0 to infinity.
    pub rays: bool,
    /// Only t: one float a hit, infinite for a miss.
    pub hits: bool,
}

/// Records a kernel of a [`CastBatch`] of these rays or points, on a device with so many lanes.
pub(super) fn record_batch(
    commands: &Commands,
    kernel: &ComputePipeline,
    (Masked { n: n_rays, mask }, n_lanes): (Masked, u32),
    bare: Bare,
    pass: ResumePass,
) {
    let lanes_log2 = lanes_log2(n_rays, n_lanes);
    let dispatch = Dispatch::Threads([n_rays << lanes_log2, 1, 1], [RAY_GROUP_SIZE, 1, 1]);
    let mask = u32::from(mask) << INSTANCE_MASK_SHIFT;
    let [bare_rays, bare_hits] = [bare.rays, bare.hits].map(u32::from);
    let batch = CastBatch { n_rays, lanes_log2, resume_pass: pass.constant(), mask, bare_rays, bare_hits };
    commands.dispatch(kernel, None, &batch, dispatch);
}
