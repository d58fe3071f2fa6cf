//! The arguments of `kdray view`.

use std::path::PathBuf;

use clap::{ValueEnum, value_parser};
use kdray::{frame::SampleRange, gpu::DeviceSelector, view::InMotion};

use super::{
    device_args::device,
    load_args::LoadArgs,
    look_args::LookArgs,
    picture_args::{PictureArgs, listed, positive, with_words},
};

const IN_MOTION: &str = "Picture while the camera moves, for --integrator path";

#[derive(clap::Args)]
#[group(skip)]
#[command(group = clap::ArgGroup::new("tour").args(["frames", "path"]).multiple(true))]
pub struct ViewArgs {
    /// Scene file (TOML), or mesh file (glTF, OBJ, PLY, STL); the window follows changes of the file. Without it, the
    /// window waits for a file to be dropped on it
    pub scene: Option<PathBuf>,
    #[command(flatten)]
    pub load: LoadArgs,
    #[command(flatten)]
    pub look: LookArgs,
    #[command(flatten)]
    pub picture: PictureArgs,
    /// Samples per pixel while the camera rests, 1 to 65536 [default: 256; 1 with --frames or --path]
    #[arg(long, value_name = "N", value_parser = value_parser!(u32).range(1..=i64::from(SampleRange::MOST)))]
    pub spp: Option<u32>,
    #[arg(long, value_name = "PICTURE", default_value = "whitted", hide_default_value = true)]
    #[arg(help = with_words(IN_MOTION, Some("whitted"), &InMotion::words()))]
    #[arg(long_help = listed(IN_MOTION, "whitted", &InMotion::descriptions()))]
    pub in_motion: InMotion,
    /// Time budget per frame while the camera moves, in milliseconds; the picture is drawn at a lower resolution to
    /// keep within it
    #[arg(long, value_name = "MS", default_value_t = 16.0, value_parser = milliseconds)]
    pub budget_ms: f64,
    /// Vertical synchronization
    #[arg(long, value_name = "on|off", default_value = "on")]
    pub vsync: Switch,
    /// Start without the panel over the picture; Tab shows it
    #[arg(long)]
    pub no_overlay: bool,
    /// Follow changes of the kernels in this checkout of kdray: compile them again and go on with them
    #[arg(long, value_name = "CHECKOUT")]
    pub shaders: Option<PathBuf>,
    /// Move the camera along the keyframes of this TOML file, then exit
    #[arg(long, value_name = "FILE", requires = "scene")]
    pub path: Option<PathBuf>,
    /// Move the camera once around its target, or along --path, in this number of frames, 1 to 1000000, then exit
    #[arg(long, value_name = "N", requires = "scene", value_parser = value_parser!(u32).range(1..=1_000_000))]
    pub frames: Option<u32>,
    /// Write the last frame of --frames or --path to this .png or .exr file
    #[arg(long, value_name = "FILE", requires = "tour")]
    pub screenshot: Option<PathBuf>,
    /// Write each frame of --frames or --path to this existing directory, as frame.0000.png and so on
    #[arg(long, value_name = "DIR", requires = "tour")]
    pub record: Option<PathBuf>,
    /// Write frame times and input latency to this JSON file
    #[arg(long, value_name = "FILE")]
    pub profile: Option<PathBuf>,
    /// Number of CPU threads for loading, building and --cpu, 1 to 1024 [default: one per processor]
    #[arg(long, value_name = "N", value_parser = value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Draw on the CPU; Vulkan only shows the pictures
    #[arg(long, conflicts_with = "shaders")]
    pub cpu: bool,
    /// Vulkan device to use: its index in `kdray devices`, or a part of its name [default: a
    /// discrete GPU, else an integrated one, else a software driver]
    #[arg(long, value_name = "INDEX|NAME", value_parser = device)]
    pub device: Option<DeviceSelector>,
    /// Run under the Khronos validation layer, and fail if it reports anything
    #[arg(long)]
    pub validate: bool,
    /// Print errors only
    #[arg(short, long)]
    pub quiet: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Switch {
    /// Frames wait for the screen's refresh
    On,
    /// Frames are shown at once and may tear
    Off,
}

fn milliseconds(word: &str) -> Result<f64, String> {
    positive(word).map(f64::from)
}
