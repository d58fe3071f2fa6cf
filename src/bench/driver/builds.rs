//! Times of building the structures over the same triangles: the driver's and kdray's own.

use std::sync::Arc;

use serde::Serialize;

use crate::{
    accel::{AccelKind, BuildStage, DeviceBuild, grid::GridOptions},
    bench::{Spread, stage::Stage, warm_up},
    gpu::{Buffer, BufferUse, Context, DriverAccel, GpuError, Timer},
    layout::Triangle,
    passes::{
        grid::GridBuilder,
        kdtree::{KdTreeBuilder, KdTreeBuilderOptions},
    },
};

/// Number of timed builds of each structure on the GPU.
const N_BUILDS: usize = 9;

/// Times of building the structures over the same triangles.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Builds {
    /// Wall-clock time of kdray's kd-tree on the CPU.
    pub tree_ms: f64,
    /// Number of CPU threads that build the kd-tree.
    pub n_threads: usize,
    /// Time of the driver's structure on the GPU; none where the device has no timestamps.
    pub bvh_ms: Option<Spread>,
    /// Time of refitting the driver's structure to triangles that have moved; it is built to allow that. None where
    /// the device has no timestamps.
    pub refit_ms: Option<Spread>,
    /// Number of timed builds of each structure on the GPU, the driver's and kdray's, and of refits.
    pub n_bvh_builds: usize,
    /// Times of kdray's kd-tree, with slabs, and grids on the GPU. There is no kd-tree where the device has too little
    /// room to build it.
    pub on_device: Vec<DeviceBuilds>,
}

/// Times of building one kind of structure on the GPU.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DeviceBuilds {
    /// `kdtree`, `grid` or `grid2`.
    pub accel: String,
    /// Time from the beginning of the first kernel to the end of the last one; none where the device has no
    /// timestamps.
    pub ms: Option<Spread>,
    /// The stages of the last build.
    pub stages: Vec<BuildStage>,
}

impl Builds {
    /// Builds the driver's structure, and kdray's on the GPU. Returns the times and the driver's structure.
    ///
    /// # Errors
    /// A structure exceeds the device's limits or memory.
    pub fn measure(context: &Arc<Context>, stage: &Stage) -> Result<(Self, DriverAccel), GpuError> {
        let triangles = &stage.scene().triangles;
        // The first build is a warm-up, whose time does not count.
        let mut driver_accel = DriverAccel::new(context, triangles)?;
        let mut bvh_ms = Vec::new();
        for _ in 0..N_BUILDS {
            driver_accel = DriverAccel::new(context, triangles)?;
            bvh_ms.push(driver_accel.build_ms());
        }
        let refit_ms = DriverAccel::refits(context, triangles, N_BUILDS)?;
        let grids = [(AccelKind::Grid, GridOptions::uniform()), (AccelKind::Grid2, GridOptions::two_level())];
        let mut on_device: Vec<_> = DeviceBuilds::of_tree(context, triangles)?.into_iter().collect();
        for (kind, options) in &grids {
            on_device.push(DeviceBuilds::of_grid(context, triangles, *kind, options)?);
        }
        let builds = Self {
            tree_ms: stage.tree_build_ms,
            n_threads: rayon::current_num_threads(),
            bvh_ms: Spread::of(bvh_ms.into_iter().flatten()),
            refit_ms: Spread::of(refit_ms),
            n_bvh_builds: N_BUILDS,
            on_device,
        };
        Ok((builds, driver_accel))
    }
}

impl DeviceBuilds {
    /// Builds the kd-tree. Returns none if the device has too little room.
    fn of_tree(context: &Arc<Context>, triangles: &[Triangle]) -> Result<Option<Self>, GpuError> {
        let on_device = Buffer::with(context, "triangles", triangles, BufferUse::Texels)?;
        let builder = match KdTreeBuilder::new(context, &on_device, &KdTreeBuilderOptions::default()) {
            Err(error) if error.is_lack_of_room() => return Ok(None),
            builder => builder?,
        };
        let timer = Timer::new(context, builder.n_stages())?;
        let build = || Ok(builder.build(Some(&timer))?.report(triangles.len()));
        Self::measure(AccelKind::KdTree, build).map(Some)
    }

    fn of_grid(
        context: &Arc<Context>,
        triangles: &[Triangle],
        kind: AccelKind,
        options: &GridOptions,
    ) -> Result<Self, GpuError> {
        let on_device = Buffer::with(context, "triangles", triangles, BufferUse::Texels)?;
        let builder = GridBuilder::new(context, &on_device, options)?;
        let timer = Timer::new(context, builder.n_stages())?;
        Self::measure(kind, || Ok(builder.build(Some(&timer))?.report(triangles.len())))
    }

    /// Builds a structure several times. `build` builds it once.
    fn measure(kind: AccelKind, build: impl Fn() -> Result<DeviceBuild, GpuError>) -> Result<Self, GpuError> {
        warm_up(|| build().map(drop))?;
        let reports = (0..N_BUILDS).map(|_| build()).collect::<Result<Vec<_>, _>>()?;
        let ms = Spread::of(reports.iter().filter_map(|report| report.ms));
        let stages = reports.into_iter().next_back().map_or_else(Vec::new, |report| report.stages);
        Ok(Self { accel: kind.to_string(), ms, stages })
    }
}
