//! Surface layers: adds up the albedos and the normals that each pixel's camera rays hit.

use std::sync::Arc;

use super::{kernel, spirv};
use crate::{
    frame::RenderOptions,
    gpu::{BindingLayout, Commands, ComputePipeline, Constants, Context, Dispatch, GpuError},
    layout::{Batch, RAY_GROUP_SIZE, SURFACE_LAYERS, constants},
};

/// The pipeline of the pass.
pub struct SurfaceLayers {
    kernel: ComputePipeline,
}

impl SurfaceLayers {
    /// Makes the pipeline if the options ask for these layers.
    pub(super) fn new(
        context: &Arc<Context>,
        bindings: &Arc<BindingLayout>,
        options: &RenderOptions,
    ) -> Result<Option<Arc<Self>>, GpuError> {
        if !options.surface_layers {
            return Ok(None);
        }
        let first_layer = 1 + options.mean_layers().len() as u32 - SURFACE_LAYERS;
        let constants = Constants::new().set(constants::FIRST_SURFACE_LAYER, first_layer);
        let shader = spirv!("surface_layers.comp");
        Ok(Some(Arc::new(Self { kernel: kernel(context, bindings, "surface_layers", shader, &constants)? })))
    }

    /// Needs `hits` of the camera rays, and of paths these `rays`. Leaves the sums of the frame's samples in the layers
    /// of `pixel_radiance`.
    pub fn record(&self, commands: &Commands, batch: &Batch) {
        let dispatch = Dispatch::Threads([batch.n_pixels, SURFACE_LAYERS, 1], [RAY_GROUP_SIZE, 1, 1]);
        commands.dispatch(&self.kernel, Some(batch.depth), batch, dispatch);
    }
}
