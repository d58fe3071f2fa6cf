//! The benchmark of the paper's table: four scenes at three sizes, rendered on the GPU and on one thread of the CPU.

use std::sync::Arc;

use rayon::{ThreadPoolBuildError, ThreadPoolBuilder};
use serde::Serialize;

use super::{
    Spread,
    chart::{BarChart, Scale, Series},
    warm_up,
};
use crate::{
    accel::kdtree::Traversal,
    cpu,
    engine::choices::{Request, primary_by_rule},
    frame::{BounceStats, Goal, Profile, RenderOptions},
    gpu::{Device, GpuError},
    render::BandedRenderer,
    world::{FlatScene, World},
};

/// The shipped scenes' names, in the paper's order.
pub const SCENES: [&str; 4] = ["cornell", "paper2", "paper3", "paper4"];
/// The paper's picture sizes, in pixels.
pub const SIZES: [(u32, u32); 3] = [(640, 480), (800, 600), (1024, 768)];
/// Times of the paper's table in milliseconds: one row per size, one column per scene. The first of each pair is the
/// CPU's time, the second that of a GTX 285.
const REPORTED_MS: [[(u32, u32); 4]; 3] = [
    [(2316, 32), (5590, 82), (10_059, 411), (6459, 374)],
    [(3551, 49), (8523, 108), (15_054, 539), (10_103, 534)],
    [(5723, 77), (14_106, 188), (24_736, 730), (16_213, 848)],
];

/// The paper's times for a scene of the same triangle count; its geometry was not published.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Reported {
    pub cpu_ms: f64,
    pub gpu_ms: f64,
    pub speedup: f64,
}

impl Reported {
    /// Returns `None` for a scene or a size that the paper does not have.
    pub fn of(scene: &str, size: (u32, u32)) -> Option<Self> {
        let row = SIZES.iter().position(|known| *known == size)?;
        let column = SCENES.iter().position(|known| *known == scene)?;
        let (cpu_ms, gpu_ms) = REPORTED_MS[row][column];
        let (cpu_ms, gpu_ms) = (f64::from(cpu_ms), f64::from(gpu_ms));
        Some(Self { cpu_ms, gpu_ms, speedup: cpu_ms / gpu_ms })
    }
}

/// Returns the scene's own options at another size and with another traversal.
pub fn options(scene: &FlatScene, (width, height): (u32, u32), traversal: Traversal) -> RenderOptions {
    RenderOptions { traversal, width, height, ..scene.defaults.options() }
}

/// Draws frames on a device and returns their profiles. The method for primary rays is the one that suits the device.
/// A warm-up comes first; it also finds the number of batches that a frame needs.
///
/// # Errors
/// Fails as [`BandedRenderer::new`] and [`BandedRenderer::draw`] do.
pub fn draw_on_gpu(
    device: &Device,
    world: &World,
    options: &RenderOptions,
    n_frames: u16,
) -> Result<Vec<Profile>, GpuError> {
    let (scene, context) = (world.scene(), device.inner());
    let primary = primary_by_rule(Some(context), scene.triangles.len(), (options.width, options.height));
    let options = &RenderOptions { primary, ..options.clone() };
    let mut renderer = BandedRenderer::new(Arc::clone(context), world, options)?;
    let mut draw = || renderer.draw(Goal::Samples(1), &mut || ()).map(|drawn| drawn.profile);
    warm_up(|| draw().map(drop))?;
    (0..n_frames).map(|_| draw()).collect()
}

/// Draws frames on one CPU thread, as the paper does, and returns their profiles. The traversal is the one that suits
/// the CPU.
///
/// # Errors
/// The thread cannot be started.
pub fn draw_on_cpu(
    world: &World,
    options: &RenderOptions,
    n_frames: u16,
) -> Result<Vec<Profile>, ThreadPoolBuildError> {
    let size = (options.width, options.height);
    let options = &Request::default().methods_by_rule(None, world.scene().triangles.len(), size).apply(options);
    let draw = || cpu::render(world, options);
    let thread = ThreadPoolBuilder::new().num_threads(1).build()?;
    Ok(thread.install(|| (0..n_frames).map(|_| draw().1).collect()))
}

/// The result for one scene at one size.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    pub scene: String,
    /// Width of the picture, in pixels.
    pub width: u32,
    /// Height of the picture, in pixels.
    pub height: u32,
    pub max_depth: u32,
    pub n_triangles: usize,
    pub n_primary_rays: u64,
    pub n_secondary_rays: u64,
    pub n_shadow_rays: u64,
    /// Time of a frame on the GPU; none where the device has no timestamps.
    pub gpu_ms: Option<Spread>,
    /// Time of a frame on one CPU thread; none where the CPU was left out.
    pub cpu_ms: Option<Spread>,
    /// Median CPU time divided by median GPU time.
    pub speedup: Option<f64>,
    /// Million rays per second in whole frames on the GPU, where all kinds of rays count.
    pub mrays_per_s: Option<Spread>,
    pub paper: Option<Reported>,
}

impl Row {
    /// Makes the row from the profiles of one or more frames on a device and of frames on one CPU thread.
    pub fn new(scene: &FlatScene, options: &RenderOptions, on_gpu: &[Profile], on_cpu: &[Profile]) -> Self {
        let size = (options.width, options.height);
        let times = |frames: &[Profile]| Spread::of(frames.iter().filter_map(|frame| frame.frame_ms));
        let bounces = on_gpu.first().map_or(&[][..], |frame| &frame.bounces);
        let n_rays = |bounces: &[BounceStats]| bounces.iter().map(|bounce| bounce.n_rays).sum::<u64>();
        let (first, later) = bounces.split_at(bounces.len().min(1));
        let mut row = Self {
            scene: scene.name.clone(),
            width: options.width,
            height: options.height,
            max_depth: options.max_depth,
            n_triangles: scene.triangles.len(),
            n_primary_rays: n_rays(first),
            n_secondary_rays: n_rays(later),
            n_shadow_rays: bounces.iter().map(|bounce| bounce.n_shadow_rays).sum(),
            gpu_ms: times(on_gpu),
            cpu_ms: times(on_cpu),
            speedup: None,
            mrays_per_s: None,
            paper: Reported::of(&scene.name, size),
        };
        row.speedup = row.cpu_ms.zip(row.gpu_ms).filter(|(_, gpu)| gpu.median > 0.0).map(|(c, g)| c.median / g.median);
        row.mrays_per_s = row.gpu_ms.and_then(|gpu| gpu.mrays_per_s(row.n_rays()));
        row
    }

    /// Returns the number of primary, secondary and shadow rays together.
    pub fn n_rays(&self) -> u64 {
        self.n_primary_rays + self.n_secondary_rays + self.n_shadow_rays
    }
}

/// The suite's report.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Name of the suite: `paper`.
    pub suite: &'static str,
    /// The device's own name.
    pub device: String,
    /// The driver's name and version.
    pub driver: String,
    /// Traversal of the kd-tree on the device.
    pub traversal: String,
    /// Number of frames on the device, without those of the warm-up.
    pub n_gpu_frames: u16,
    /// Number of frames on one CPU thread; 0 where the CPU was left out.
    pub n_cpu_frames: u16,
    pub rows: Vec<Row>,
}

impl Report {
    /// Returns a chart of kdray's times beside the paper's, on a logarithmic scale.
    pub fn chart(&self) -> BarChart {
        let column = |name: &str, value: fn(&Row) -> Option<f64>| Series {
            name: name.to_owned(),
            values: self.rows.iter().map(value).collect(),
        };
        BarChart {
            title: format!("The paper's scenes on {}", self.device),
            unit: "ms a frame".to_owned(),
            scale: Scale::Logarithmic,
            groups: self.rows.iter().map(|row| format!("{}\n{}x{}", row.scene, row.width, row.height)).collect(),
            series: vec![
                column("kdray, GPU", |row| row.gpu_ms.map(|ms| ms.median)),
                column("paper, GTX 285", |row| row.paper.map(|paper| paper.gpu_ms)),
                column("kdray, one CPU thread", |row| row.cpu_ms.map(|ms| ms.median)),
                column("paper, CPU", |row| row.paper.map(|paper| paper.cpu_ms)),
            ],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_table_is_read_by_scene_and_size() {
        let glass = Reported::of("paper3", (800, 600)).unwrap();
        assert_eq!((glass.cpu_ms, glass.gpu_ms), (15_054.0, 539.0));
        assert!((glass.speedup - 27.93).abs() < 0.01);
        assert_eq!(Reported::of("paper3", (600, 800)), None);
        assert_eq!(Reported::of("knot", (800, 600)), None);
    }
}
