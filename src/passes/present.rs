//! Present: draws the displayed picture into a window.

use std::sync::Arc;

use super::spirv;
use crate::{
    buffers::Resources,
    gpu::{Commands, Context, GpuError, Presenter, RasterDesc, RasterPipeline, RasterTargets, WindowImage},
    layout,
};

/// The pipeline of the pass.
pub struct Present {
    pipeline: RasterPipeline,
}

impl Present {
    /// Creates the pipeline. It can draw the pictures of all resources that have the binding layout of `resources`.
    ///
    /// # Errors
    /// The driver refuses a shader.
    pub fn new(context: &Arc<Context>, resources: &Resources, presenter: &Presenter) -> Result<Self, GpuError> {
        let desc = RasterDesc {
            name: "present",
            vertex: spirv!("present.vert"),
            fragment: spirv!("present.frag"),
            targets: RasterTargets::Color(presenter.format()),
        };
        Ok(Self { pipeline: RasterPipeline::new(context, &resources.bindings, &desc)? })
    }

    /// Needs `pixel_display` of `size` pixels, visible to fragment shaders. Leaves the whole of the window's image.
    pub fn record(&self, commands: &Commands, resources: &Resources, size: (u32, u32), image: &WindowImage) {
        let ((width, height), (window_width, window_height)) = (size, image.size());
        let push = layout::Present { width, height, window_width, window_height };
        commands.cover(&self.pipeline, resources.set(), &push, image);
    }
}
