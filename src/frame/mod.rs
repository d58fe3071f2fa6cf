//! What a frame is asked for, and what comes of it: the options, the picture and the profile, alike on GPU and CPU.

mod aov;
pub(crate) mod bounce;
mod constants;
pub(crate) mod counts;
mod crop;
mod drawn;
mod pass;
pub mod plan;
mod profile;
mod resource;
pub mod sampling;
mod view;

pub use self::{
    aov::{Aov, Channel, Samples},
    crop::Crop,
    drawn::{Drawn, Watcher},
    pass::{Pass, Role, Scope},
    plan::{FrameKind, Plan, Section, Step, Touch},
    profile::{BounceStats, PassTime, Profile},
    resource::Resource,
    view::View,
};
use crate::{accel::kdtree::Traversal, layout};

/// How a frame is rendered. The scene's own defaults fill what the user leaves open.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderOptions {
    /// Of the whole picture, pixels.
    pub width: u32,
    /// As `width`.
    pub height: u32,
    /// The part of the picture to render, within it; none for all.
    pub crop: Option<Crop>,
    /// Levels of rays, the primary one counted: 1 is ray casting with shadows (Algorithm 1's `maximumDepth`).
    pub max_depth: u32,
    /// Factor on radiance before it is encoded for display.
    pub exposure: f32,
    /// The curve from radiance to display.
    pub tonemap: Tonemap,
    /// The noise filter.
    pub denoise: Denoise,
    /// The algorithm by which rays go through the kd-tree.
    pub traversal: Traversal,
    /// How primary rays find their triangles.
    pub primary: Primary,
    /// Whether the device takes times and counts; without them its frames have empty profiles.
    pub profile: bool,
    /// Note what the rays of each pixel meet and cost, too.
    pub features: bool,
}

impl Default for RenderOptions {
    fn default() -> Self {
        Self {
            width: 1024,
            height: 768,
            crop: None,
            max_depth: 5,
            exposure: 1.0,
            tonemap: Tonemap::Linear,
            denoise: Denoise::Paper { threshold: Denoise::DEFAULT_THRESHOLD },
            traversal: Traversal::OF_GPUS,
            primary: Primary::Raster,
            profile: true,
            features: false,
        }
    }
}

/// The post process of the paper's section 2.4.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Denoise {
    /// No filter.
    Off,
    /// Smooths a pixel whose luminance differences to its four neighbours add up to more than the threshold.
    Paper {
        /// In units of display white, 0 to 4.
        threshold: f32,
    },
}

impl Denoise {
    /// A straight edge between black and white adds up to 1, a corner or a thin line to 2, a lone pixel to 4.
    pub const DEFAULT_THRESHOLD: f32 = 2.5;
}

/// How radiance, which knows no bounds, becomes what a display shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tonemap {
    /// As it is, cut off at white.
    Linear,
    /// AgX: bright colours fade to white, dark ones keep their hue.
    Agx,
    /// The film-like curve of the Academy Color Encoding System.
    Aces,
}

impl Tonemap {
    /// The kernel's specialization constant.
    pub(crate) fn constant(self) -> u32 {
        match self {
            Self::Linear => layout::TONEMAP_LINEAR,
            Self::Agx => layout::TONEMAP_AGX,
            Self::Aces => layout::TONEMAP_ACES,
        }
    }
}

/// How primary rays find their triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Primary {
    /// By rasterized triangle IDs and a ray-plane test.
    Raster,
    /// By triangles that kernels rasterize with the test of rays, so that hits are those of `Trace`, bit for bit, unless the camera lies
    /// beyond `KD_MAX_ORIGIN_DISTANCE`. Needs atomics of 64 bits. The CPU has no such kernels: there it is `Raster`.
    Compute,
    /// Through the kd-tree.
    Trace,
}

impl Primary {
    /// What takes less work: the rasterizer goes over all triangles, tracing over all pixels of the whole picture.
    /// `triangles_a_ray`: how many triangles are rasterized while one ray is traced.
    pub fn suited_to(n_triangles: usize, (width, height): (u32, u32), triangles_a_ray: u64) -> Self {
        let n_rays = u64::from(width) * u64::from(height);
        if n_triangles as u64 <= triangles_a_ray * n_rays { Self::Raster } else { Self::Trace }
    }
}

/// A rendered frame, or the part of it that was asked for. Rows from the top, left to right.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// `width * height` linear RGB radiances before exposure (fourth: 1).
    pub radiance: Vec<[f32; 4]>,
    /// `width * height` sRGB-encoded RGBA pixels.
    pub display: Vec<[u8; 4]>,
}

named_enum!(Tonemap { Linear = "linear", Agx = "agx", Aces = "aces" });
named_enum!(Primary { Raster = "raster", Compute = "compute", Trace = "trace" });
