//! Times of building the structures over the same triangles: the driver's and kdray's own.

use std::sync::Arc;

use serde::Serialize;

use crate::{
    accel::{
        Search,
        grid::{BuildStage, GridOptions},
    },
    bench::{Spread, stage::Stage, warm_up},
    gpu::{Buffer, BufferUse, Context, DriverAccel, GpuError, Timer},
    passes::grid::GridBuilder,
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
    /// Number of timed builds of each structure on the GPU, the driver's and the grids.
    pub n_bvh_builds: usize,
    /// Times of kdray's grids on the GPU.
    pub grids: Vec<GridBuilds>,
}

/// Times of building one kind of grid.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GridBuilds {
    /// `grid` or `grid2`.
    pub accel: String,
    /// Time from the beginning of the first kernel to the end of the last one; none where the device has no
    /// timestamps.
    pub ms: Option<Spread>,
    /// The stages of the last build.
    pub stages: Vec<BuildStage>,
}

impl Builds {
    /// Builds the driver's structure and both grids. Returns the times and the driver's structure.
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
        let grids = [(Search::Grid, GridOptions::uniform()), (Search::Grid2, GridOptions::two_level())];
        let builds = Self {
            tree_ms: stage.tree_build_ms,
            n_threads: rayon::current_num_threads(),
            bvh_ms: Spread::of(bvh_ms.into_iter().flatten()),
            n_bvh_builds: N_BUILDS,
            grids: (grids.iter())
                .map(|(variant, options)| GridBuilds::measure(context, stage, *variant, options))
                .collect::<Result<_, _>>()?,
        };
        Ok((builds, driver_accel))
    }
}

impl GridBuilds {
    fn measure(
        context: &Arc<Context>,
        stage: &Stage,
        variant: Search,
        options: &GridOptions,
    ) -> Result<Self, GpuError> {
        let triangles = &stage.scene().triangles;
        let on_device = Buffer::with(context, "triangles", triangles, BufferUse::Texels)?;
        let builder = GridBuilder::new(context, &on_device, options)?;
        let timer = Timer::new(context, builder.n_stages())?;
        let build = || Ok::<_, GpuError>(builder.build(Some(&timer), BufferUse::Texels)?.report(triangles.len()));
        warm_up(|| build().map(drop))?;
        let reports = (0..N_BUILDS).map(|_| build()).collect::<Result<Vec<_>, _>>()?;
        let ms = Spread::of(reports.iter().filter_map(|report| report.ms));
        let stages = reports.into_iter().next_back().map_or_else(Vec::new, |report| report.stages);
        Ok(Self { accel: variant.to_string(), ms, stages })
    }
}
