//! Buffers that the kernels that rasterize hand to one another.

use std::sync::Arc;

use crate::{
    frame::{Primary, RenderOptions},
    gpu::{Buffer, BufferUse, Context, GpuError},
    layout::{LargeTriangle, RasterGroups},
};

/// State that the kernel for small triangles leaves to the one for large triangles.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct RasterState {
    /// The dispatch over the blocks of large triangles.
    pub groups: RasterGroups,
    /// The number of large triangles in the upper half, that of their blocks in the lower half.
    pub count: u64,
}

/// Triangles with large bounding rectangles, and their blocks. The array of triangles is empty unless compute kernels
/// rasterize the primary rays ([`Primary::SoftwareRaster`]). A clone is a second handle to the same buffers.
#[derive(Clone)]
pub struct RasterQueue {
    /// The state: one element.
    pub groups: Buffer<RasterState>,
    /// The large triangles, with room for all triangles.
    pub large_triangles: Buffer<LargeTriangle>,
}

impl RasterQueue {
    /// Makes the buffers for `n_triangles` triangles.
    ///
    /// # Errors
    /// A buffer is beyond the device's limits, or memory runs out.
    pub fn new(context: &Arc<Context>, n_triangles: u32, options: &RenderOptions) -> Result<Self, GpuError> {
        let n_large = if options.primary == Primary::SoftwareRaster { n_triangles as usize } else { 0 };
        Ok(Self {
            groups: Buffer::new(context, "raster_groups", 1, BufferUse::Indirect)?,
            large_triangles: Buffer::new(context, "large_triangles", n_large, BufferUse::Storage)?,
        })
    }

    /// Whether the device can bind the buffer for `n_triangles` large triangles.
    pub fn has_room(context: &Context, n_triangles: usize) -> bool {
        (n_triangles as u64).saturating_mul(size_of::<LargeTriangle>() as u64) <= context.limits().storage_range
    }

    /// Whether the array of triangles has the length that the options need: `n_triangles`, or 0 if no compute kernel
    /// rasterizes.
    pub fn fits(&self, n_triangles: u32, options: &RenderOptions) -> bool {
        let has_room = self.large_triangles.len() == n_triangles as usize;
        if options.primary == Primary::SoftwareRaster { has_room } else { self.large_triangles.is_empty() }
    }
}
