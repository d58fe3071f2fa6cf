//! The arguments of the subcommands, and the defaults of those that are left out.

use std::{
    path::{Path, PathBuf},
    str::FromStr,
    time::Duration,
};

use clap::{Parser, Subcommand, value_parser};
use kdray::{
    accel::{AccelKind, Query, kdtree::Traversal},
    engine::{NoiseGoal, choices::Request},
    frame::{Aov, Crop, Denoise, Integrator, RenderOptions, SampleRange},
    gpu::DeviceSelector,
    scene::{Scene, packed_path},
};

#[cfg(feature = "bench")]
use super::bench::Suite;
#[cfg(feature = "view")]
pub use super::view_args::ViewArgs;
use super::{
    device_args::{DeviceList, Requirement, device},
    doctor::probe,
    error::CliError,
    file_roles::require_ending,
    load_args::LoadArgs,
    look_args::LookArgs,
    openjd::ProgressKind,
    picture_args::{PictureArgs, StructureArgs, accel_help, accel_long_help, listed, with_words},
    render::{Seed, Shutter},
};

const PROGRESS: &str = "How the progress is shown: auto, none, or openjd for schedulers of Open Job Description \
                        [default: auto]";
const PROGRESS_LONG: &str = "How the progress is shown [default: auto]

- auto: on standard error, as a bar or as lines, without --quiet
- none: not at all; the report and notes remain
- openjd: on standard output, as lines that schedulers of Open Job Description read: openjd_progress, \
                             openjd_status, and openjd_fail if the command fails; also with --quiet
- openjd:A-B: the same for one of several commands of a task, as percents A to B of the task";
const AOV: &str = "Layers of each pixel to write into an .exr, separated by commas";

/// Ray tracing by depth-first kd-tree traversal, in Vulkan compute.
#[derive(Parser)]
#[command(name = "kdray", version, arg_required_else_help = false)]
#[command(after_help = "Exit codes: 0 success, 2 usage, 3 scene, rays or parts, 4 device, 5 output, 128 + n ended by \
                  signal n.")]
pub struct Args {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Subcommand)]
pub enum Command {
    /// Render a scene to a picture, and report the time of each pass
    Render(RenderArgs),
    #[cfg(feature = "view")]
    /// Show a scene in a window; keys and mouse move the camera
    View(ViewArgs),
    /// Cast rays from a file into a scene or mesh, and write their hits
    Cast(CastArgs),
    /// Join the parts of a picture that were rendered with --crop, --tile or --samples
    Merge(MergeArgs),
    /// Put a scene and all files that it needs into one file, which is a scene file itself
    Pack(PackArgs),
    /// List the Vulkan devices
    Devices,
    /// Check whether this machine can render, and whether it can render a scene
    Doctor(DoctorArgs),
    /// Print what `doctor` asks of drivers in a process of their own
    #[command(hide = true, name = probe::SUBCOMMAND)]
    ProbeDrivers,
    /// Describe a scene and its acceleration structure
    Inspect(InspectArgs),
    /// Write a scene file that shows what another file shows, to be edited
    Convert(ConvertArgs),
    #[cfg(feature = "bench")]
    /// Measure whole frames, search algorithms, the driver's own ray tracing, or the cost of larger meshes
    #[command(subcommand)]
    Bench(Suite),
}

#[derive(clap::Args)]
pub struct RenderArgs {
    /// Scene file (TOML), mesh file (glTF, OBJ, PLY, STL), or pack; or several, which are drawn one after the other
    #[arg(value_name = "SCENE", required_unless_present = "list")]
    pub scenes: Vec<PathBuf>,
    /// Draw the scenes that this file names, too: one path a line, without blank lines and lines that begin with #; -
    /// is standard input
    #[arg(long, value_name = "FILE")]
    pub list: Option<PathBuf>,
    /// Picture to write: .png, or .exr for linear radiance; of a film, one file (.png animated, .gif, .y4m, or - for
    /// YUV4MPEG2 on standard output), or a file for each frame, where #### in the name stands for the frame's
    /// number; of several scenes, a folder, or a name in which {} stands for the scene's name, as in out/{}.exr
    /// [default: the scene's name with .png, or with .####.png, in the working directory]
    #[arg(short, long, value_name = "FILE|FOLDER")]
    pub output: Option<PathBuf>,
    /// Move the camera along the keyframes of this TOML file, and write one picture per frame
    #[arg(long, value_name = "FILE", conflicts_with = "repeat")]
    pub path: Option<PathBuf>,
    /// Go once round the scene in N frames, as seen from the height of its camera, and write one picture per frame
    #[arg(long, value_name = "N", conflicts_with_all = ["path", "repeat"])]
    #[arg(value_parser = value_parser!(u32).range(1..=100_000))]
    pub turntable: Option<u32>,
    /// Frames to render, both ends included, for example 0-99, 7, 0-99x4 for every fourth, or all, from the first
    /// keyframe to the last: of the path of --path, or the one in a pack, or else of the file's animations, which frame
    /// N shows at N / F seconds (--fps F) [default with --path: all]
    #[arg(long, value_name = "A-BxS|all", conflicts_with = "repeat")]
    pub frames: Option<FrameChoice>,
    /// Expose each picture from OPEN to CLOSE, in frames (1 / F seconds, --fps F) from its own time on, for example
    /// 0,0.5 or -0.25,0.25, so that what moves is blurred: each sample shows its own moment; for --integrator path,
    /// without a noise filter
    #[arg(long, value_name = "OPEN,CLOSE", allow_hyphen_values = true)]
    #[arg(conflicts_with_all = ["time", "noise", "trace", "repeat"])]
    pub shutter: Option<Shutter>,
    /// Which noise the picture has, for --integrator path; pictures of whitted have none, and stay the same: 0 to 32767
    /// for one that is fixed, also in films, or frame for the number of the frame (--frames, --frame), so that each has
    /// its own [default: 0]
    #[arg(long, value_name = "N|frame", default_value = "0", hide_default_value = true)]
    pub seed: Seed,
    /// Leave out pictures whose files exist already, whatever they show, so that a film that was interrupted goes on
    /// where it ended
    #[arg(long, conflicts_with_all = ["repeat", "profile", "trace"])]
    pub skip_existing: bool,
    /// Render only the pixels x0 <= x < x1, y0 <= y < y1, counted from the picture's upper left corner
    #[arg(long, value_name = "x0,y0,x1,y1")]
    pub crop: Option<Crop>,
    /// Render only the tile I of N, for example 1/4: N tiles of rows make up the picture, and the first is tile 1
    #[arg(long, value_name = "I/N", conflicts_with = "crop")]
    pub tile: Option<Tile>,
    /// Samples per pixel, 1 to 65536; with --integrator whitted, the first one is at the pixel's centre [default:
    /// the scene file's, else 1; 4 for a mesh file; 1 with --trace]
    #[arg(long, value_name = "N", value_parser = value_parser!(u32).range(1..=i64::from(SampleRange::MOST)))]
    pub spp: Option<u32>,
    /// Draw as many samples of each pixel as fit into this time, at least one, for example 30s or 5m; loading and
    /// building do not count
    #[arg(long, value_name = "TIME", value_parser = time)]
    #[arg(conflicts_with_all = ["spp", "samples", "repeat", "trace", "path", "frames", "tile"])]
    pub time: Option<Duration>,
    /// End each scene after this time from the beginning of its loading, for example 90s: with the samples so far if
    /// there are any, else without a picture
    #[arg(long, value_name = "TIME", value_parser = time)]
    pub time_limit: Option<Duration>,
    /// Draw each tile of 16x16 pixels until its noise is at most this, 0.0001 to 1: 0.01 is an error of a hundredth of
    /// white; --spp is the most samples of a pixel, 32, 64, 128 or a higher power of two [default with --noise: 4096];
    /// for --integrator path, without a noise filter
    #[arg(long, value_name = "NOISE", value_parser = noise)]
    #[arg(conflicts_with_all = ["time", "samples", "repeat", "trace"])]
    pub noise: Option<f32>,
    /// Render only some of the samples of each pixel to an .exr file, from A on up to but without B, for example 0-32;
    /// both are multiples of 16, or B is the number of all samples; `kdray merge` joins such files; for --integrator
    /// path, without a noise filter
    #[arg(long, value_name = "A-B", conflicts_with_all = ["trace", "repeat"])]
    pub samples: Option<SampleRange>,
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    #[arg(help = with_words(AOV, None, &Aov::words()), long_help = listed(AOV, "none", &Aov::descriptions()))]
    pub aov: Vec<Aov>,
    #[command(flatten)]
    pub load: LoadArgs,
    #[command(flatten)]
    pub look: LookArgs,
    #[command(flatten)]
    pub picture: PictureArgs,
    /// Render on the CPU, without Vulkan
    #[arg(long, conflicts_with_all = ["device", "validate"])]
    pub cpu: bool,
    /// Number of CPU threads for loading, building and --cpu, 1 to 1024 [default: one per processor]
    #[arg(long, value_name = "N", value_parser = value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Vulkan device to use, or several that share the drawing: indices in `kdray devices` or parts of names, separated
    /// by commas, or `all` for all devices of the best one's kind [default: a discrete GPU, else an integrated one,
    /// else a software driver]
    #[arg(long, value_name = "LIST|all")]
    pub device: Option<DeviceList>,
    /// Fail at once unless the devices are of this kind: gpu refuses software drivers
    #[arg(long, value_name = "KIND", conflicts_with = "cpu")]
    pub require: Option<Requirement>,
    /// Number of times to draw the frame, 1 to 10000; the report shows the frame of median time
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = value_parser!(u16).range(1..=10_000))]
    pub repeat: u16,
    /// Write the report to this JSON file, with the time and the ray counts of each pass of each bounce
    #[arg(long, value_name = "FILE")]
    pub profile: Option<PathBuf>,
    /// Write a timeline of the CPU's and the device's work to this file, as Chrome trace events for Perfetto or
    /// chrome://tracing
    #[arg(long, value_name = "FILE")]
    pub trace: Option<PathBuf>,
    /// Run under the Khronos validation layer, and fail if it reports anything
    #[arg(long)]
    pub validate: bool,
    #[arg(long, value_name = "KIND", help = PROGRESS, long_help = PROGRESS_LONG)]
    #[arg(default_value = "auto", hide_default_value = true)]
    pub progress: ProgressKind,
    /// Print errors only
    #[arg(short, long)]
    pub quiet: bool,
}

#[derive(clap::Args)]
pub struct CastArgs {
    /// Mesh file (glTF, OBJ, PLY, STL) or scene file
    pub mesh: PathBuf,
    #[command(flatten)]
    pub load: LoadArgs,
    /// Rays to cast, a .npy file of float32: K x 8 (origin, direction, t_min, t_max), or K x 6 for t from 0 to
    /// infinity; directions need not be unit vectors, but a ray whose direction is shorter than 1.2e-38 misses. With
    /// --closest, points: K x 4 (x, y, z, t_max), or K x 3 for any distance
    pub rays: PathBuf,
    /// Hits to write, a .npz file of the arrays t_hit, instance_ids, geometry_ids, primitive_ids, primitive_uvs and
    /// primitive_normals, or with --any of a single array, occluded
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Find only whether each ray hits anything (occlusion), not the closest hit
    #[arg(long)]
    pub any: bool,
    /// Find the closest point of the mesh to each of the points in RAYS; t_hit is its distance
    #[arg(long, conflicts_with_all = ["any", "traversal", "count", "all"])]
    pub closest: bool,
    /// Count all triangles that each ray meets: the array hit_counts
    #[arg(long, conflicts_with_all = ["any", "repeat"])]
    pub count: bool,
    /// List all hits of each ray in the order of t, or the K nearest ones: ray_splits, and the arrays of the closest
    /// hits with a row for each hit
    #[arg(long, value_name = "K", num_args = 0..=1, conflicts_with_all = ["any", "count", "repeat"])]
    #[arg(value_parser = value_parser!(u32).range(1..))]
    pub all: Option<Option<u32>>,
    #[command(flatten)]
    pub structure: StructureArgs,
    /// Number of times to cast the rays, 1 to 10000; the report shows the minimum, median and maximum time
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = value_parser!(u16).range(1..=10_000))]
    pub repeat: u16,
    /// Cast on the CPU, without Vulkan
    #[arg(long, conflicts_with_all = ["device", "validate"])]
    pub cpu: bool,
    /// Number of CPU threads for loading, building and --cpu, 1 to 1024 [default: one per processor]
    #[arg(long, value_name = "N", value_parser = value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Vulkan device to use: its index in `kdray devices`, or a part of its name [default: a
    /// discrete GPU, else an integrated one, else a software driver]
    #[arg(long, value_name = "INDEX|NAME", value_parser = device)]
    pub device: Option<DeviceSelector>,
    /// Fail at once unless the devices are of this kind: gpu refuses software drivers
    #[arg(long, value_name = "KIND", conflicts_with = "cpu")]
    pub require: Option<Requirement>,
    /// Run under the Khronos validation layer, and fail if it reports anything
    #[arg(long)]
    pub validate: bool,
    /// Write the report to this JSON file, too
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Print errors only
    #[arg(short, long)]
    pub quiet: bool,
}

#[derive(clap::Args)]
pub struct InspectArgs {
    /// Scene file (TOML), or mesh file (glTF, OBJ, PLY, STL)
    pub scene: PathBuf,
    #[arg(long, value_name = "KIND", help = accel_help(), long_help = accel_long_help(), default_value_t)]
    #[arg(hide_default_value = true)]
    pub accel: AccelKind,
    #[command(flatten)]
    pub load: LoadArgs,
    /// Print the description as JSON
    #[arg(long)]
    pub json: bool,
}

#[derive(clap::Args)]
pub struct DoctorArgs {
    /// Scene file (TOML), mesh file (glTF, OBJ, PLY, STL), or pack to check
    pub scene: Option<PathBuf>,
    #[command(flatten)]
    pub load: LoadArgs,
    /// Print the findings as JSON
    #[arg(long)]
    pub json: bool,
}

#[derive(clap::Args)]
pub struct ConvertArgs {
    /// Mesh file (glTF, OBJ, PLY, STL), or scene file (TOML)
    #[arg(value_name = "IN")]
    pub input: PathBuf,
    /// Scene file to write: .toml, in a folder that holds IN
    #[arg(value_name = "OUT")]
    pub output: PathBuf,
    #[command(flatten)]
    pub load: LoadArgs,
    #[command(flatten)]
    pub look: LookArgs,
    /// Replace OUT if it exists
    #[arg(short, long)]
    pub force: bool,
    /// Print errors only
    #[arg(short, long)]
    pub quiet: bool,
}

#[derive(clap::Args)]
pub struct PackArgs {
    /// Scene file (TOML), or mesh file (glTF, OBJ, PLY, STL)
    pub scene: PathBuf,
    /// Pack to write, a .kdpack file [default: the scene's name with .kdpack, in the working directory]
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Path of the camera to pack with the scene: the TOML file of its keyframes
    #[arg(long, value_name = "FILE")]
    pub path: Option<PathBuf>,
    #[command(flatten)]
    pub load: LoadArgs,
    /// Print errors only
    #[arg(short, long)]
    pub quiet: bool,
}

#[derive(clap::Args)]
pub struct MergeArgs {
    /// Parts of one picture, in any order: .exr files that `kdray render` wrote
    #[arg(required = true, value_name = "PART")]
    pub parts: Vec<PathBuf>,
    /// Picture to write: .png, or .exr for linear radiance
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    #[arg(long, value_name = "KIND", help = PROGRESS, long_help = PROGRESS_LONG)]
    #[arg(default_value = "auto", hide_default_value = true)]
    pub progress: ProgressKind,
    /// Print errors only
    #[arg(short, long)]
    pub quiet: bool,
}

impl RenderArgs {
    /// Whether the command draws the frames of a film.
    pub fn is_film(&self) -> bool {
        self.path.is_some() || self.frames.is_some() || self.turntable.is_some()
    }

    /// Whether pictures show several moments.
    pub fn moves(&self) -> bool {
        self.is_film() || self.shutter.is_some()
    }

    /// Returns the arguments with the path in the scene's pack, if the user wants frames and names no path.
    pub fn with_packed_path(self, scene: &Path) -> Result<Self, CliError> {
        if self.frames.is_none() || self.path.is_some() || self.turntable.is_some() {
            return Ok(self);
        }
        Ok(Self { path: packed_path(scene)?, ..self })
    }

    /// Returns the seed of a picture. `frame`: its number in a film.
    pub fn seed_of(&self, frame: u32) -> u32 {
        self.seed.of_frame(if self.is_film() { frame } else { self.load.frame.unwrap_or(0) })
    }

    /// Refuses arguments that contradict each other.
    pub fn check(&self) -> Result<(), CliError> {
        self.picture.check(self.cpu)?;
        if self.trace.is_some() && (self.spp.is_some_and(|n| n > 1) || self.is_film()) {
            return CliError::refuse("--trace cannot be combined with --spp or with films: it shows a single sample");
        }
        let is_exr = |path: &PathBuf| path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("exr"));
        if self.samples.is_some() && !self.output.as_ref().is_some_and(is_exr) {
            return CliError::refuse("--samples needs --output FILE.exr: `kdray merge` joins .exr files");
        }
        Ok(())
    }

    /// Refuses arguments that are about a single scene or its report.
    pub fn check_of_several(&self) -> Result<(), CliError> {
        let refused = [
            (self.path.is_some(), "--path"),
            (self.frames.is_some(), "--frames"),
            (self.turntable.is_some(), "--turntable"),
            (self.samples.is_some(), "--samples"),
            (self.tile.is_some(), "--tile"),
            (self.repeat > 1, "--repeat"),
            (self.profile.is_some(), "--profile"),
            (self.trace.is_some(), "--trace"),
        ];
        match refused.iter().find(|(is_given, _)| *is_given) {
            Some((_, name)) => CliError::refuse(format!("{name} is for a single scene, without --list")),
            None => Ok(()),
        }
    }

    /// Whether pictures can end with fewer samples than they should have. Frames of a film cannot, and neither can
    /// pictures that `--skip-existing` would leave out later, measurements, or parts that are to be joined.
    pub fn may_end_early(&self) -> bool {
        !self.is_film() && !self.skip_existing && self.samples.is_none() && self.repeat == 1
    }

    /// Refuses devices that are not of the kind that the user requires.
    pub fn check_kind_of_devices(&self) -> Result<(), CliError> {
        self.require.map_or(Ok(()), |requirement| requirement.check(self.device.as_ref()))
    }

    /// Refuses arguments that several devices cannot serve.
    pub fn check_devices(&self, n_devices: usize) -> Result<(), CliError> {
        let refused = [(self.time.is_some(), "--time"), (self.trace.is_some(), "--trace")];
        match refused.iter().find(|(is_given, _)| *is_given && n_devices > 1) {
            Some((_, name)) => CliError::refuse(format!("{name} needs a single device, and there are {n_devices}")),
            None => Ok(()),
        }
    }

    /// Returns the number of samples per pixel of the whole picture: the user's, else the scene's.
    pub fn samples(&self, scene: &Scene) -> u32 {
        let defaults = scene.defaults.for_integrator(self.picture.integrator);
        self.spp.unwrap_or(match (&self.trace, self.noise) {
            (Some(_), _) => 1,
            (None, Some(_)) => NoiseGoal::MOST,
            (None, None) => defaults.samples,
        })
    }

    /// Returns the goal of `--noise`. Refuses it for pictures whose noise is not known, and a number of samples at
    /// which nothing is decided.
    pub fn noise_goal(&self, scene: &Scene, options: &RenderOptions) -> Result<Option<NoiseGoal>, CliError> {
        let Some(noise) = self.noise else { return Ok(None) };
        if options.integrator != Integrator::Path {
            return CliError::refuse("--noise needs --integrator path: other pictures have no noise");
        }
        if options.denoise != Denoise::Off {
            return CliError::refuse("--noise needs --denoise off: tiles that are drawn apart cannot be filtered");
        }
        let most_samples = self.samples(scene);
        if !most_samples.is_power_of_two() || most_samples < NoiseGoal::FEWEST {
            let fewest = NoiseGoal::FEWEST;
            return CliError::refuse(format!(
                "--noise decides at powers of two from {fewest} on, and --spp {most_samples} is none of them"
            ));
        }
        Ok(Some(NoiseGoal { noise, most_samples }))
    }

    /// Returns the samples to render if they are not all samples of the picture. Refuses samples that the picture does
    /// not have, and pictures whose samples cannot be joined.
    pub fn some_samples(&self, scene: &Scene, options: &RenderOptions) -> Result<Option<SampleRange>, CliError> {
        let Some(range) = self.samples else { return Ok(None) };
        if options.integrator != Integrator::Path {
            return CliError::refuse("--samples needs --integrator path: only the path tracer's samples can be joined");
        }
        if options.denoise != Denoise::Off {
            return CliError::refuse(
                "--samples needs --denoise off: the noise filter would mix pixels before all samples are joined",
            );
        }
        let n_samples = self.samples(scene);
        if range.end > n_samples {
            return CliError::refuse(format!(
                "--samples {range} reaches beyond the picture's {n_samples} samples, whose number --spp sets"
            ));
        }
        if !range.is_part_of(n_samples) {
            return CliError::refuse(format!(
                "--samples {range}: both numbers must be multiples of 16, or the second one the picture's {n_samples}"
            ));
        }
        Ok((range != SampleRange::whole(n_samples)).then_some(range))
    }

    /// Refuses a film, or a shutter, of a scene in which nothing moves.
    pub fn refuse_to_move(&self, scene: &Path) -> Result<(), CliError> {
        let (scene, needed) = (scene.display(), "--path FILE or --turntable N");
        match (self.is_film(), self.shutter) {
            (true, _) => CliError::refuse(format!("{scene}: nothing moves, so --frames needs {needed}")),
            (false, Some(_)) => CliError::refuse(format!(
                "{scene}: nothing moves, so --shutter needs animations, or --frames with {needed}"
            )),
            (false, None) => Ok(()),
        }
    }

    /// Refuses a shutter for pictures whose samples cannot have moments of their own.
    pub fn check_shutter(&self, options: &RenderOptions) -> Result<(), CliError> {
        let what = match self.shutter {
            Some(_) if options.integrator != Integrator::Path => "--integrator path: only its samples can be joined",
            Some(_) if options.noise_filter() != Denoise::Off => "--denoise off: the noise filter would blur edges",
            _ => return Ok(()),
        };
        CliError::refuse(format!("--shutter needs {what}"))
    }

    /// Sets the options of the command that are not those of every picture. Refuses a crop beyond the picture.
    pub fn set_options(&self, options: &mut RenderOptions) -> Result<(), CliError> {
        let &mut RenderOptions { width, height, .. } = options;
        let crop = match self.tile {
            Some(tile) => Some(tile.crop(width, height)?),
            None => self.crop,
        };
        if let Some(crop) = crop.filter(|crop| crop.x1 > width || crop.y1 > height) {
            return CliError::refuse(format!("--crop {crop} reaches beyond the picture of {width}x{height} pixels"));
        }
        if options.denoise == Denoise::Edge && options.integrator != Integrator::Path {
            return CliError::refuse("--denoise edge needs --integrator path: it removes the noise of random samples");
        }
        if let Some(aov) = self.aov.iter().find(|aov| aov.is_of_paths() && options.integrator != Integrator::Path) {
            let reason =
                if aov.is_of_light() { "it is a layer of the light of paths" } else { "it is about random samples" };
            return CliError::refuse(format!("--aov {aov} needs --integrator path: {reason}"));
        }
        // Passes are timed only if some output shows the times.
        let profile = !self.quiet || self.profile.is_some() || self.trace.is_some();
        let pixel_aovs = self.aov.iter().any(|aov| !aov.is_of_means());
        let light_layers = self.aov.iter().any(|aov| aov.is_of_light());
        let surface_layers = self.aov.iter().any(|aov| Aov::OF_SURFACES.contains(aov));
        *options = RenderOptions { crop, pixel_aovs, light_layers, surface_layers, profile, ..options.clone() };
        Ok(())
    }
}

impl CastArgs {
    /// Refuses arguments that contradict each other.
    pub fn check(&self) -> Result<(), CliError> {
        self.structure.check(self.cpu)?;
        if self.closest && self.structure.accel.pinned().unwrap_or_default() != AccelKind::KdTree {
            return CliError::refuse("--closest searches kd-trees: use --accel kdtree");
        }
        require_ending(&self.output, "npz", "a file of hits")
    }

    /// Returns the user's choice of structure, build and traversal. The search for closest points keeps what is pending
    /// as the traversal `stack` does.
    pub fn request(&self) -> Request {
        let asked = self.structure.request();
        if self.closest { Request { traversal: Some(Traversal::Stack), ..asked } } else { asked }
    }

    /// Returns what is cast, in the plural.
    pub fn noun(&self) -> &'static str {
        if self.closest { "points" } else { "rays" }
    }

    /// Refuses a device that is not of the kind that the user requires.
    pub fn check_device(&self) -> Result<(), CliError> {
        let list = self.device.clone().map(|device| DeviceList::Named(vec![device]));
        self.require.map_or(Ok(()), |requirement| requirement.check(list.as_ref()))
    }

    /// Returns the query: any hit or the closest hit.
    pub fn query(&self) -> Query {
        if self.any { Query::Any } else { Query::Closest }
    }

    /// Returns what to do with all hits of a ray; none if only one is to be found.
    pub fn list(&self) -> Option<ListArgs> {
        if self.count { Some(ListArgs::Count) } else { self.all.map(ListArgs::All) }
    }

    /// Returns the query as a word of reports.
    pub fn query_word(&self) -> &'static str {
        match (self.list(), self.query()) {
            (Some(ListArgs::Count), _) => "count",
            (Some(ListArgs::All(_)), _) => "all",
            (None, _) if self.closest => "closest_point",
            (None, Query::Any) => "any",
            (None, Query::Closest) => "closest",
        }
    }
}

/// What is done with all hits of a ray.
#[derive(Clone, Copy)]
pub enum ListArgs {
    Count,
    /// List them, or as many of the nearest ones.
    All(Option<u32>),
}

/// Size of a picture in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    pub width: u32,
    pub height: u32,
}

impl FromStr for Size {
    type Err = String;

    fn from_str(word: &str) -> Result<Self, String> {
        let side = |digits: &str| digits.parse().ok().filter(|side| (1..=RenderOptions::MOST_SIDE).contains(side));
        word.split_once('x')
            .and_then(|(width, height)| Some(Self { width: side(width)?, height: side(height)? }))
            .ok_or_else(|| format!("expected WIDTHxHEIGHT, each 1 to {}", RenderOptions::MOST_SIDE))
    }
}

/// Value of `--frames`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameChoice {
    /// All whole frames of the path.
    All,
    Some(Frames),
}

impl FromStr for FrameChoice {
    type Err = &'static str;

    fn from_str(word: &str) -> Result<Self, Self::Err> {
        if word == "all" { Ok(Self::All) } else { word.parse().map(Self::Some) }
    }
}

/// Range of frame numbers; both ends are included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frames {
    pub first: u32,
    pub last: u32,
    /// Distance between the frames that are rendered, at least 1.
    pub step: u32,
}

impl FromStr for Frames {
    type Err = &'static str;

    fn from_str(word: &str) -> Result<Self, Self::Err> {
        let number = |digits: &str| digits.parse().ok().filter(|frame| *frame <= 1_000_000);
        let (ends, step) = word.split_once('x').unwrap_or((word, "1"));
        let (first, last) = ends.split_once('-').unwrap_or((ends, ends));
        match (number(first), number(last), number(step)) {
            (Some(first), Some(last), Some(step)) if first <= last && step > 0 => Ok(Self { first, last, step }),
            (Some(first), Some(last), Some(_)) if first > last => Err("the first frame comes after the last"),
            _ => Err("expected all, A, A-B or A-BxS, whole numbers up to 1000000, S above 0"),
        }
    }
}

/// A tile of a picture: the rows of one of `n` parts of about the same height.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tile {
    /// Index of the tile from 0 on.
    pub ix: u32,
    /// Number of tiles.
    pub n: u32,
}

impl Tile {
    /// Returns the tile's pixels in a picture of this size. Refuses more tiles than the picture has rows.
    fn crop(self, width: u32, height: u32) -> Result<Crop, CliError> {
        let Self { ix, n } = self;
        if n > height {
            return CliError::refuse(format!("--tile {}/{n}: the picture has {height} rows, fewer than tiles", ix + 1));
        }
        let row = |ix: u32| (u64::from(ix) * u64::from(height) / u64::from(n)) as u32;
        Ok(Crop { x0: 0, y0: row(ix), x1: width, y1: row(ix + 1) })
    }
}

impl FromStr for Tile {
    type Err = &'static str;

    fn from_str(word: &str) -> Result<Self, Self::Err> {
        let numbers = word.split_once('/').and_then(|(ix, n)| Some((ix.parse().ok()?, n.parse().ok()?)));
        match numbers {
            Some((ix, n)) if (1..=n).contains(&ix) => Ok(Self { ix: ix - 1, n }),
            _ => Err("expected I/N, where I is 1 to N"),
        }
    }
}

/// Parses `--noise`.
fn noise(word: &str) -> Result<f32, String> {
    match word.parse() {
        Ok(noise) if (0.0001..=1.0).contains(&noise) => Ok(noise),
        _ => Err("expected a number from 0.0001 to 1".to_owned()),
    }
}

/// Parses a time above 0, such as `30s` or `1m 30s`.
fn time(word: &str) -> Result<Duration, String> {
    match humantime::parse_duration(word) {
        Ok(Duration::ZERO) => Err("expected a time above 0".to_owned()),
        Ok(time) if time > Duration::from_secs(30 * 24 * 3600) => Err("expected at most 30 days".to_owned()),
        Ok(time) => Ok(time),
        Err(_) => Err("expected a number with a unit, such as 30s, 5m or 1h".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_command_is_consistent() {
        Args::command().debug_assert();
    }

    #[test]
    fn sizes() {
        assert_eq!("1x16384".parse(), Ok(Size { width: 1, height: 16384 }));
        for word in ["", "x", "0x1", "1x0", "16385x1", "-1x1", "1x1x1", "1", "1 x 1", "4294967297x1", "1X1"] {
            assert!(word.parse::<Size>().is_err(), "{word}");
        }
    }

    #[test]
    fn frames() {
        assert_eq!("all".parse(), Ok(FrameChoice::All));
        assert_eq!("3-17".parse(), Ok(FrameChoice::Some(Frames { first: 3, last: 17, step: 1 })));
        assert_eq!("3-17".parse(), Ok(Frames { first: 3, last: 17, step: 1 }));
        assert_eq!("0".parse(), Ok(Frames { first: 0, last: 0, step: 1 }));
        assert_eq!("0-9x4".parse(), Ok(Frames { first: 0, last: 9, step: 4 }));
        for word in ["", "0-9x0", "0-9x", "x2", "0-9x1x1", "-", "3-", "-3", "4-3", "1-2-3", "1.5-2", "0-1000001", "a-b"]
        {
            assert!(word.parse::<FrameChoice>().is_err(), "{word}");
        }
    }
}
