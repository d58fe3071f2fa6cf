//! kdray's searches against the driver's own ray tracing, on the same rays and triangles in one run.
//!
//! ```text
//! builds    the structures of both over the same triangles
//! contest   ways of tracing that take turns on a device -> times, hits
//!   pipeline  VK_KHR_ray_tracing_pipeline is one, beside kdray's own kernel; nothing else uses that extension
//! raster    primary rays without a tree, by the passes that rasterize
//! report    what came of it, in numbers and as a chart
//! ```

pub mod builds;
pub mod contest;
mod pipeline;
pub mod raster;
pub mod report;

use std::{rc::Rc, sync::Arc};

use self::{
    builds::Builds,
    contest::hold,
    pipeline::Pipeline,
    raster::Raster,
    report::{RasterResult, SetResult},
};
use super::{
    rays::{RayKind, RaySet},
    stage::Stage,
    variant::Variant,
};
use crate::{
    accel::{AccelKind, Query, kdtree::Traversal},
    buffers::{AccelBuffers, CastResources},
    cast::{Contender, Kernel, Ray, cast_ray},
    gpu::{BindingLayout, Context, GpuError, Scenery},
};

/// The searches of kdray that are measured. Of the kd-tree's, the first is the default one, the second keeps a stack in memory,
/// and the third needs neither, but six words more a node.
pub const VARIANTS: [Variant; 5] = [
    Variant::KdTree(Traversal::Mask),
    Variant::KdTree(Traversal::Stack),
    Variant::KdTree(Traversal::Ropes),
    Variant::Grid,
    Variant::Grid2,
];

/// One of kdray's structures on the device, with all that the searches of [`VARIANTS`] read of it.
struct Structure {
    kind: AccelKind,
    buffers: AccelBuffers,
    bindings: Arc<BindingLayout>,
}

/// The searches through a structure, and the rays that they trace.
struct Contenders {
    resources: Rc<CastResources>,
    contenders: Vec<Box<dyn Contender>>,
}

impl Structure {
    fn new(context: &Arc<Context>, stage: &Stage, variant: Variant) -> Result<Self, GpuError> {
        let geometry = stage.geometry(variant);
        let mut buffers = AccelBuffers::new(context, geometry)?;
        buffers.add_links(context, geometry.accel(), Traversal::Ropes)?;
        Ok(Self { kind: variant.accel(), bindings: CastResources::bindings(context, &buffers)?, buffers })
    }

    /// The searches through the structure, which are to trace these rays.
    fn contenders(&self, context: &Arc<Context>, rays: &[Ray], query: Query) -> Result<Contenders, GpuError> {
        let resources = Rc::new(CastResources::new(context, &self.bindings, &self.buffers, rays.len())?);
        resources.cast_rays.upload(rays)?;
        let mut contenders: Vec<Box<dyn Contender>> = Vec::new();
        for variant in VARIANTS.into_iter().filter(|variant| variant.accel() == self.kind) {
            let kernel = Kernel::new(context, &self.bindings, &resources, (variant.traversal(), query))?;
            contenders.push(Box::new(kernel.named(variant.to_string())));
        }
        Ok(Contenders { resources, contenders })
    }
}

/// A stage on a device that has ray tracing, ready for rays.
pub struct Arena {
    context: Arc<Context>,
    structures: Vec<Structure>,
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
        let (builds, scenery) = Builds::measure(context, stage)?;
        let structures = [VARIANTS[0], Variant::Grid, Variant::Grid2];
        let structures = structures.map(|variant| Structure::new(context, stage, variant));
        Ok(Self {
            structures: structures.into_iter().collect::<Result<_, _>>()?,
            scenery: Rc::new(scenery),
            rasters: Raster::all(context, stage)?,
            builds,
            context: Arc::clone(context),
        })
    }

    /// What it took to build the structures.
    pub fn builds(&self) -> &Builds {
        &self.builds
    }

    /// Traces the rays `n_times` by the driver and by each of [`VARIANTS`], in turn. Primary rays are rasterized, too.
    ///
    /// # Errors
    /// Out of memory, a failed call.
    pub fn measure(&mut self, set: &RaySet, n_times: u16) -> Result<(SetResult, Vec<RasterResult>), GpuError> {
        let rays: Vec<_> = set.rays.iter().map(cast_ray).collect();
        let query = if set.kind.is_any_hit() { Query::Any } else { Query::Closest };
        let mut contenders: Vec<Box<dyn Contender>> = Vec::new();
        for structure in &self.structures {
            let Contenders { resources, contenders: kernels } = structure.contenders(&self.context, &rays, query)?;
            if contenders.is_empty() {
                contenders.push(Box::new(Pipeline::new(&self.context, &self.scenery, &resources, query)?));
            }
            contenders.extend(kernels);
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
