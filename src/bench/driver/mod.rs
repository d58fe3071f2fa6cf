//! kdray's traversal against the driver's own ray tracing, on the same rays and triangles in one run.
//!
//! ```text
//! contest   ways of tracing that take turns on a device -> times, hits
//!   pipeline  VK_KHR_ray_tracing_pipeline is one, beside kdray's own kernel; nothing else uses that extension
//! raster    primary rays without a tree, by the passes that rasterize
//! report    what came of it, in numbers and as a chart
//! ```

pub mod contest;
mod pipeline;
pub mod raster;
pub mod report;

use std::{rc::Rc, sync::Arc};

use self::{
    contest::hold,
    pipeline::Pipeline,
    raster::Raster,
    report::{Builds, RasterResult, SetResult},
};
use super::{
    Spread,
    rays::{RayKind, RaySet},
    stage::Stage,
};
use crate::{
    accel::{Query, kdtree::Traversal},
    buffers::{AccelBuffers, CastResources},
    cast::{Contender, Kernel, cast_ray},
    gpu::{BindingLayout, Context, GpuError, Scenery},
};

/// kdray's ways through the tree that are measured: the default one, the one that keeps a stack in memory, and the one that
/// needs neither, but six words more a node.
pub const VARIANTS: [Traversal; 3] = [Traversal::Mask, Traversal::Stack, Traversal::Ropes];
/// Builds of the driver's structure, of which the median counts.
const N_BUILDS: usize = 5;

/// A stage on a device that has ray tracing, ready for rays.
pub struct Arena {
    context: Arc<Context>,
    tree: AccelBuffers,
    bindings: Arc<BindingLayout>,
    scenery: Rc<Scenery>,
    rasters: Vec<Raster>,
    builds: Builds,
}

impl Arena {
    /// Uploads the stage and lets the driver build its structure. Panics on a context without ray tracing.
    ///
    /// # Errors
    /// Tree, structure or picture are beyond the device's limits or memory.
    pub fn new(context: &Arc<Context>, stage: &Stage) -> Result<Self, GpuError> {
        let triangles = &stage.scene().triangles;
        let mut scenery = Scenery::new(context, triangles)?;
        let mut build_ms = vec![scenery.build_ms()];
        for _ in 1..N_BUILDS {
            scenery = Scenery::new(context, triangles)?;
            build_ms.push(scenery.build_ms());
        }
        let mut tree = AccelBuffers::new(context, stage.world.geometry())?;
        tree.add_links(context, stage.world.accel(), Traversal::Ropes)?;
        Ok(Self {
            bindings: CastResources::bindings(context, &tree)?,
            tree,
            scenery: Rc::new(scenery),
            rasters: Raster::all(context, stage)?,
            builds: Builds {
                tree_ms: stage.tree_build_ms,
                n_threads: rayon::current_num_threads(),
                bvh_ms: Spread::of(build_ms.into_iter().flatten()),
                n_bvh_builds: N_BUILDS,
            },
            context: Arc::clone(context),
        })
    }

    /// What it took to build the two trees.
    pub fn builds(&self) -> Builds {
        self.builds
    }

    /// Traces the rays `n_times` by the driver and by each of [`VARIANTS`], in turn. Primary rays are rasterized, too.
    ///
    /// # Errors
    /// Out of memory, a failed call.
    pub fn measure(&mut self, set: &RaySet, n_times: u16) -> Result<(SetResult, Vec<RasterResult>), GpuError> {
        let rays: Vec<_> = set.rays.iter().map(cast_ray).collect();
        let query = if set.kind.is_any_hit() { Query::Any } else { Query::Closest };
        let resources = Rc::new(CastResources::new(&self.context, &self.bindings, &self.tree, rays.len())?);
        resources.cast_rays.upload(&rays)?;

        let mut contenders: Vec<Box<dyn Contender>> =
            vec![Box::new(Pipeline::new(&self.context, &self.scenery, &resources, query)?)];
        for variant in VARIANTS {
            contenders.push(Box::new(Kernel::new(&self.context, &self.bindings, &resources, (variant, query))?));
        }
        let rasterizes = set.kind == RayKind::Primary;
        let trials = hold(&self.context, &contenders, n_times, |n_rounds| {
            let rasters = if rasterizes { &mut self.rasters[..] } else { &mut [] };
            rasters.iter_mut().try_for_each(|raster| raster.draw(n_rounds))
        })?;
        let set = SetResult::new(set.kind, &trials);
        let rasters =
            if rasterizes { self.rasters.iter().map(|raster| raster.result(&set)).collect() } else { Vec::new() };
        Ok((set, rasters))
    }
}
