//! Primary hit (the paper's section 2.2): intersects each camera ray with the triangle that was rasterized in its
//! pixel. If the ray just misses that triangle, the hit is moved to its edge.

use std::sync::Arc;

use super::{kernel, spirv};
use crate::{
    frame::{Primary, RenderOptions},
    gpu::{BindingLayout, Commands, ComputePipeline, Constants, Context, Dispatch, GpuError},
    layout::{Batch, RAY_GROUP_SIZE, constants},
};

/// The pipeline of the pass.
pub struct PrimaryHit {
    kernel: ComputePipeline,
}

impl PrimaryHit {
    pub(super) fn new(
        context: &Arc<Context>,
        bindings: &Arc<BindingLayout>,
        options: &RenderOptions,
    ) -> Result<Self, GpuError> {
        let constants = Constants::new()
            .set(constants::FUSED_FMA, context.fuses_fma()?)
            .set(constants::COUNTS, options.profile)
            .set(constants::COUNT_COSTS, options.pixel_aovs)
            .set(constants::SOFTWARE_RASTER, options.primary == Primary::SoftwareRaster);
        Ok(Self { kernel: kernel(context, bindings, "primary_hit", spirv!("primary_hit.comp"), &constants)? })
    }

    /// Needs `triangle_ids`, or `pixel_nearest` if kernels rasterize. Leaves `hits` of the camera rays. Updates the
    /// counters if the options ask for a profile, and `pixel_aovs` if they ask for AOVs.
    pub fn record(&self, commands: &Commands, batch: &Batch) {
        let dispatch = Dispatch::Threads([batch.n_pixels, 1, 1], [RAY_GROUP_SIZE, 1, 1]);
        commands.dispatch(&self.kernel, Some(batch.depth), batch, dispatch);
    }
}
