//! Present: draws the displayed picture into a window.

use std::sync::Arc;

use super::spirv;
use crate::{
    gpu::{
        BindingKind, BindingLayout, BindingSet, Buffer, Commands, Context, GpuError, Presenter, RasterDesc,
        RasterPipeline, RasterTargets, WindowImage,
    },
    layout::{self, BIND_PIXEL_DISPLAY},
};

/// The pipeline of the pass.
pub struct Present {
    pipeline: RasterPipeline,
    bindings: Arc<BindingLayout>,
}

impl Present {
    /// Creates the pipeline.
    ///
    /// # Errors
    /// The driver refuses a shader.
    pub fn new(context: &Arc<Context>, presenter: &Presenter) -> Result<Self, GpuError> {
        let push_bytes = size_of::<layout::Present>() as u32;
        let bindings = BindingLayout::new(context, &[(BIND_PIXEL_DISPLAY, BindingKind::Storage)], push_bytes)?;
        let desc = RasterDesc {
            name: "present",
            vertex: spirv!("present.vert"),
            fragment: spirv!("present.frag"),
            targets: RasterTargets::Color(presenter.format()),
        };
        Ok(Self { pipeline: RasterPipeline::new(context, &bindings, &desc)?, bindings })
    }

    /// Creates the set of a displayed picture, `pixel_display`.
    ///
    /// # Errors
    /// Out of memory.
    pub fn set(&self, pixel_display: &Buffer<u32>) -> Result<BindingSet, GpuError> {
        BindingSet::new(&self.bindings, "present", &[(BIND_PIXEL_DISPLAY, pixel_display.as_binding())])
    }

    /// Needs `pixel_display` of `size` pixels, visible to fragment shaders. Leaves the whole of the window's image.
    pub fn record(&self, commands: &Commands, set: &BindingSet, size: (u32, u32), image: &WindowImage) {
        let ((width, height), (window_width, window_height)) = (size, image.size());
        let push = layout::Present { width, height, window_width, window_height };
        commands.cover(&self.pipeline, set, &push, image);
    }
}
