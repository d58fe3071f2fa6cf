//! Pixel AOVs: writes the first-hit AOVs of each pixel: position, normal, albedo, depth and indices.

use std::sync::Arc;

use super::{kernel, spirv};
use crate::{
    gpu::{BindingLayout, Commands, ComputePipeline, Constants, Context, Dispatch, GpuError},
    layout::{Batch, RAY_GROUP_SIZE},
};

/// The pipeline of the pass.
pub struct PixelAovs {
    kernel: ComputePipeline,
}

impl PixelAovs {
    pub(super) fn new(context: &Arc<Context>, bindings: &Arc<BindingLayout>) -> Result<Self, GpuError> {
        Ok(Self { kernel: kernel(context, bindings, "pixel_aovs", spirv!("pixel_aovs.comp"), &Constants::new())? })
    }

    /// Needs `hits` of the camera rays, and `pixel_aovs` whose position, normal and albedo have been cleared: a
    /// pixel without a hit keeps these. Leaves all of `pixel_aovs` except the counts of rays and steps.
    pub fn record(&self, commands: &Commands, batch: &Batch) {
        let dispatch = Dispatch::Threads([batch.n_pixels, 1, 1], [RAY_GROUP_SIZE, 1, 1]);
        commands.dispatch(&self.kernel, Some(batch.depth), batch, dispatch);
    }
}
