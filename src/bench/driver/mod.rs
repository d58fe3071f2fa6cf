//! The benchmark of kdray's searches against the driver's own ray tracing, on the same rays and triangles in one run.
//! Each of kdray's searches, and the driver's ray tracing, is called a contender.
//!
//! ```text
//! builds    building kdray's and the driver's structures over the same triangles -> times
//! contest   contenders that take turns on a device -> times, hits
//!   pipeline  the contender that uses VK_KHR_ray_tracing_pipeline; nothing else in kdray uses that extension
//! raster    rasterization in place of primary rays -> times
//! changing  times of builds and of rays -> times of frames in which all triangles have moved
//! report    the results, in numbers and as a chart
//! ```

pub mod builds;
pub mod changing;
pub mod contest;
mod pipeline;
pub mod raster;
pub mod report;

use std::{rc::Rc, sync::Arc};

use self::{
    builds::Builds,
    contest::run_contest,
    pipeline::Pipeline,
    raster::Raster,
    report::{RasterResult, SetResult},
};
use super::{
    rays::{RaySet, RaySetKind},
    stage::Stage,
};
use crate::{
    accel::{AccelKind, Query, Search, kdtree::Traversal},
    buffers::{AccelBuffers, CastResources},
    cast::{Contender, Kernel, Ray, cast_ray},
    gpu::{BindingLayout, Context, Device, DriverAccel, GpuError},
    world::Geometry,
};

/// The searches of kdray that are measured. Three of them traverse the kd-tree: the first is the default one, the
/// second keeps a stack in memory, and the third needs neither mask nor stack, but six words more per node.
pub const VARIANTS: [Search; 5] = [
    Search::KdTree(Traversal::Mask),
    Search::KdTree(Traversal::Stack),
    Search::KdTree(Traversal::Ropes),
    Search::Grid,
    Search::Grid2,
];

/// The name of the first search through the kd-tree that the device builds.
const GPU_TREE: &str = "mask, GPU's tree";

/// One of kdray's structures on the device, with all data that the searches of [`VARIANTS`] read.
struct Structure {
    /// The searches, each with its name.
    searches: Vec<(Search, String)>,
    buffers: AccelBuffers,
    bindings: Arc<BindingLayout>,
}

/// The searches through a structure, and the buffers of the rays that they trace.
struct Contenders {
    resources: Rc<CastResources>,
    contenders: Vec<Box<dyn Contender>>,
}

impl Structure {
    /// Uploads the structure of a kind that the host has built, or a grid of the device.
    fn of_kind(context: &Arc<Context>, stage: &Stage, kind: AccelKind) -> Result<Self, GpuError> {
        let of_kind = VARIANTS.into_iter().filter(|variant| variant.accel() == kind);
        let geometry = stage.geometry(Search::of(kind, Traversal::Mask));
        Self::new(context, geometry, of_kind.map(|variant| (variant, variant.to_string())).collect())
    }

    /// Lets the device build a kd-tree, for the default traversal.
    fn of_device_tree(context: &Arc<Context>, stage: &Stage) -> Result<Self, GpuError> {
        Self::new(context, stage.geometry_of_device_tree(), vec![(VARIANTS[0], GPU_TREE.to_owned())])
    }

    fn new(context: &Arc<Context>, geometry: Geometry, searches: Vec<(Search, String)>) -> Result<Self, GpuError> {
        let mut buffers = AccelBuffers::new(context, geometry)?;
        buffers.add_links(context, geometry, Traversal::Ropes)?;
        Ok(Self { searches, bindings: CastResources::bindings(context, &buffers)?, buffers })
    }

    /// Uploads the rays and returns the searches through the structure that trace them.
    fn contenders(&self, context: &Arc<Context>, rays: &[Ray], query: Query) -> Result<Contenders, GpuError> {
        let resources = Rc::new(CastResources::new(context, &self.bindings, &self.buffers, rays.len())?);
        resources.cast_rays.upload(rays)?;
        let mut contenders: Vec<Box<dyn Contender>> = Vec::new();
        for (variant, name) in &self.searches {
            let kernel = Kernel::new(context, &self.bindings, &resources, (variant.traversal(), query))?;
            contenders.push(Box::new(kernel.named(name.clone())));
        }
        Ok(Contenders { resources, contenders })
    }
}

/// A scene on a device that supports ray tracing: kdray's structures, the driver's structure and the rasterizers,
/// ready to be measured.
pub struct DeviceStage {
    context: Arc<Context>,
    structures: Vec<Structure>,
    driver_accel: Rc<DriverAccel>,
    rasters: Vec<Raster>,
    builds: Builds,
}

impl DeviceStage {
    /// Uploads the stage and builds the driver's structure.
    ///
    /// # Errors
    /// A structure or the picture exceeds the device's limits or memory.
    ///
    /// # Panics
    /// The context is without ray tracing.
    pub fn new(device: &Device, stage: &Stage) -> Result<Self, GpuError> {
        let context = device.inner();
        let (builds, driver_accel) = Builds::measure(context, stage)?;
        let mut structures =
            vec![Structure::of_kind(context, stage, AccelKind::KdTree)?, Structure::of_device_tree(context, stage)?];
        for kind in [AccelKind::Grid, AccelKind::Grid2] {
            structures.push(Structure::of_kind(context, stage, kind)?);
        }
        Ok(Self {
            structures,
            driver_accel: Rc::new(driver_accel),
            rasters: Raster::all(context, stage)?,
            builds,
            context: Arc::clone(context),
        })
    }

    /// Returns the times of building the structures.
    pub fn builds(&self) -> &Builds {
        &self.builds
    }

    /// Traces the rays `n_times` by the driver and by each of [`VARIANTS`], in turns. For primary rays, also draws as
    /// many frames by each method of rasterization.
    ///
    /// # Errors
    /// The device is out of memory, or a call of Vulkan fails.
    pub fn measure(&mut self, set: &RaySet, n_times: u16) -> Result<(SetResult, Vec<RasterResult>), GpuError> {
        let rays: Vec<_> = set.rays.iter().map(cast_ray).collect();
        let query = if set.kind.is_any_hit() { Query::Any } else { Query::Closest };
        let mut contenders: Vec<Box<dyn Contender>> = Vec::new();
        for structure in &self.structures {
            let Contenders { resources, contenders: kernels } = structure.contenders(&self.context, &rays, query)?;
            if contenders.is_empty() {
                contenders.push(Box::new(Pipeline::new(&self.context, &self.driver_accel, &resources, query)?));
            }
            contenders.extend(kernels);
        }
        let rasterizes = set.kind == RaySetKind::Primary;
        let trials = run_contest(&self.context, &contenders, n_times, |n_rounds| {
            let rasters = if rasterizes { &mut self.rasters[..] } else { &mut [] };
            rasters.iter_mut().try_for_each(|raster| raster.draw(n_rounds))
        })?;
        let set = SetResult::new(set.kind, &trials);
        let rasters =
            if rasterizes { self.rasters.iter().map(|raster| raster.result(&set)).collect() } else { Vec::new() };
        Ok((set, rasters))
    }
}
