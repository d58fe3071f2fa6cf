//! Rasterize: finds the triangle of each pixel as visibility does (the paper's section 2.2), but by compute kernels,
//! for devices with few units for graphics. The triangle of each pixel is exactly the one that its camera ray hits.
//!
//! One kernel rasterizes the triangles with small bounding rectangles. The rectangles of the large triangles are cut
//! into blocks, squares of pixels, which the other kernel rasterizes.

use std::sync::Arc;

use super::{kernel, spirv};
use crate::{
    buffers::{RasterState, Resources},
    gpu::{Access, BindingLayout, Commands, ComputePipeline, Constants, Context, Dispatch, GpuError},
    layout::{Frame, RASTER_GROUPS_X, RAY_GROUP_SIZE, RasterGroups, RasterPush, constants},
};

/// Log2 of the side of the smallest blocks, which have 32 x 32 pixels. A workgroup of 64 invocations tests such a
/// block in 16 steps.
const SMALLEST_BLOCK_LOG2: u32 = 5;

/// The two pipelines of the pass.
pub struct Rasterize {
    triangles: ComputePipeline,
    blocks: ComputePipeline,
}

impl Rasterize {
    /// Creates the pipelines.
    ///
    /// # Errors
    /// The device lacks 64-bit atomics, or the driver refuses a shader.
    pub(super) fn new(context: &Arc<Context>, bindings: &Arc<BindingLayout>) -> Result<Self, GpuError> {
        context.require_int64_atomics()?;
        let constants = Constants::new().set(constants::FUSED_FMA, context.fuses_fma()?);
        let kernel = |name, shader| kernel(context, bindings, name, shader, &constants);
        Ok(Self {
            triangles: kernel("rasterize_triangles", spirv!("rasterize_triangles.comp"))?,
            blocks: kernel("rasterize_blocks", spirv!("rasterize_blocks.comp"))?,
        })
    }

    /// Records the transfer that sets the numbers of large triangles and of their blocks in `raster_groups` to 0, as
    /// [`Rasterize::triangles`] needs them.
    pub fn reset(commands: &Commands, resources: &Resources) {
        let groups = RasterGroups { x: RASTER_GROUPS_X, y: 0, z: 1, reserved: 0 };
        commands.update_buffer(resources.raster.groups.any(), &[RasterState { groups, count: 0, reserved: 0 }]);
    }

    /// Needs what [`Rasterize::reset`] leaves. Clears `pixel_nearest`, and leaves the nearest hits of small triangles
    /// there, and in `raster_groups` the large triangles and the size of the next dispatch.
    pub fn triangles(&self, commands: &Commands, resources: &Resources) {
        let (pixels, constants) = (&resources.pixels, resources.constants());
        let push = RasterPush { block_log2: block_log2(constants) };
        let clear = || {
            commands.fill_buffer(pixels.pixel_nearest.any(), u32::MAX);
            commands.barrier(Access::TransferWrite, Access::ComputeUpdate); // pixel_nearest
        };
        commands.dispatch_after(clear, &self.triangles, None, &push, groups_for(constants.n_triangles));
    }

    /// Needs what [`Rasterize::triangles`] leaves. Leaves the nearest hits of all triangles in `pixel_nearest`.
    pub fn blocks(&self, commands: &Commands, resources: &Resources) {
        let push = RasterPush { block_log2: block_log2(resources.constants()) };
        commands.dispatch(&self.blocks, None, &push, Dispatch::Indirect(resources.raster.groups.any(), 0));
    }
}

/// Returns log2 of a block's side in pixels. Blocks are as small as possible, but so large that a u32 can number the
/// blocks of all triangles even if each triangle fills the window.
fn block_log2(constants: &Frame) -> u32 {
    let n_blocks = |log2: u32| {
        let along = |pixels: u32| u64::from(pixels.div_ceil(1 << log2));
        along(constants.width) * along(constants.height) * u64::from(constants.n_triangles)
    };
    (SMALLEST_BLOCK_LOG2..16).find(|&log2| u32::try_from(n_blocks(log2)).is_ok()).unwrap_or(16)
}

/// Returns a dispatch of at least one invocation per triangle. Its workgroups are in rows of 1024, since a device
/// need not accept more than 65,535 workgroups along an axis.
fn groups_for(n_triangles: u32) -> Dispatch<'static> {
    const GROUPS_OF_ROW: u32 = 1 << 10;
    let n_groups = n_triangles.div_ceil(RAY_GROUP_SIZE);
    Dispatch::Threads([n_groups.min(GROUPS_OF_ROW), n_groups.div_ceil(GROUPS_OF_ROW), 1], [1, 1, 1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_of_all_triangles_have_numbers() {
        let of = |width, height, n_triangles| block_log2(&Frame { width, height, n_triangles, ..Frame::default() });
        assert_eq!([of(1, 1, 1), of(1920, 1080, 810_092), of(3840, 2160, 810_092)], [5, 5, 6]);
        assert_eq!([of(1920, 1080, 10_000_000), of(16_384, 16_384, 1 << 24), of(0, 0, 0)], [7, 11, 5]);
    }
}
