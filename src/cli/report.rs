//! The report of `kdray render`: the times and rays of a frame, as tables and as JSON.

use std::path::{Path, PathBuf};

use kdray::{
    accel::{DeviceBuild, Statistics},
    engine::{MomentWork, choices::Choices},
    frame::{Denoise, PassTime, Profile, RenderOptions},
    output,
};
use serde::Serialize;

use super::{
    error::CliError,
    table::{decimal, table},
};

/// Returns a phrase that says how long the acceleration structure took to build. `on_host` is the host's build time
/// in milliseconds, which is shown unless the device has built the structure.
pub fn built_in(on_host: f64, on_device: Option<&DeviceBuild>) -> String {
    match on_device {
        Some(build) => format!("built in {} ms on the device", decimal(build.ms, 3)),
        None => format!("built in {on_host:.0} ms"),
    }
}

/// Returns a report as JSON that ends with a line break.
pub fn json(report: &impl Serialize) -> String {
    serde_json::to_string_pretty(report).expect("plain structs of numbers and words") + "\n"
}

/// Writes a report to the JSON file that the user has named, if any.
pub fn write_json(path: Option<&PathBuf>, report: &impl Serialize) -> Result<(), CliError> {
    Ok(path.map_or(Ok(()), |path| output::write(path, json(report).as_bytes()))?)
}

/// Version of the names in the JSON of `--profile` and of `inspect`. 2: passes and terms have the field's names
/// (`pixel_aovs`, `auxiliary`, `atrous_filter` in place of `features`, `guides`, `edge_filter`; opacity is `opaque`,
/// `blend` or `mask`, as in glTF). 3: `device_build` in place of `grid_build`.
pub const SCHEMA: u32 = 3;

/// The report: the scene, the files, the options and choices, and the times and rays of the frame.
#[derive(Serialize)]
pub struct Report {
    /// [`SCHEMA`].
    pub schema: u32,
    pub scene: String,
    /// Files of the pictures in the order of frames, at least one.
    pub pictures: Vec<PathBuf>,
    /// Files written beside the pictures: layers and heat maps.
    pub extra_files: Vec<PathBuf>,
    pub options: Options,
    /// The choices of structure, build, traversal and primary visibility, each with its reason.
    pub choices: Choices,
    /// Samples per pixel.
    pub samples: u32,
    /// What `--noise` has led to; none without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise: Option<NoiseReport>,
    /// Number of devices that have drawn the pictures, or 1 for the CPU.
    pub devices: usize,
    /// Whether each of several devices drew whole frames. If so, the times of a frame are those of its device. If
    /// several devices drew each picture together, the times of passes are sums over all of them, and the time of the
    /// frame is the elapsed time.
    pub whole_frames: bool,
    pub triangles: usize,
    /// Statistics of the acceleration structure, serialized under the key `tree` or `grid`.
    #[serde(flatten)]
    pub accel: Statistics,
    /// Times of the structure's build on a device; none if no device has built one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub device_build: Option<DeviceBuild>,
    /// What the world of the last moment took; none if nothing moves.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub last_moment: Option<MomentWork>,
    pub load_ms: f64,
    pub build_ms: f64,
    /// Time from the choice of traversal and primary visibility to the pictures in memory, with uploading, compiling
    /// and copying back. The choice itself, which may include a measurement, and the writing of files do not count.
    pub render_ms: f64,
    /// Times of all frames that were drawn; none for a single frame.
    pub repeated: Option<FrameTimeRange>,
    /// The frame of median time.
    #[serde(flatten)]
    pub frame: Frame,
}

/// How many samples the tiles of pictures needed until their noise was low.
#[derive(Serialize)]
pub struct NoiseReport {
    /// The most noise that tiles should have.
    pub goal: f32,
    /// Samples of a pixel, on average.
    pub mean_samples: f64,
    /// Number of tiles of all pictures.
    pub n_tiles: usize,
    /// Number of tiles that have the most samples, but more noise than the goal.
    pub n_noisy_tiles: usize,
}

impl NoiseReport {
    fn text(&self) -> String {
        let Self { goal, mean_samples, n_tiles, n_noisy_tiles } = self;
        let reached = match n_noisy_tiles {
            0 => "all tiles have no more".to_owned(),
            n => format!("{n} of {n_tiles} tiles have more, but the most samples"),
        };
        format!("noise {goal}: {mean_samples:.1} samples a pixel on average, {reached}\n\n")
    }
}

/// Range of the times of several frames: one frame drawn repeatedly, or the frames of a path.
#[derive(Serialize)]
pub struct FrameTimeRange {
    n_frames: usize,
    min_ms: f64,
    max_ms: f64,
}

impl FrameTimeRange {
    /// Returns the frames' minimum and maximum time; none for a single frame, or without timestamps.
    pub fn of(profiles: &[Profile]) -> Option<Self> {
        let times: Vec<_> = profiles.iter().filter_map(|profile| profile.frame_ms).collect();
        (times.len() > 1).then(|| Self {
            n_frames: times.len(),
            min_ms: times.iter().copied().fold(f64::INFINITY, f64::min),
            max_ms: times.iter().copied().fold(0.0, f64::max),
        })
    }
}

/// [`RenderOptions`] as they are written to JSON.
#[derive(Serialize)]
pub struct Options {
    width: u32,
    height: u32,
    /// The crop as `x0,y0,x1,y1` in pixels; none for the whole picture.
    crop: Option<String>,
    integrator: String,
    max_depth: u32,
    exposure: f32,
    tonemap: String,
    denoise: &'static str,
    denoise_threshold: Option<f32>,
    traversal: String,
    primary: String,
}

impl From<&RenderOptions> for Options {
    fn from(options: &RenderOptions) -> Self {
        let (denoise, denoise_threshold) = match options.denoise {
            Denoise::Off => ("off", None),
            Denoise::Edge => ("edge", None),
            Denoise::Paper { threshold } => ("paper", Some(threshold)),
        };
        Self {
            width: options.width,
            height: options.height,
            crop: options.crop.map(|crop| crop.to_string()),
            integrator: options.integrator.to_string(),
            max_depth: options.max_depth,
            exposure: options.exposure,
            tonemap: options.tonemap.to_string(),
            denoise,
            denoise_threshold,
            traversal: options.traversal.to_string(),
            primary: options.primary.to_string(),
        }
    }
}

/// A [`Profile`] with sums and rates.
#[derive(Serialize)]
pub struct Frame {
    device: String,
    /// Time from the start of the first pass to the end of the last; none if the device has no timestamps.
    frame_ms: Option<f64>,
    n_batches: u32,
    /// Time of each pass summed over all bounces, in the order of execution.
    pass_totals: Vec<PassTotal>,
    /// Times of each pass of each bounce.
    passes: Vec<PassTime>,
    /// Counts and rates of each bounce; bounce 0 consists of the primary rays.
    bounces: Vec<Bounce>,
    /// The shadow rays of all bounces.
    shadow: Shadow,
}

#[derive(Serialize)]
struct PassTotal {
    name: &'static str,
    ms: Option<f64>,
    /// Share of the frame's time, 0 to 1.
    share: Option<f64>,
}

#[derive(Serialize)]
struct Bounce {
    bounce: usize,
    n_rays: u64,
    n_hits: u64,
    n_shadow_rays: u64,
    /// Time in milliseconds of the passes that find the closest hits of the bounce's rays.
    tracing_ms: Option<f64>,
    /// Million rays per second of `tracing_ms`.
    mrays_per_s: Option<f64>,
}

/// Counts and rates of the shadow rays, which are cast after the hits of all bounces are found.
#[derive(Serialize)]
struct Shadow {
    n_shadow_rays: u64,
    ms: Option<f64>,
    /// Million shadow rays per second.
    mrays_per_s: Option<f64>,
}

impl From<Profile> for Frame {
    fn from(profile: Profile) -> Self {
        Self {
            pass_totals: pass_totals(&profile),
            bounces: bounces(&profile),
            shadow: shadow(&profile),
            device: profile.device,
            frame_ms: profile.frame_ms,
            n_batches: profile.n_batches,
            passes: profile.passes,
        }
    }
}

fn pass_totals(profile: &Profile) -> Vec<PassTotal> {
    let mut totals: Vec<PassTotal> = Vec::new();
    for pass in &profile.passes {
        if totals.iter().all(|total| total.name != pass.name) {
            let ms = profile.pass_ms(pass.name);
            let share = ms.zip(profile.frame_ms).filter(|(_, frame)| *frame > 0.0).map(|(ms, frame)| ms / frame);
            totals.push(PassTotal { name: pass.name, ms, share });
        }
    }
    totals
}

fn bounces(profile: &Profile) -> Vec<Bounce> {
    let rows = profile.bounces.iter().enumerate().map(|(bounce, stats)| {
        let tracing_ms = profile.tracing_ms(bounce as u32);
        Bounce {
            bounce,
            n_rays: stats.n_rays,
            n_hits: stats.n_hits,
            n_shadow_rays: stats.n_shadow_rays,
            tracing_ms,
            mrays_per_s: rate(stats.n_rays, tracing_ms),
        }
    });
    rows.collect()
}

fn shadow(profile: &Profile) -> Shadow {
    let n_shadow_rays = profile.bounces.iter().map(|bounce| bounce.n_shadow_rays).sum();
    let ms = profile.shadow_ms();
    Shadow { n_shadow_rays, ms, mrays_per_s: rate(n_shadow_rays, ms) }
}

/// Returns million rays per second, or none if the time is unknown or 0.
fn rate(n_rays: u64, ms: Option<f64>) -> Option<f64> {
    ms.filter(|ms| *ms > 0.0).map(|ms| n_rays as f64 / ms / 1e3)
}

impl Report {
    /// The report as text that ends with a line break.
    pub fn text(&self) -> String {
        let Options { width, height, crop, .. } = &self.options;
        let crop = crop.as_ref().map(|crop| format!(" ({crop} of it)")).unwrap_or_default();
        let samples = match (&self.noise, self.samples) {
            (None, 2..) => format!(", {} samples a pixel,", self.samples),
            _ => String::new(),
        };
        let mut text = format!("{}: {} triangles, loaded in {:.0} ms\n", self.scene, self.triangles, self.load_ms);
        text += &format!("{}, {}\n", self.accel, built_in(self.build_ms, self.device_build.as_ref()));
        text += &format!(
            "{width}x{height}{crop}{samples} on {}: picture after {:.0} ms\n{}\n\n",
            self.frame.device, self.render_ms, self.choices
        );
        text += &self.noise.as_ref().map(NoiseReport::text).unwrap_or_default();
        if self.frame.frame_ms.is_none() {
            text += "This device has no timestamps: where the time went is unknown.\n\n";
        }
        if self.devices > 1 {
            text += &format!("{} devices: ", self.devices);
            text += match self.whole_frames {
                true => "each drew whole frames, and the times are those of one frame on its device\n\n",
                false => "the times of passes are sums over all, the frame's is that of the clock\n\n",
            };
        }
        if let Some(FrameTimeRange { n_frames, min_ms, max_ms }) = &self.repeated {
            text += &format!("the median of {n_frames} frames, which took {min_ms:.3} to {max_ms:.3} ms:\n\n");
        }
        text += &self.frame.passes_text();
        text.push('\n');
        text += &self.frame.bounces_text();
        text.push('\n');
        text += &self.files_text();
        text
    }

    /// The report of one of several scenes, a line.
    pub fn line(&self, scene: &Path) -> String {
        let Options { width, height, .. } = &self.options;
        let samples = if self.samples == 1 { "sample" } else { "samples" };
        let files = self.extra_files.iter().chain(&self.pictures).map(|path| path.display().to_string());
        format!(
            "{}: {} triangles, {width}x{height}, {} {samples}, loaded in {:.0} ms, picture after {:.0} ms, wrote {}",
            scene.display(),
            self.triangles,
            self.samples,
            self.load_ms,
            self.render_ms,
            files.collect::<Vec<_>>().join(" and ")
        )
    }

    fn files_text(&self) -> String {
        if let [first, .., last] = &self.pictures[..] {
            let (n_pictures, n_extra) = (self.pictures.len(), self.extra_files.len());
            let beside = if n_extra > 0 { format!(", and {n_extra} files beside them") } else { String::new() };
            let first = if first == last { String::new() } else { format!(", {}", first.display()) };
            return format!("wrote {n_pictures} pictures{first} to {}{beside}\n", last.display());
        }
        let paths = self.extra_files.iter().chain(&self.pictures);
        paths.map(|path| format!("wrote {}\n", path.display())).collect()
    }
}

impl Frame {
    fn passes_text(&self) -> String {
        let row = |name: &str, ms, share: Option<f64>| {
            [name.to_owned(), decimal(ms, 3), decimal(share.map(|share| share * 100.0), 1)]
        };
        let mut rows: Vec<_> = self.pass_totals.iter().map(|total| row(total.name, total.ms, total.share)).collect();
        rows.push(row("frame", self.frame_ms, self.frame_ms.map(|_| 1.0)));
        table(["pass", "ms", "% of frame"], &rows)
    }

    fn bounces_text(&self) -> String {
        let row = |name: &str, counts: [Option<u64>; 3], ms, rate| {
            let [n_rays, n_hits, n_shadow_rays] = counts.map(|n| n.map_or_else(String::new, |n| n.to_string()));
            [name.to_owned(), n_rays, n_hits, n_shadow_rays, decimal(ms, 3), decimal(rate, 2)]
        };
        let mut rows: Vec<_> = (self.bounces.iter())
            .map(|b| {
                let counts = [b.n_rays, b.n_hits, b.n_shadow_rays].map(Some);
                row(&b.bounce.to_string(), counts, b.tracing_ms, b.mrays_per_s)
            })
            .collect();
        let Shadow { n_shadow_rays, ms: shadow_ms, mrays_per_s } = self.shadow;
        rows.push(row("shadow", [None, None, Some(n_shadow_rays)], shadow_ms, mrays_per_s));
        let sum = |count: fn(&Bounce) -> u64| self.bounces.iter().map(count).sum::<u64>();
        let (n_rays, n_hits) = (sum(|b| b.n_rays), sum(|b| b.n_hits));
        let ms: Option<f64> = self.bounces.iter().map(|bounce| bounce.tracing_ms).chain([shadow_ms]).sum();
        let counts = [n_rays, n_hits, n_shadow_rays].map(Some);
        rows.push(row("all", counts, ms, rate(n_rays + n_shadow_rays, ms)));
        table(["bounce", "rays", "hits", "shadow rays", "tracing ms", "Mrays/s"], &rows)
    }
}

#[cfg(test)]
mod tests {
    use kdray::frame::BounceStats;

    use super::*;

    fn frame(ms: impl Fn(f64) -> Option<f64>) -> Frame {
        let pass = |name, bounce, time| PassTime { name, bounce, ms: ms(time), ..PassTime::default() };
        let stats = |n_rays, n_shadow_rays| BounceStats { n_rays, n_hits: 3, n_shadow_rays };
        Frame::from(Profile {
            device: "d".to_owned(),
            passes: vec![
                pass("rasterize_triangles", None, 0.75),
                pass("rasterize_blocks", None, 0.25),
                pass("primary_hit", Some(0), 1.0),
                pass("compact_scatter", Some(0), 4.0),
                pass("trace", Some(1), 1.5),
                pass("compact_scatter", Some(1), 0.5),
                pass("shadow", None, 0.5),
            ],
            bounces: vec![stats(3000, 900), stats(500, 100)],
            n_batches: 1,
            frame_ms: ms(10.0),
            begun_at: None,
        })
    }

    #[test]
    fn times_are_summed_by_pass_and_by_bounce() {
        let frame = frame(Some);
        let names: Vec<_> = frame.pass_totals.iter().map(|total| total.name).collect();
        assert_eq!(
            names,
            ["rasterize_triangles", "rasterize_blocks", "primary_hit", "compact_scatter", "trace", "shadow"]
        );
        assert_eq!((frame.pass_totals[3].ms, frame.pass_totals[3].share), (Some(4.5), Some(0.45)));
        assert_eq!((frame.bounces[0].tracing_ms, frame.bounces[0].mrays_per_s), (Some(2.0), Some(1.5)));
        assert_eq!((frame.bounces[1].tracing_ms, frame.bounces[1].mrays_per_s), (Some(1.5), Some(0.5 / 1.5)));
        assert_eq!((frame.shadow.ms, frame.shadow.mrays_per_s), (Some(0.5), Some(2.0)));
        assert!(frame.bounces_text().ends_with("all     3500     6         1000       4.000     1.12\n"));
        assert!(frame.passes_text().ends_with("frame                10.000       100.0\n"));
    }

    #[test]
    fn without_timestamps_there_are_dashes() {
        let frame = frame(|_| None);
        assert!(frame.pass_totals.iter().all(|total| total.ms.is_none() && total.share.is_none()));
        for text in [frame.passes_text(), frame.bounces_text()] {
            let last: Vec<_> = text.lines().last().unwrap().split_whitespace().collect();
            assert!(last.ends_with(&["-", "-"]), "{text}");
        }
    }
}
