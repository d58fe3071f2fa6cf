//! What a frame is asked for, and what comes of it: the options, the picture and the profile, alike on GPU and CPU.

use serde::Serialize;

mod aov;
mod crop;
mod view;

pub use self::{
    aov::{Aov, Channel, Samples},
    crop::Crop,
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
            traversal: Traversal::Mask,
            primary: Primary::Raster,
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
    /// A bit a level says which siblings are still to be visited; the eight newest are kept, parent links lead back to
    /// older ones.
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
    /// An array of far children.
    Stack,
    /// No tree: every triangle. For small meshes.
    Brute,
}

impl Traversal {
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
        matches!(self, Self::MaskBoxes | Self::Backtrack | Self::Ropes)
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
    /// Through the kd-tree.
    Trace,
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

/// Where a frame's time went.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Profile {
    /// The device's own name.
    pub device: String,
    /// In the order of execution.
    pub passes: Vec<PassTime>,
    /// One row a bounce, 0 = primary rays; batches added up.
    pub bounces: Vec<BounceStats>,
    /// Ray batches that the frame was split into; the most of any, where several frames are added up.
    pub n_batches: u32,
    /// From the first pass's start to the last one's end; none where the device has no timestamps.
    pub frame_ms: Option<f64>,
}

/// One pass of one bounce; its batches added up.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PassTime {
    /// Also the debug label and the kernel's file name.
    pub name: &'static str,
    /// None for passes that run once a frame.
    pub bounce: Option<u32>,
    /// None where the device has no timestamps.
    pub ms: Option<f64>,
}

/// Rays of one bounce.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct BounceStats {
    /// Rays whose closest hit was found.
    pub n_rays: u64,
    /// Those that hit something.
    pub n_hits: u64,
    /// Shadow segments that were tested.
    pub n_shadow_rays: u64,
}

impl Profile {
    /// Adds a frame's times and counts to those of others of the same options.
    pub fn add(&mut self, frame: &Profile) {
        let mut next = 0;
        for pass in &frame.passes {
            let known = self.passes.iter().position(|sum| sum.name == pass.name && sum.bounce == pass.bounce);
            match known.map(|i| (i, &mut self.passes[i])) {
                Some((i, sum)) => {
                    sum.ms = sum.ms.zip(pass.ms).map(|(a, b)| a + b);
                    next = i + 1;
                }
                None => {
                    self.passes.insert(next, pass.clone());
                    next += 1;
                }
            }
        }
        self.bounces.resize(self.bounces.len().max(frame.bounces.len()), BounceStats::default());
        for (sum, bounce) in self.bounces.iter_mut().zip(&frame.bounces) {
            sum.n_rays += bounce.n_rays;
            sum.n_hits += bounce.n_hits;
            sum.n_shadow_rays += bounce.n_shadow_rays;
        }
        self.frame_ms = self.frame_ms.zip(frame.frame_ms).map(|(a, b)| a + b);
        self.n_batches = self.n_batches.max(frame.n_batches);
    }

    /// Milliseconds of all passes of one name, or none where any lacks a timestamp.
    pub fn pass_ms(&self, name: &str) -> Option<f64> {
        self.passes.iter().filter(|pass| pass.name == name).map(|pass| pass.ms).sum()
    }
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
words!(Primary { Raster = "raster", Trace = "trace" });

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn profiles_add_up() {
        let pass = |name, bounce, ms| PassTime { name, bounce, ms: Some(ms) };
        let stats = |n_rays| BounceStats { n_rays, n_hits: 1, n_shadow_rays: 2 };
        let frame = |passes, n_batches| Profile {
            device: "d".to_owned(),
            passes,
            bounces: vec![stats(10), stats(5)],
            n_batches,
            frame_ms: Some(4.0),
        };
        let mut sum = frame(vec![pass("trace", Some(0), 1.0), pass("tonemap", None, 2.0)], 3);
        let later =
            frame(vec![pass("trace", Some(0), 1.5), pass("accumulate", None, 0.5), pass("tonemap", None, 2.0)], 2);
        sum.add(&later);
        let expected = [pass("trace", Some(0), 2.5), pass("accumulate", None, 0.5), pass("tonemap", None, 4.0)];
        assert_eq!((&sum.passes[..], sum.n_batches, sum.frame_ms), (&expected[..], 3, Some(8.0)));
        assert_eq!(sum.bounces[0], BounceStats { n_rays: 20, n_hits: 2, n_shadow_rays: 4 });
        sum.add(&Profile { frame_ms: None, ..later });
        assert_eq!(sum.frame_ms, None);
    }
}
