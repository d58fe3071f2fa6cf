//! Buffers of a search for closest points: points that the caller gives, and their hits.

use std::sync::Arc;

use super::{AccelBuffers, cast::layout_of};
use crate::{
    gpu::{Binding, BindingLayout, BindingSet, Buffer, BufferUse, Context, GpuError},
    layout::{BIND_CAST_HITS, BIND_CAST_POINTS, Hit, QueryPoint},
};

/// Buffers of a batch of points, and the descriptor set over them and the acceleration structure.
pub struct PointResources {
    /// The points of a batch.
    pub cast_points: Buffer<QueryPoint>,
    /// The hits of these points, as many as points.
    pub cast_hits: Buffer<Hit>,
    pub set: BindingSet,
}

impl PointResources {
    /// Makes the layout of the set.
    ///
    /// # Errors
    /// Memory runs out.
    pub fn bindings(context: &Arc<Context>, accel: &AccelBuffers) -> Result<Arc<BindingLayout>, GpuError> {
        layout_of(context, accel, &[BIND_CAST_POINTS, BIND_CAST_HITS])
    }

    /// Makes buffers for `len` points, and the set over them.
    ///
    /// # Errors
    /// A buffer is beyond the device's limits, or memory runs out.
    pub fn new(
        context: &Arc<Context>,
        bindings: &Arc<BindingLayout>,
        accel: &AccelBuffers,
        len: usize,
    ) -> Result<Self, GpuError> {
        let cast_points = Buffer::new(context, "cast_points", len, BufferUse::Storage)?;
        let cast_hits = Buffer::new(context, "cast_hits", len, BufferUse::Storage)?;
        let own = [
            (BIND_CAST_POINTS, Binding::Buffer(cast_points.any())),
            (BIND_CAST_HITS, Binding::Buffer(cast_hits.any())),
        ];
        let set = BindingSet::new(bindings, "closest_point", &[&accel.objects(), &own[..]].concat())?;
        Ok(Self { cast_points, cast_hits, set })
    }
}
