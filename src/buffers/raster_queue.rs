//! The buffer that the kernels that rasterize hand to one another.

use std::sync::Arc;

use crate::{
    frame::{Primary, RenderOptions},
    gpu::{Buffer, BufferUse, Context, GpuError},
    layout::{LargeTriangle, RasterGroups},
};

/// State that the kernel for small triangles leaves to the one for large triangles. In the buffer, the large triangles
/// follow it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct RasterState {
    /// The dispatch over the blocks of large triangles.
    pub groups: RasterGroups,
    /// The number of large triangles in the upper half, that of their blocks in the lower half.
    pub count: u64,
    pub reserved: u64,
}

/// The size of a [`RasterState`], in elements of the buffer.
const STATE_LEN: usize = size_of::<RasterState>() / size_of::<LargeTriangle>();
const _: () = assert!(STATE_LEN * size_of::<LargeTriangle>() == size_of::<RasterState>());

/// Triangles with large bounding rectangles, and their blocks. A clone is a second handle to the same buffer.
#[derive(Clone)]
pub struct RasterQueue {
    /// The state, a [`RasterState`], and the large triangles. There is room for all triangles if compute kernels
    /// rasterize the primary rays ([`Primary::SoftwareRaster`]), and for none otherwise.
    pub groups: Buffer<LargeTriangle>,
}

impl RasterQueue {
    /// Makes the buffer for `n_triangles` triangles.
    ///
    /// # Errors
    /// The buffer is beyond the device's limits, or memory runs out.
    pub fn new(context: &Arc<Context>, n_triangles: u32, options: &RenderOptions) -> Result<Self, GpuError> {
        let n_large = if options.primary == Primary::SoftwareRaster { n_triangles as usize } else { 0 };
        Ok(Self { groups: Buffer::new(context, "raster_groups", STATE_LEN + n_large, BufferUse::Indirect)? })
    }

    /// Whether the device can bind the buffer for `n_triangles` large triangles.
    pub fn has_room(context: &Context, n_triangles: usize) -> bool {
        let n_bytes =
            (STATE_LEN as u64).saturating_add(n_triangles as u64).saturating_mul(size_of::<LargeTriangle>() as u64);
        n_bytes <= context.limits().storage_range
    }

    /// Whether the array of triangles has the length that the options need: `n_triangles`, or 0 if no compute kernel
    /// rasterizes.
    pub fn fits(&self, n_triangles: u32, options: &RenderOptions) -> bool {
        let n_large = if options.primary == Primary::SoftwareRaster { n_triangles as usize } else { 0 };
        self.groups.len() == STATE_LEN + n_large
    }
}
