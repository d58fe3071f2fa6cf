//! Closest point: finds the point of the triangles that is closest to each point of an array, through the kd-tree. It
//! is not a pass of a frame.

use std::sync::Arc;

use super::{
    cast::{Bare, Masked, record_batch},
    kernel, spirv,
};
use crate::{
    buffers::ResumePass,
    gpu::{BindingLayout, BindingSet, Commands, ComputePipeline, Constants, Context, GpuError},
};

/// The pipeline of the pass.
pub struct ClosestPoint {
    kernel: ComputePipeline,
    /// Number of lanes of the device, over which the points are spread (`frame::bounce::lanes_log2`).
    n_lanes: u32,
}

impl ClosestPoint {
    /// Creates the pipeline.
    ///
    /// # Errors
    /// The driver refuses the shader.
    pub fn new(context: &Arc<Context>, bindings: &Arc<BindingLayout>) -> Result<Self, GpuError> {
        let shader = spirv!("closest_point.comp");
        let kernel = kernel(context, bindings, "closest_point", shader, &Constants::new())?;
        Ok(Self { kernel, n_lanes: context.n_lanes()? })
    }

    /// Needs the first elements of `cast_points`. Leaves the first elements of `cast_hits`; a search that was suspended
    /// leaves a mark in place of its hit. `pass`: which points are searched for, all or those whose search was
    /// suspended.
    pub fn record(&self, commands: &Commands, set: &BindingSet, points: Masked, pass: ResumePass) {
        commands.bind(set);
        record_batch(commands, &self.kernel, (points, self.n_lanes), Bare::default(), pass);
    }
}
