//! Present: the displayed picture into a window.

use std::sync::Arc;

use super::{Resources, spirv};
use crate::{
    frame::View,
    gpu::{Commands, Context, GpuError, Presenter, RasterDesc, RasterPipeline, RasterTargets, WindowImage},
    layout,
};

/// What a window shows of a picture.
pub struct Shown {
    /// The picture's width and height, pixels.
    pub size: (u32, u32),
    pub view: View,
    /// The value that is shown brightest, or half as bright for depth.
    pub brightest: f32,
}

/// The pass's pipeline.
pub struct Present {
    pipeline: RasterPipeline,
}

impl Present {
    /// For pictures of resources like these.
    ///
    /// # Errors
    /// The driver refuses a shader.
    pub fn new(context: &Arc<Context>, resources: &Resources, presenter: &Presenter) -> Result<Self, GpuError> {
        let desc = RasterDesc {
            name: "present",
            vertex: spirv!("present.vert"),
            fragment: spirv!("present.frag"),
            targets: RasterTargets::Window(presenter),
        };
        Ok(Self { pipeline: RasterPipeline::new(context, &resources.bindings, &desc)? })
    }

    /// Needs pixel_display and, but for `View::Picture`, pixel_features, both of `size` pixels and readable by fragments.
    /// Leaves the window's image, all of it.
    pub fn record(&self, commands: &Commands, resources: &Resources, shown: &Shown, image: &WindowImage) {
        let ((width, height), (window_width, window_height)) = (shown.size, image.size());
        let (view, brightest) = (shown.view.constant(), shown.brightest);
        let push = layout::Present { width, height, window_width, window_height, view, brightest };
        commands.cover(&self.pipeline, &resources.sets[0], &push, image);
    }
}
