//! The arguments of `kdray bench`.

use std::path::{Path, PathBuf};

use clap::{Subcommand, value_parser};
use kdray::{
    accel::{AccelKind, Search, kdtree::Traversal},
    bench::size::{MIN_TRIANGLES, MOST_TRIANGLES, SIZES},
    gpu::DeviceSelector,
    output,
    scene::LoadOptions,
};

use crate::cli::{
    args::Size,
    device_args::device,
    error::CliError,
    file_roles::FileRoles,
    load_args::LoadArgs,
    look_args::LookArgs,
    picture_args::{
        PictureArgs, accel_help, accel_long_help, fixed_traversal_help, fixed_traversal_long_help, listed,
        traversals_of_devices,
    },
    report::write_json,
};

/// The benchmark suites.
#[derive(Subcommand)]
pub enum Suite {
    /// Measure the paper's table: whole frames of the paper's four scenes, on the GPU and on one CPU thread, beside
    /// the times that the paper reports
    Paper(PaperArgs),
    /// Compare all traversals of the kd-tree, and grids, on primary, shadow, mirror and diffuse rays of a mesh
    Traversal(TraversalArgs),
    /// Compare kdray with the driver's own ray tracing on the same rays; exits with 4 if the device has no
    /// ray tracing
    Driver(DriverArgs),
    /// Measure how build time and time per ray grow with the number of triangles, on a generated mesh
    Size(SizeArgs),
    /// Measure the frames of an animation: the pose, the build of what rays search, the upload and the passes
    Motion(Box<MotionArgs>),
}

#[derive(clap::Args)]
pub struct PaperArgs {
    /// Directory that holds cornell.toml, paper2.toml, paper3.toml and paper4.toml
    #[arg(long, value_name = "DIR", default_value = "scenes")]
    pub scenes: PathBuf,
    /// Sizes of the pictures in pixels, separated by commas, for example 640x480,1024x768 [default: 640x480, 800x600
    /// and 1024x768, as in the paper]
    #[arg(long, value_name = "WxH", value_delimiter = ',')]
    pub size: Vec<Size>,
    #[arg(long, value_name = "ALGORITHM")]
    #[arg(help = format!(
        "Algorithm by which rays go through the kd-tree on the GPU: {} [default: {}]",
        Traversal::words(),
        traversals_of_devices()
    ))]
    pub traversal: Option<Traversal>,
    /// Number of timed frames on the GPU, 1 to 10000
    #[arg(long, value_name = "N", default_value_t = 25, value_parser = value_parser!(u16).range(1..=10_000))]
    pub repeat: u16,
    /// Number of timed frames on the CPU, 1 to 10000
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = value_parser!(u16).range(1..=10_000))]
    pub cpu_repeat: u16,
    /// Do not measure the CPU
    #[arg(long, conflicts_with = "cpu_repeat")]
    pub no_cpu: bool,
    /// Vulkan device to use: its index in `kdray devices`, or a part of its name [default: a
    /// discrete GPU, else an integrated one, else a software driver]
    #[arg(long, value_name = "INDEX|NAME", value_parser = device)]
    pub device: Option<DeviceSelector>,
    #[command(flatten)]
    pub files: FileArgs,
}

#[derive(clap::Args)]
pub struct TraversalArgs {
    /// Mesh file (glTF, OBJ, PLY, STL) or scene file
    pub mesh: PathBuf,
    #[command(flatten)]
    pub load: LoadArgs,
    /// Size of the picture in pixels; each pixel has one primary ray
    #[arg(long, value_name = "WxH", default_value = "1920x1080")]
    pub size: Size,
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    #[arg(help = format!(
        "Traversals of the kd-tree and grids, as mask,stack,grid: {} [default: all but brute]",
        Search::words()
    ))]
    #[arg(long_help = listed(
        "Traversals of the kd-tree and kinds of grids, separated by commas, for example mask,stack,grid",
        "all but brute",
        &Search::descriptions()
    ))]
    pub variants: Vec<Search>,
    /// Number of timed casts of each set of rays, 1 to 10000
    #[arg(long, value_name = "N", default_value_t = 25, value_parser = value_parser!(u16).range(1..=10_000))]
    pub repeat: u16,
    /// Use the scene's own camera and first light, without a closed room around the scene
    #[arg(long)]
    pub no_room: bool,
    /// Cast the rays also into the scene's meshes and instances, each mesh stored once, and time moving all instances
    #[arg(long, requires = "no_room")]
    pub instances: bool,
    /// Cast on all CPU threads, without Vulkan
    #[arg(long, conflicts_with = "device")]
    pub cpu: bool,
    /// Vulkan device to use: its index in `kdray devices`, or a part of its name [default: a
    /// discrete GPU, else an integrated one, else a software driver]
    #[arg(long, value_name = "INDEX|NAME", value_parser = device)]
    pub device: Option<DeviceSelector>,
    #[command(flatten)]
    pub files: FileArgs,
}

#[derive(clap::Args)]
pub struct DriverArgs {
    /// Mesh file (glTF, OBJ, PLY, STL) or scene file
    pub mesh: PathBuf,
    #[command(flatten)]
    pub load: LoadArgs,
    /// Size of the picture in pixels; each pixel has one primary ray
    #[arg(long, value_name = "WxH", default_value = "1920x1080")]
    pub size: Size,
    /// Number of timed casts of each set of rays, 1 to 10000
    #[arg(long, value_name = "N", default_value_t = 25, value_parser = value_parser!(u16).range(1..=10_000))]
    pub repeat: u16,
    /// Use the scene's own camera and first light, without a closed room around the scene
    #[arg(long)]
    pub no_room: bool,
    /// Vulkan device to use: its index in `kdray devices`, or a part of its name [default: a
    /// discrete GPU, else an integrated one, else a software driver]
    #[arg(long, value_name = "INDEX|NAME", value_parser = device)]
    pub device: Option<DeviceSelector>,
    #[command(flatten)]
    pub files: FileArgs,
}

#[derive(clap::Args)]
pub struct SizeArgs {
    /// Numbers of triangles, separated by commas, for example 10000,10000000
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_values_t = SIZES)]
    #[arg(value_parser = value_parser!(u32).range(i64::from(MIN_TRIANGLES)..=i64::from(MOST_TRIANGLES)))]
    pub triangles: Vec<u32>,
    /// Number of primary rays, as the size of a picture in pixels
    #[arg(long, value_name = "WxH", default_value = "1920x1080")]
    pub size: Size,
    #[arg(long, value_name = "KIND", help = accel_help(), long_help = accel_long_help(), default_value_t)]
    #[arg(hide_default_value = true)]
    pub accel: AccelKind,
    #[arg(long, value_name = "ALGORITHM")]
    #[arg(help = fixed_traversal_help(), long_help = fixed_traversal_long_help())]
    pub traversal: Option<Traversal>,
    /// Number of timed casts of each set of rays, 1 to 10000
    #[arg(long, value_name = "N", default_value_t = 25, value_parser = value_parser!(u16).range(1..=10_000))]
    pub repeat: u16,
    /// Cast on all CPU threads, without Vulkan
    #[arg(long, conflicts_with = "device")]
    pub cpu: bool,
    /// Vulkan device to use: its index in `kdray devices`, or a part of its name [default: a
    /// discrete GPU, else an integrated one, else a software driver]
    #[arg(long, value_name = "INDEX|NAME", value_parser = device)]
    pub device: Option<DeviceSelector>,
    #[command(flatten)]
    pub files: FileArgs,
}

#[derive(clap::Args)]
#[group(skip)]
pub struct MotionArgs {
    /// glTF file with animations, or scene file that names one
    pub scene: PathBuf,
    #[command(flatten)]
    pub load: LoadArgs,
    #[command(flatten)]
    pub look: LookArgs,
    #[command(flatten)]
    pub picture: PictureArgs,
    /// Number of timed frames, 1 to 100000; the animation begins again after its end
    #[arg(long, value_name = "N", default_value_t = 300, value_parser = value_parser!(u32).range(1..=100_000))]
    pub frames: u32,
    /// Draw on all CPU threads, without Vulkan
    #[arg(long, conflicts_with = "device")]
    pub cpu: bool,
    /// Vulkan device to use: its index in `kdray devices`, or a part of its name [default: a
    /// discrete GPU, else an integrated one, else a software driver]
    #[arg(long, value_name = "INDEX|NAME", value_parser = device)]
    pub device: Option<DeviceSelector>,
    #[command(flatten)]
    pub files: FileArgs,
}

/// Files that the results are written to, besides standard output.
#[derive(clap::Args)]
pub struct FileArgs {
    /// Write all measurements to this JSON file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write a chart to this SVG file
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
}

impl FileArgs {
    /// Refuses files that cannot be written, or that belong to `scenes`, which the command reads. It is called before
    /// anything is measured.
    pub fn check(&self, scenes: &[&Path], options: &LoadOptions) -> Result<(), CliError> {
        let mut roles = FileRoles::default();
        scenes.iter().for_each(|scene| roles.read_scene("a scene", scene, options.clone()));
        self.json.iter().try_for_each(|path| roles.write("--json", path))?;
        self.svg.iter().try_for_each(|path| roles.write("--svg", path))?;
        Ok([&self.json, &self.svg].into_iter().flatten().try_for_each(|path| output::check(path))?)
    }

    /// Writes the files that the user has named.
    pub fn write(&self, report: &impl serde::Serialize, svg: impl FnOnce() -> String) -> Result<(), CliError> {
        write_json(self.json.as_ref(), report)?;
        if let Some(path) = &self.svg {
            output::write(path, svg().as_bytes())?;
        }
        Ok(())
    }
}
