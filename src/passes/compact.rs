//! Compact (the paper's section 2.1): writes the rays of the next bounce to the queue by a prefix sum, without gaps,
//! after those of this bounce.
//!
//! The children of a ray are the reflected and the refracted ray that go on from its hit. They are counted for each
//! ray. A block is the `SCAN_GROUP_SIZE` rays of one workgroup.

use std::sync::Arc;

use super::{spine::Spine, spirv};
use crate::{
    buffers::Resources,
    gpu::{BindingLayout, Commands, ComputeDesc, ComputePipeline, Constants, Context, GpuError},
    layout::Batch,
};

/// The three pipelines of the pass.
pub struct Compact {
    reduce: ComputePipeline,
    pub(super) spine: Spine,
    scatter: ComputePipeline,
}

impl Compact {
    pub(super) fn new(context: &Arc<Context>, bindings: &Arc<BindingLayout>) -> Result<Self, GpuError> {
        let kernel = |name, shader| {
            let desc = ComputeDesc { name, shader, constants: &Constants::new(), full_subgroups: true };
            ComputePipeline::new(context, bindings, &desc)
        };
        Ok(Self {
            reduce: kernel("compact_reduce", spirv!("compact_reduce.comp"))?,
            spine: Spine::new(context, bindings)?,
            scatter: kernel("compact_scatter", spirv!("compact_scatter.comp"))?,
        })
    }

    /// Needs `rays` and `hits` of the bounce. Leaves the flags of each ray's children in `child_flags`, and the
    /// number of each block's children in `scan_blocks`.
    pub fn reduce(&self, commands: &Commands, resources: &Resources, batch: &Batch) {
        commands.dispatch(&self.reduce, Some(batch.depth), batch, resources.scan_dispatch(batch));
    }

    /// Needs `rays` and `hits` of the bounce, `child_flags`, `scan_blocks` and the next bounce's row of `bounces`.
    /// Leaves `first_children` and the next bounce's `rays`.
    pub fn scatter(&self, commands: &Commands, resources: &Resources, batch: &Batch) {
        commands.dispatch(&self.scatter, Some(batch.depth), batch, resources.scan_dispatch(batch));
    }
}
