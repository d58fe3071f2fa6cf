//! The words of `kdray bench`.

use std::path::{Path, PathBuf};

use clap::{Subcommand, value_parser};
use kdray::{
    accel::{AccelKind, kdtree::Traversal},
    bench::{
        size::{MIN_TRIANGLES, MOST_TRIANGLES, SIZES},
        variant::Variant,
    },
    gpu::DeviceSelector,
    output,
};

use crate::cli::{
    args::{Size, device},
    error::CliError,
    file_roles::FileRoles,
    picture_args::{accel_help, traversal_help, traversals_of_devices},
};

/// What is measured.
#[derive(Subcommand)]
pub enum Suite {
    /// The paper's table: its four scenes, whole frames on the GPU and on one CPU thread, beside its own times
    Paper(PaperArgs),
    /// All traversals of the kd-tree, and grids, on primary, shadow, mirror and diffuse rays of a mesh
    Traversal(TraversalArgs),
    /// The traversal against the driver's own ray tracing, on the same rays; exits with 4 where the device lacks it
    Driver(DriverArgs),
    /// Cost of building and of a ray against the number of triangles, on a generated mesh
    Size(SizeArgs),
}

#[derive(clap::Args)]
pub struct PaperArgs {
    /// Folder of cornell.toml, paper2.toml, paper3.toml and paper4.toml
    #[arg(long, value_name = "DIR", default_value = "scenes")]
    pub scenes: PathBuf,
    /// Pixels, as 640x480,1024x768 [default: the paper's three sizes]
    #[arg(long, value_name = "WxH", value_delimiter = ',')]
    pub size: Vec<Size>,
    #[arg(long, value_name = "ALGORITHM")]
    #[arg(help = format!("Algorithm by which rays go through the kd-tree on the GPU: {} [default: {}]", Traversal::words(), traversals_of_devices()))]
    pub traversal: Option<Traversal>,
    /// Frames on the GPU
    #[arg(long, value_name = "N", default_value_t = 25, value_parser = value_parser!(u16).range(1..=10_000))]
    pub repeat: u16,
    /// Frames on the CPU
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = value_parser!(u16).range(1..=10_000))]
    pub cpu_repeat: u16,
    /// Leave the CPU out
    #[arg(long, conflicts_with = "cpu_repeat")]
    pub no_cpu: bool,
    /// Device by its index in `kdray devices` or a part of its name [default: the best one]
    #[arg(long, value_name = "INDEX|NAME", value_parser = device)]
    pub device: Option<DeviceSelector>,
    #[command(flatten)]
    pub files: FileArgs,
}

#[derive(clap::Args)]
pub struct TraversalArgs {
    /// OBJ or scene file
    pub mesh: PathBuf,
    /// Pixels, one primary ray each
    #[arg(long, value_name = "WxH", default_value = "1920x1080")]
    pub size: Size,
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    #[arg(help = format!("Traversals of the kd-tree and grids, as mask,stack,grid: {} [default: all but brute]", Variant::words()))]
    pub variants: Vec<Variant>,
    /// Timed casts of each set of rays
    #[arg(long, value_name = "N", default_value_t = 25, value_parser = value_parser!(u16).range(1..=10_000))]
    pub repeat: u16,
    /// Leave the scene as it is: its own camera and first light, and no closed room around it
    #[arg(long)]
    pub no_room: bool,
    /// Cast on all threads of the CPU, without Vulkan
    #[arg(long, conflicts_with = "device")]
    pub cpu: bool,
    /// Device by its index in `kdray devices` or a part of its name [default: the best one]
    #[arg(long, value_name = "INDEX|NAME", value_parser = device)]
    pub device: Option<DeviceSelector>,
    #[command(flatten)]
    pub files: FileArgs,
}

#[derive(clap::Args)]
pub struct DriverArgs {
    /// OBJ or scene file
    pub mesh: PathBuf,
    /// Pixels, one primary ray each
    #[arg(long, value_name = "WxH", default_value = "1920x1080")]
    pub size: Size,
    /// Timed casts of each set of rays
    #[arg(long, value_name = "N", default_value_t = 25, value_parser = value_parser!(u16).range(1..=10_000))]
    pub repeat: u16,
    /// Leave the scene as it is: its own camera and first light, and no closed room around it
    #[arg(long)]
    pub no_room: bool,
    /// Device by its index in `kdray devices` or a part of its name [default: the best one]
    #[arg(long, value_name = "INDEX|NAME", value_parser = device)]
    pub device: Option<DeviceSelector>,
    #[command(flatten)]
    pub files: FileArgs,
}

#[derive(clap::Args)]
pub struct SizeArgs {
    /// Numbers of triangles, as 10000,10000000
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_values_t = SIZES)]
    #[arg(value_parser = value_parser!(u32).range(i64::from(MIN_TRIANGLES)..=i64::from(MOST_TRIANGLES)))]
    pub triangles: Vec<u32>,
    /// Pixels, one primary ray each
    #[arg(long, value_name = "WxH", default_value = "1920x1080")]
    pub size: Size,
    #[arg(long, value_name = "KIND", help = accel_help(), default_value_t)]
    pub accel: AccelKind,
    #[arg(long, value_name = "ALGORITHM")]
    #[arg(help = traversal_help())]
    pub traversal: Option<Traversal>,
    /// Timed casts of each set of rays
    #[arg(long, value_name = "N", default_value_t = 25, value_parser = value_parser!(u16).range(1..=10_000))]
    pub repeat: u16,
    /// Cast on all threads of the CPU, without Vulkan
    #[arg(long, conflicts_with = "device")]
    pub cpu: bool,
    /// Device by its index in `kdray devices` or a part of its name [default: the best one]
    #[arg(long, value_name = "INDEX|NAME", value_parser = device)]
    pub device: Option<DeviceSelector>,
    #[command(flatten)]
    pub files: FileArgs,
}

/// Where results go besides standard output.
#[derive(clap::Args)]
pub struct FileArgs {
    /// Write all that was measured as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write a chart
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
}

impl FileArgs {
    /// Refuses files that cannot be written, or that are a part of the `scenes` that are read, before anything is
    /// measured.
    pub fn check(&self, scenes: &[&Path]) -> Result<(), CliError> {
        let mut roles = FileRoles::default();
        scenes.iter().for_each(|scene| roles.read_scene("a scene", scene));
        self.json.iter().try_for_each(|path| roles.write("--json", path))?;
        self.svg.iter().try_for_each(|path| roles.write("--svg", path))?;
        Ok([&self.json, &self.svg].into_iter().flatten().try_for_each(|path| output::check(path))?)
    }

    /// Writes those files that were asked for.
    pub fn write(&self, report: &impl serde::Serialize, svg: impl FnOnce() -> String) -> Result<(), CliError> {
        if let Some(path) = &self.json {
            let mut json = serde_json::to_vec_pretty(report).expect("plain structs of numbers and words");
            json.push(b'\n');
            output::write(path, &json)?;
        }
        if let Some(path) = &self.svg {
            output::write(path, svg().as_bytes())?;
        }
        Ok(())
    }
}
