//! Visibility (the paper's section 2.2): the nearest triangle's index in each pixel, by rasterization.

use std::sync::Arc;

use super::{Resources, spirv};
use crate::gpu::{Bindings, Commands, Context, GpuError, RasterDesc, RasterPipeline, RasterTargets};

/// The pass's pipeline.
pub struct Visibility {
    pipeline: RasterPipeline,
}

impl Visibility {
    pub(super) fn new(context: &Arc<Context>, bindings: &Arc<Bindings>) -> Result<Self, GpuError> {
        let desc = RasterDesc {
            name: "visibility",
            vertex: spirv!("visibility.vert"),
            fragment: spirv!("visibility.frag"),
            targets: RasterTargets::Ids,
        };
        Ok(Self { pipeline: RasterPipeline::new(context, bindings, &desc)? })
    }

    /// Needs nothing. Leaves triangle_ids, ready for kernels.
    pub fn record(&self, commands: &Commands, resources: &Resources) {
        let (ids, depth) = (&resources.triangle_ids, &resources.depth);
        commands.begin_targets(ids, depth);
        commands.draw(&self.pipeline, ids, depth, 3 * resources.constants().n_triangles);
        commands.ids_to_compute(ids);
    }
}
