//! Visibility (the paper's section 2.2): rasterizes the index of the nearest triangle at each pixel's sample.

use std::sync::Arc;

use super::{is_set, spirv};
use crate::{
    buffers::Resources,
    gpu::{Area, BindingLayout, Commands, Context, DrawDesc, GpuError, RasterDesc, RasterPipeline, RasterTargets},
    layout::{Frame, constants},
};

/// The pipeline of the pass.
pub struct Visibility {
    pipeline: RasterPipeline,
}

impl Visibility {
    pub(super) fn new(context: &Arc<Context>, bindings: &Arc<BindingLayout>) -> Result<Self, GpuError> {
        let desc = RasterDesc {
            name: "visibility",
            vertex: spirv!("visibility.vert"),
            fragment: match is_set(bindings, [constants::ALPHA_MASKS, constants::CULLS_BACK_FACES]) {
                true => spirv!("visibility_alpha_test.frag"),
                false => spirv!("visibility.frag"),
            },
            targets: RasterTargets::Uint,
        };
        Ok(Self { pipeline: RasterPipeline::new(context, bindings, &desc)? })
    }

    /// Needs no buffer of another pass. Leaves `triangle_ids`, and makes them visible to kernels by a barrier.
    ///
    /// # Panics
    /// The resources were created for options without [`Primary::Raster`](crate::frame::Primary::Raster).
    pub fn record(&self, commands: &Commands, resources: &Resources) {
        let (ids, depth) = (&resources.pixels.triangle_ids, resources.pixels.depth.as_ref());
        let depth = depth.expect("there is a depth target where triangles are drawn");
        let Frame { window_x: x, window_y: y, width, height, .. } = *resources.constants();
        let Frame { picture_width, picture_height, n_triangles, .. } = *resources.constants();
        commands.begin_targets(ids, depth);
        let desc = DrawDesc {
            ids,
            depth,
            picture: (picture_width, picture_height),
            area: Area { x, y, width, height },
            n_triangles,
            indices: resources.vertex_indices.as_ref().expect("there are indices where triangles are drawn"),
        };
        commands.draw(&self.pipeline, &desc);
        commands.color_to_compute(ids);
    }
}
