//! The words of `kdray view`.

use std::path::PathBuf;

use clap::{ValueEnum, value_parser};
use kdray::gpu::DeviceSelector;

use super::{
    args::device,
    picture_args::{PictureArgs, positive},
};

#[derive(clap::Args)]
#[group(skip)]
#[command(group = clap::ArgGroup::new("tour").args(["frames", "path"]).multiple(true))]
pub struct ViewArgs {
    /// Scene file; it is read again whenever it changes
    pub scene: PathBuf,
    #[command(flatten)]
    pub picture: PictureArgs,
    /// Samples a pixel that a picture at rest gets, 1 to 65536 [default: 256, with --frames 1]
    #[arg(long, value_name = "N", value_parser = value_parser!(u32).range(1..=65_536))]
    pub spp: Option<u32>,
    /// Milliseconds a frame while the camera moves: the picture is drawn smaller to keep within them
    #[arg(long, value_name = "MS", default_value_t = 16.0, value_parser = milliseconds)]
    pub budget_ms: f64,
    /// Whether frames wait for the screen's refresh
    #[arg(long, value_name = "on|off", default_value = "on")]
    pub vsync: Switch,
    /// Nothing over the picture at first; Tab shows it
    #[arg(long)]
    pub no_overlay: bool,
    /// Move the camera as keyframes in this TOML file say, and end
    #[arg(long, value_name = "FILE")]
    pub path: Option<PathBuf>,
    /// Go once around the scene, or along --path, in so many frames, and end
    #[arg(long, value_name = "N", value_parser = value_parser!(u32).range(1..=1_000_000))]
    pub frames: Option<u32>,
    /// Picture to write of the last frame, .png or .exr
    #[arg(long, value_name = "FILE", requires = "tour")]
    pub screenshot: Option<PathBuf>,
    /// Directory to write every frame to, as frame.0000.png
    #[arg(long, value_name = "DIR", requires = "tour")]
    pub record: Option<PathBuf>,
    /// Write frame times and latency as JSON
    #[arg(long, value_name = "FILE")]
    pub profile: Option<PathBuf>,
    /// Threads for loading and building [default: all processors]
    #[arg(long, value_name = "N", value_parser = value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Device by its index in `kdray devices` or a part of its name [default: the best one]
    #[arg(long, value_name = "INDEX|NAME", value_parser = device)]
    pub device: Option<DeviceSelector>,
    /// Run under the Khronos validation layer and fail on any message
    #[arg(long)]
    pub validate: bool,
    /// Say nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Switch {
    On,
    Off,
}

fn milliseconds(word: &str) -> Result<f64, String> {
    positive(word).map(f64::from)
}
