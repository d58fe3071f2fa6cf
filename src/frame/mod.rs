//! A frame's options, its plan of passes, and its results: the picture, the profile and the AOVs of pixels. GPU
//! and CPU share these types.
//!
//! ```text
//! options    RenderOptions, crop: what to render, and by which methods
//! constants  the uniform buffer of the kernels; sampling: the positions of samples in their pixels
//! goal       the end of a picture: a number of samples, or a time
//! check      the ranges of options
//! sample_range  parts of a picture's samples, and their sums
//! plan       the order of passes and the barriers between them
//!   pass       what each pass does, reads and writes
//!   resource   the buffers and images that passes write
//! bounce     sizes of a bounce's dispatches
//! frame_renderer  the loop over a picture's frames, on a device or on the CPU
//! results    drawn; profile and counts; aov, mean_layers and view: what there is beside the picture
//! ```

mod aov;
pub(crate) mod bounce;
pub(crate) mod check;
mod constants;
pub(crate) mod counts;
mod crop;
mod drawn;
mod frame_renderer;
mod goal;
mod mean_layers;
#[doc(hidden)]
pub mod noise;
mod noise_tiles;
mod pass;
pub mod plan;
mod profile;
mod resource;
mod sample_range;
pub mod sampling;
mod view;

#[doc(hidden)]
pub use self::frame_renderer::FrameRenderer;
pub use self::{
    aov::{Aov, Channel, Samples},
    crop::Crop,
    drawn::{Drawn, DrawnNoiseTiles, Watcher},
    goal::{Goal, Pacer},
    mean_layers::{MeanLayers, RangeSums},
    noise_tiles::{NoiseTileSamples, NoiseTiles},
    pass::{Pass, Role, Scope},
    plan::{Access, FrameProperties, PassSequence, Plan, PlanEntry},
    profile::{BounceStats, PassTime, Profile},
    resource::Resource,
    sample_range::{BlockSum, SampleRange, SampleSums, variance_of_joined},
    view::View,
};
pub(crate) use self::{constants::ImagePlane, drawn::Unending, resource::for_resources};
use std::ops::Range;

use rayon::prelude::*;

use crate::{accel::kdtree::Traversal, layout};

/// How a frame is rendered. For each option that the user does not set, the command takes the value of the scene's
/// [`RenderDefaults`](crate::scene::RenderDefaults).
#[derive(Clone, Debug, PartialEq)]
pub struct RenderOptions {
    /// Width of the whole picture, pixels: 1 to [`RenderOptions::MOST_SIDE`].
    pub width: u32,
    /// Height of the whole picture, pixels: 1 to [`RenderOptions::MOST_SIDE`].
    pub height: u32,
    /// The part of the picture to render, which is inside the picture. None: all of it.
    pub crop: Option<Crop>,
    /// The tiles to render in place of a crop, which have no border. Only [`Integrator::Path`] without a noise filter
    /// renders tiles.
    pub noise_tiles: Option<NoiseTiles>,
    /// How light is computed.
    pub integrator: Integrator,
    /// Levels of rays, the primary rays included, 1 to [`RenderOptions::MOST_DEPTH`]: 1 is ray casting with shadows
    /// (Algorithm 1's `maximumDepth`). To pass straight through an alpha-blended surface makes a ray no deeper.
    pub max_depth: u32,
    /// Factor by which radiance is multiplied before it is encoded for display, finite and above 0.
    pub exposure: f32,
    /// The curve from radiance to display.
    pub tonemap: Tonemap,
    /// The noise filter.
    pub denoise: Denoise,
    /// The algorithm by which rays traverse the kd-tree.
    pub traversal: Traversal,
    /// How primary rays find their triangles.
    pub primary: Primary,
    /// Whether the device measures times and counts rays. If not, its frames have empty profiles.
    pub profile: bool,
    /// Whether the AOVs of each pixel are written: what its primary ray hits, and what all its rays cost.
    pub pixel_aovs: bool,
    /// Whether the picture has layers of its light: emission, direct and indirect light ([`Aov::OF_LIGHT`]). Only
    /// frames of [`Integrator::Path`] have them. They take three times the memory of the pixels' samples in addition.
    pub light_layers: bool,
    /// Whether the picture has layers of the surfaces that camera rays hit: albedo and normal ([`Aov::OF_SURFACES`]).
    /// They take twice the memory of the pixels' samples in addition.
    pub surface_layers: bool,
    /// Whether [`Integrator::Whitted`] approximates the light of the environment, of area lights and of emissive
    /// surfaces by an ambient term.
    pub approximates_ambient: bool,
    /// What only paths have: filters, lens, bounds.
    pub paths: PathOptions,
}

/// Options with which nothing can be rendered. The message is one line, which names the option and its range.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct BadOptions(pub(crate) String);

impl RenderOptions {
    /// The bounces that a scene with alpha-blended surfaces adds to those of `max_depth`, in frames of
    /// [`Integrator::Whitted`]. A ray that passes straight through such a surface uses a bounce, but gets no deeper.
    pub const EXTRA_BOUNCES: u32 = 32;

    /// Returns the number of bounces of a frame, without [`RenderOptions::EXTRA_BOUNCES`]. Paths have one more than
    /// `max_depth`, in which the rays from the last hits only meet light.
    pub fn n_bounces(&self) -> u32 {
        match self.integrator {
            Integrator::Whitted => self.max_depth,
            Integrator::Path => self.max_depth + 1,
        }
    }

    /// Whether frames have layers of light.
    pub fn has_light_layers(&self) -> bool {
        self.light_layers && self.integrator == Integrator::Path
    }

    /// Returns which of [`MeanLayers`] frames have.
    pub(crate) fn mean_layers(&self) -> Range<usize> {
        let (n_of_light, n_layers) = (Aov::OF_LIGHT.len(), Aov::OF_MEANS.len());
        let begin = if self.has_light_layers() { 0 } else { n_of_light };
        begin..if self.surface_layers { n_layers } else { n_of_light }
    }

    /// Returns the noise filter that frames have: that of the options, but none in place of [`Denoise::Edge`] unless
    /// the frames trace paths.
    pub fn noise_filter(&self) -> Denoise {
        match (self.integrator, self.denoise) {
            (Integrator::Whitted, Denoise::Edge) => Denoise::Off,
            (_, denoise) => denoise,
        }
    }
}

/// Options of [`Integrator::Path`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathOptions {
    /// Which random numbers the picture has, 0 to [`PathOptions::MOST_SEED`]. The noise of pictures of two seeds is
    /// independent: each has a range of samples of its own, of which there are [`SampleRange::MOST`].
    pub seed: u32,
    /// Index of the picture's first sample in each pixel, among those of its seed: a multiple of
    /// `2^SAMPLE_BLOCK_LOG2`. Pictures of other samples are independent of this one, and their mean is the picture of
    /// all samples.
    pub first_sample: u32,
    /// The density of samples around the centre of their pixel.
    pub filter: PixelFilter,
    /// The most light of each contribution of a path after its first hit, in any colour (radiance): of each light that
    /// it samples or meets. The sum may be more. It makes pictures darker than they should be. It is above 0.
    /// Infinity: any amount.
    pub clamp: f32,
    /// Radius of the camera's lens, world units. 0: everything is sharp.
    pub aperture: f32,
    /// Distance from the eye, along the view, at which things are sharp, world units. None: the camera's target.
    pub focus: Option<f32>,
}

impl PathOptions {
    /// The greatest seed. The indices of all samples of all seeds fit 32 bits.
    pub const MOST_SEED: u32 = (1 << 15) - 1;

    /// Returns the index of the picture's first sample among those of all seeds.
    pub(crate) fn range_begin(&self) -> u32 {
        SampleRange::MOST * self.seed + self.first_sample
    }
}

impl Default for PathOptions {
    fn default() -> Self {
        Self { seed: 0, first_sample: 0, filter: PixelFilter::Tent, clamp: f32::INFINITY, aperture: 0.0, focus: None }
    }
}

impl Default for RenderOptions {
    fn default() -> Self {
        Self {
            width: 1024,
            height: 768,
            crop: None,
            noise_tiles: None,
            integrator: Integrator::Whitted,
            max_depth: 5,
            exposure: 1.0,
            tonemap: Tonemap::Linear,
            denoise: Denoise::Paper { threshold: Denoise::DEFAULT_THRESHOLD },
            traversal: Traversal::OF_GPUS,
            primary: Primary::Raster,
            profile: true,
            pixel_aovs: false,
            light_layers: false,
            surface_layers: false,
            approximates_ambient: false,
            paths: PathOptions::default(),
        }
    }
}

/// The noise filter, a post-process (the paper's section 2.4).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Denoise {
    /// No filter.
    Off,
    /// Smooths a pixel if its luminance differences to its four neighbours add up to more than the threshold.
    Paper {
        /// Sum of the four differences above which a pixel is smoothed, in units of display white, 0 to 4.
        threshold: f32,
    },
    /// Blurs light within surfaces and keeps their edges, as far as the noise of each pixel demands: an edge-avoiding
    /// à-trous wavelet transform, guided by the variance of samples (Dammertz et al. 2010, Schied et al. 2017). Only
    /// frames of [`Integrator::Path`] have it.
    Edge,
}

impl Denoise {
    /// The default threshold. A pixel's differences add up to 1 on a straight edge between black and white, to 2 at a
    /// corner or on a thin line, and to 4 if the pixel is a white dot on black.
    pub const DEFAULT_THRESHOLD: f32 = 2.5;
}

/// The curve that maps radiance, which has no upper bound, to the range of a display.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tonemap {
    /// Radiance as it is, clipped at white.
    Linear,
    /// AgX: bright colours fade to white, dark ones keep their hue.
    Agx,
    /// The film-like curve of the Academy Color Encoding System.
    Aces,
    /// Khronos PBR Neutral: base colours as they are, bright ones compressed.
    Neutral,
}

impl Tonemap {
    /// Returns the value of the kernel's specialization constant `CURVE`.
    pub(crate) fn constant(self) -> u32 {
        match self {
            Self::Linear => layout::TONEMAP_LINEAR,
            Self::Agx => layout::TONEMAP_AGX,
            Self::Aces => layout::TONEMAP_ACES,
            Self::Neutral => layout::TONEMAP_NEUTRAL,
        }
    }
}

/// How light is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Integrator {
    /// The paper's ray tracing, after Whitted (1980): each hit is lit by points and directions of light with hard
    /// shadows and by a constant ambient light, and mirrors and glass make further rays.
    Whitted,
    /// Path tracing (Kajiya: The Rendering Equation, 1986): light from everywhere, by random paths.
    Path,
}

/// The density of samples around the centre of their pixel, by which they make up the pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PixelFilter {
    /// The square of the pixel.
    Box,
    /// A tent on each axis, which ends at the centres of the neighbouring pixels.
    Tent,
    /// A Gaussian of standard deviation 0.5 px, up to 1.5 px from the centre.
    Gaussian,
}

/// How primary rays find their triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Primary {
    /// The graphics pipeline rasterizes triangle IDs; then each ray is intersected with its triangle's plane.
    Raster,
    /// Compute kernels rasterize triangles with the ray-triangle test of the traversal. So hits are those of `Trace`,
    /// bit for bit, unless camera rays begin so far away that their origins are moved (`near_scene`). The device must
    /// have 64-bit atomics. The CPU engine has no such kernels and takes `Raster` instead.
    SoftwareRaster,
    /// Rays are traced through the acceleration structure.
    Trace,
}

impl Primary {
    /// Returns `Raster` or `Trace`, whichever is expected to take less time. The rasterizer processes all triangles;
    /// tracing processes one ray per pixel of the picture, of the given width and height. `triangles_per_ray`: the
    /// number of triangles that are rasterized in the time in which one ray is traced.
    pub fn suited_to(n_triangles: usize, (width, height): (u32, u32), triangles_per_ray: u64) -> Self {
        let n_rays = u64::from(width) * u64::from(height);
        if n_triangles as u64 <= triangles_per_ray * n_rays { Self::Raster } else { Self::Trace }
    }
}

/// The picture of a rendered frame, or of its crop. Pixels are in rows from the top, left to right.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Picture {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// `width * height` linear RGB radiances, after the noise filter and before exposure; the fourth component is 1.
    pub radiance: Vec<[f32; 4]>,
    /// `width * height` sRGB-encoded RGBA pixels.
    pub display: Vec<[u8; 4]>,
}

/// Sets the fourth component of pixels to 1. In frames of paths, kernels use it for the noise of the samples.
pub(crate) fn opaque(mut radiance: Vec<[f32; 4]>) -> Vec<[f32; 4]> {
    radiance.par_iter_mut().for_each(|pixel| pixel[3] = 1.0);
    radiance
}

named_enum!(Tonemap {
    Linear = "linear": "radiance as it is; what is above white is clipped",
    Agx = "agx": "AgX: bright colours fade to white, dark ones keep their hue",
    Aces = "aces": "the ACES curve of films: more contrast",
    Neutral = "neutral": "Khronos PBR Neutral: products in their own colours",
});
named_enum!(Integrator {
    Whitted = "whitted": "the paper's ray tracing: point lights, hard shadows, mirrors, glass, constant ambient light",
    Path = "path": "path tracing: light from lamps, surfaces and the sky, soft shadows, any number of reflections",
});
named_enum!(PixelFilter {
    Box = "box": "the square of the pixel",
    Tent = "tent": "a tent that ends at the centres of the neighbouring pixels",
    Gaussian = "gaussian": "a Gaussian of standard deviation half a pixel, cut off at 1.5 pixels from the centre",
});
named_enum!(Primary {
    Raster = "raster": "the device's graphics pipeline rasterizes the triangles; best if they are fewer than pixels",
    SoftwareRaster = "software-raster": "compute kernels rasterize them, with 64-bit atomics; with --cpu as raster",
    Trace = "trace": "rays are traced through the acceleration structure",
} renamed { "compute" => "software-raster" });
