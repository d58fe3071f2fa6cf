//! All hits: counts or lists the hits of each ray of an array, through the acceleration structure. It is not a pass of
//! a frame.

use std::sync::Arc;

use super::{
    cast::{Bare, Masked, record_batch},
    kernel, search_constants, searching,
};
use crate::{
    accel::kdtree::Traversal,
    buffers::ResumePass,
    gpu::{BindingLayout, BindingSet, Commands, ComputePipeline, Context, GpuError},
    layout::constants,
};

/// The pipeline of the pass.
pub struct AllHits {
    kernel: ComputePipeline,
    /// Number of lanes of the device, over which the rays are spread (`frame::bounce::lanes_log2`).
    n_lanes: u32,
}

impl AllHits {
    /// Creates the pipeline. `lists`: whether hits are listed, and not only counted.
    ///
    /// # Errors
    /// The driver refuses the shader.
    pub fn new(
        context: &Arc<Context>,
        bindings: &Arc<BindingLayout>,
        traversal: Traversal,
        lists: bool,
    ) -> Result<Self, GpuError> {
        let shader = searching("all_hits", bindings, traversal, []);
        let constants = search_constants(context)?.set(constants::LISTS_HITS, lists);
        let n_lanes = context.n_lanes()?;
        Ok(Self { kernel: kernel(context, bindings, "all_hits", shader, &constants)?, n_lanes })
    }

    /// Needs the first elements of `cast_rays` and `hit_cursors`. Leaves in the cursors where each ray's list
    /// ends, and if hits are listed, the lists in `listed_hits`; a ray that was suspended leaves a mark in its cursor.
    /// `pass`: which rays are traced, all or those that were suspended.
    pub fn record(&self, commands: &Commands, set: &BindingSet, rays: Masked, pass: ResumePass) {
        commands.bind(set);
        record_batch(commands, &self.kernel, (rays, self.n_lanes), Bare::default(), pass);
    }
}
