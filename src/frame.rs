//! What a frame is asked for, and what comes of it: the options, the picture and the profile, alike on GPU and CPU.

mod aov;
mod crop;
mod pass;
mod profile;
mod view;

pub use self::{
    aov::{Aov, Channel, Samples},
    crop::Crop,
    pass::{Pass, Role, Scope},
    profile::{BounceStats, PassTime, Profile},
    view::View,
};
use crate::layout;
pub use crate::words::UnknownWord;

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
    pub tonemap: Tonemap,
    pub denoise: Denoise,
    pub traversal: Traversal,
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

/// How a ray finds its way through the kd-tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Traversal {
    /// A bit a level says which siblings are still to be visited, and what waits there has its place in local memory.
    Mask,
    /// The paper's own: a bit a level says which siblings are done; their boxes tell whether to visit them.
    MaskBoxes,
    /// Every subtree that was left is found again from the root.
    Restart,
    /// Back to the deepest ancestor that the ray has not left, by its box.
    Backtrack,
    /// The eight newest far children; older ones by a restart.
    ShortStack,
    /// From leaf to leaf, by links to its neighbours.
    Ropes,
    /// An array of far children. On the CPU, sixteen rays go together.
    Stack,
    /// No tree: every triangle. For small meshes.
    Brute,
}

impl Traversal {
    /// The paper's idea; a stack and ropes are up to a tenth faster on some scenes (README.md's figures).
    pub const OF_GPUS: Self = Self::Mask;
    /// What is fastest where drivers run kernels on the CPU.
    pub const OF_SOFTWARE_DRIVERS: Self = Self::Ropes;
    /// What is fastest on the CPU itself.
    pub const OF_CPU: Self = Self::Stack;

    /// The kernels' specialization constant.
    pub(crate) fn constant(self) -> u32 {
        match self {
            Self::Mask => layout::TRAVERSAL_MASK,
            Self::MaskBoxes => layout::TRAVERSAL_MASK_BOXES,
            Self::Restart => layout::TRAVERSAL_RESTART,
            Self::Backtrack => layout::TRAVERSAL_BACKTRACK,
            Self::ShortStack => layout::TRAVERSAL_SHORT_STACK,
            Self::Ropes => layout::TRAVERSAL_ROPES,
            Self::Stack => layout::TRAVERSAL_STACK,
            Self::Brute => layout::TRAVERSAL_BRUTE,
        }
    }

    /// Whether it reads the nodes' boxes.
    pub(crate) fn needs_boxes(self) -> bool {
        matches!(self, Self::MaskBoxes | Self::Backtrack)
    }

    /// Whether it reads the nodes' ropes.
    pub(crate) fn needs_ropes(self) -> bool {
        self == Self::Ropes
    }
}

/// How primary rays find their triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Primary {
    /// By rasterized triangle IDs and a ray-plane test.
    Raster,
    /// By triangles that kernels rasterize with the test of rays, so that hits are those of `Trace`, bit for bit, unless the camera lies
    /// beyond `KD_ORIGIN_REACH`. Needs atomics of 64 bits. The CPU has no such kernels: there it is `Raster`.
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
    pub width: u32,
    pub height: u32,
    /// `width * height` linear RGB radiances before exposure (fourth: 1).
    pub radiance: Vec<[f32; 4]>,
    /// `width * height` sRGB-encoded RGBA pixels.
    pub display: Vec<[u8; 4]>,
}

words!(Traversal {
    Mask = "mask",
    MaskBoxes = "mask-boxes",
    Restart = "restart",
    Backtrack = "backtrack",
    ShortStack = "short-stack",
    Ropes = "ropes",
    Stack = "stack",
    Brute = "brute"
});
words!(Tonemap { Linear = "linear", Agx = "agx", Aces = "aces" });
words!(Primary { Raster = "raster", Compute = "compute", Trace = "trace" });
