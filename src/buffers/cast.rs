//! Buffers of a cast: rays that the caller gives, and their hits.

use std::sync::Arc;

use super::{AccelBuffers, accel, binding};
use crate::{
    gpu::{Binding, BindingLayout, BindingSet, Buffer, BufferUse, Context, GpuError},
    layout::{BIND_CAST_HITS, BIND_CAST_RAYS, CastBatch, Hit, Ray},
};

/// Makes the layout of a set of the acceleration structure and the bindings `own`, for kernels of a [`CastBatch`].
pub(super) fn layout_of(
    context: &Arc<Context>,
    accel: &AccelBuffers,
    own: &[u32],
) -> Result<Arc<BindingLayout>, GpuError> {
    let kinds: Vec<_> = accel::bindings().chain(own.iter().copied()).map(binding).collect();
    BindingLayout::with_constants(context, &kinds, size_of::<CastBatch>() as u32, accel.constants(false))
}

/// Buffers of a batch of rays, and the descriptor set over them and the acceleration structure.
pub struct CastResources {
    /// The rays of a batch.
    pub cast_rays: Buffer<Ray>,
    /// The hits of these rays, as many as rays.
    pub cast_hits: Buffer<Hit>,
    pub set: BindingSet,
}

impl CastResources {
    /// Makes the layout of the set, for kernels that read the acceleration structure.
    ///
    /// # Errors
    /// Memory runs out.
    pub fn bindings(context: &Arc<Context>, accel: &AccelBuffers) -> Result<Arc<BindingLayout>, GpuError> {
        layout_of(context, accel, &[BIND_CAST_RAYS, BIND_CAST_HITS])
    }

    /// Makes the set over any buffers of rays and hits.
    ///
    /// # Errors
    /// Memory runs out.
    pub fn set_over(
        bindings: &Arc<BindingLayout>,
        accel: &AccelBuffers,
        name: &str,
        [rays, hits]: [Binding; 2],
    ) -> Result<BindingSet, GpuError> {
        BindingSet::new(
            bindings,
            name,
            &[&accel.objects(), &[(BIND_CAST_RAYS, rays), (BIND_CAST_HITS, hits)][..]].concat(),
        )
    }

    /// Makes buffers for `len` rays, and the set over them.
    ///
    /// # Errors
    /// A buffer is beyond the device's limits, or memory runs out.
    pub fn new(
        context: &Arc<Context>,
        bindings: &Arc<BindingLayout>,
        accel: &AccelBuffers,
        len: usize,
    ) -> Result<Self, GpuError> {
        let cast_rays = Buffer::new(context, "cast_rays", len, BufferUse::Storage)?;
        let cast_hits = Buffer::new(context, "cast_hits", len, BufferUse::Storage)?;
        Self::over(bindings, accel, cast_rays, cast_hits)
    }

    /// Makes the set over the same buffers of rays and hits, and other ones of the structure.
    ///
    /// # Errors
    /// Memory runs out.
    pub fn with_accel(&self, bindings: &Arc<BindingLayout>, accel: &AccelBuffers) -> Result<Self, GpuError> {
        Self::over(bindings, accel, self.cast_rays.clone(), self.cast_hits.clone())
    }

    fn over(
        bindings: &Arc<BindingLayout>,
        accel: &AccelBuffers,
        cast_rays: Buffer<Ray>,
        cast_hits: Buffer<Hit>,
    ) -> Result<Self, GpuError> {
        let buffers = [cast_rays.any(), cast_hits.any()].map(Binding::Buffer);
        let set = Self::set_over(bindings, accel, "cast", buffers)?;
        Ok(Self { cast_rays, cast_hits, set })
    }
}
