//! Buffers of a search for all hits: rays that the caller gives, how far each has come, and their hits.

use std::sync::Arc;

use super::{AccelBuffers, cast::layout_of};
use crate::{
    gpu::{Binding, BindingLayout, BindingSet, Buffer, BufferUse, Context, GpuError},
    layout::{BIND_CAST_RAYS, BIND_HIT_CURSORS, BIND_LISTED_HITS, Hit, HitCursor, Ray},
};

/// Buffers of a batch of rays, and the descriptor set over them and the acceleration structure.
pub struct AllHitsResources {
    /// The rays of a batch.
    pub cast_rays: Buffer<Ray>,
    /// A cursor for each of these rays.
    pub hit_cursors: Buffer<HitCursor>,
    /// The hits, those of a ray after those of the ray before.
    pub listed_hits: Buffer<Hit>,
    pub set: BindingSet,
}

impl AllHitsResources {
    /// Makes the layout of the set, for kernels that read the acceleration structure.
    ///
    /// # Errors
    /// Memory runs out.
    pub fn bindings(context: &Arc<Context>, accel: &AccelBuffers) -> Result<Arc<BindingLayout>, GpuError> {
        layout_of(context, accel, &[BIND_CAST_RAYS, BIND_HIT_CURSORS, BIND_LISTED_HITS])
    }

    /// Makes buffers for `n_rays` rays and a list of `n_hits` hits, and the set over them.
    ///
    /// # Errors
    /// A buffer is beyond the device's limits, or memory runs out.
    pub fn new(
        context: &Arc<Context>,
        bindings: &Arc<BindingLayout>,
        accel: &AccelBuffers,
        [n_rays, n_hits]: [usize; 2],
    ) -> Result<Self, GpuError> {
        let cast_rays = Buffer::new(context, "cast_rays", n_rays, BufferUse::Storage)?;
        let hit_cursors = Buffer::new(context, "hit_cursors", n_rays, BufferUse::Storage)?;
        let listed_hits = Buffer::new(context, "listed_hits", n_hits, BufferUse::Storage)?;
        let own = [
            (BIND_CAST_RAYS, Binding::Buffer(cast_rays.any())),
            (BIND_HIT_CURSORS, Binding::Buffer(hit_cursors.any())),
            (BIND_LISTED_HITS, Binding::Buffer(listed_hits.any())),
        ];
        let set = BindingSet::new(bindings, "all_hits", &[&accel.objects(), &own[..]].concat())?;
        Ok(Self { cast_rays, hit_cursors, listed_hits, set })
    }
}
