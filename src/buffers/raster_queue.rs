//! What the kernels that rasterize hand to one another.

use std::sync::Arc;

use crate::{
    frame::{Primary, RenderOptions},
    gpu::{Buffer, BufferUse, Context, GpuError},
    layout::{LargeTriangle, RasterGroups},
};

/// What the kernel that rasterizes small triangles tells the one that rasterizes large ones.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct RasterState {
    /// The dispatch over the blocks of large triangles.
    pub groups: RasterGroups,
    /// The number of large triangles in the upper half, of their blocks in the lower.
    pub count: u64,
}

/// Triangles with large bounding rectangles, and their blocks. Without room where the options do not ask for these kernels.
/// A clone is a second handle to the same buffers.
#[derive(Clone)]
pub struct RasterQueue {
    /// One.
    pub groups: Buffer<RasterState>,
    /// One a triangle: all may be large.
    pub large_triangles: Buffer<LargeTriangle>,
}

impl RasterQueue {
    /// # Errors
    /// Beyond the device's limits, out of memory.
    pub fn new(context: &Arc<Context>, n_triangles: u32, options: &RenderOptions) -> Result<Self, GpuError> {
        let n_large = if options.primary == Primary::Compute { n_triangles as usize } else { 0 };
        Ok(Self {
            groups: Buffer::new(context, "raster_groups", 1, BufferUse::Indirect)?,
            large_triangles: Buffer::new(context, "large_triangles", n_large, BufferUse::Storage)?,
        })
    }

    /// Whether a device binds what so many triangles take here.
    pub fn has_room(context: &Context, n_triangles: usize) -> bool {
        (n_triangles as u64).saturating_mul(size_of::<LargeTriangle>() as u64) <= context.limits().storage_range
    }

    /// Whether there is room where the options ask for it, and none where they do not.
    pub fn fits(&self, n_triangles: u32, options: &RenderOptions) -> bool {
        let has_room = self.large_triangles.len() == n_triangles as usize;
        if options.primary == Primary::Compute { has_room } else { self.large_triangles.is_empty() }
    }
}
