//! Path layers: adds up one layer of the light of each pixel's paths.

use std::sync::Arc;

use super::{kernel, spirv};
use crate::{
    gpu::{BindingLayout, Commands, ComputePipeline, Constants, Context, Dispatch, GpuError},
    layout::{Batch, LIGHT_LAYERS, RAY_GROUP_SIZE},
};

/// The pipeline of the pass.
pub struct PathLayers {
    kernel: ComputePipeline,
}

impl PathLayers {
    pub(super) fn new(context: &Arc<Context>, bindings: &Arc<BindingLayout>) -> Result<Self, GpuError> {
        Ok(Self { kernel: kernel(context, bindings, "path_layers", spirv!("path_layers.comp"), &Constants::new())? })
    }

    /// Needs `path_states`, in which the bounce of the batch is complete. Updates `path_snapshots`. Leaves the layer of
    /// that bounce in `pixel_radiance`. The last layer has all further bounces.
    pub fn record(&self, commands: &Commands, batch: &Batch) {
        let dispatch = Dispatch::Threads([batch.n_pixels, 1, 1], [RAY_GROUP_SIZE, 1, 1]);
        let bounce = (batch.depth + 1 < LIGHT_LAYERS).then_some(batch.depth);
        commands.dispatch(&self.kernel, bounce, batch, dispatch);
    }
}
