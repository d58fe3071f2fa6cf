//! Cast: each given ray's closest hit through the kd-tree, or any hit; without a frame.

use std::sync::Arc;

use super::{Round, Tree, binding, kernel, spirv, traversal_constants, tree};
use crate::{
    bounce::lanes_log2,
    cast::Query,
    frame::Traversal,
    gpu::{
        Binding, BindingSet, Bindings, Buffer, BufferUse, Commands, ComputePipeline, Context, Dispatch, GpuError,
        Statistic,
    },
    layout::{BIND_CAST_HITS, BIND_CAST_RAYS, CastBatch, CastRay, Hit, RAY_GROUP_SIZE},
};

/// A batch's buffers and the descriptor set over them and the tree.
pub struct CastResources {
    /// Room for a batch, like cast_hits.
    pub cast_rays: Buffer<CastRay>,
    pub cast_hits: Buffer<Hit>,
    pub set: BindingSet,
}

impl CastResources {
    /// The layout of the set, for kernels that read the tree.
    ///
    /// # Errors
    /// Out of memory.
    pub fn bindings(context: &Arc<Context>, tree: &Tree) -> Result<Arc<Bindings>, GpuError> {
        let kinds: Vec<_> = tree::bindings().chain([BIND_CAST_RAYS, BIND_CAST_HITS]).map(binding).collect();
        Bindings::with_constants(context, &kinds, size_of::<CastBatch>() as u32, &tree.constants())
    }

    /// Room for `len` rays.
    ///
    /// # Errors
    /// Beyond the device's limits, out of memory.
    pub fn new(context: &Arc<Context>, bindings: &Arc<Bindings>, tree: &Tree, len: usize) -> Result<Self, GpuError> {
        let cast_rays = Buffer::new(context, "cast_rays", len, BufferUse::Storage)?;
        let cast_hits = Buffer::new(context, "cast_hits", len, BufferUse::Storage)?;
        let own =
            [(BIND_CAST_RAYS, Binding::Buffer(cast_rays.any())), (BIND_CAST_HITS, Binding::Buffer(cast_hits.any()))];
        let set = BindingSet::new(bindings, "cast", &[&tree.objects(), &own[..]].concat())?;
        Ok(Self { cast_rays, cast_hits, set })
    }
}

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
        bindings: &Arc<Bindings>,
        traversal: Traversal,
        query: Query,
    ) -> Result<Self, GpuError> {
        let constants = traversal_constants(context, traversal, [query == Query::Any, false])?;
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
    pub fn record(&self, commands: &Commands, resources: &CastResources, n_rays: u32, round: Round) {
        commands.bind(&resources.set);
        let lanes_log2 = lanes_log2(n_rays, self.n_lanes);
        let dispatch = Dispatch::Threads([n_rays << lanes_log2, 1, 1], [RAY_GROUP_SIZE, 1, 1]);
        commands.dispatch(&self.kernel, None, &CastBatch { n_rays, lanes_log2, round: round.constant() }, dispatch);
    }
}
