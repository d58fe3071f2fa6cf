//! AOVs (arbitrary output variables): what a pixel shows and costs, beside its colour. Users see the names of this
//! file.

use super::{noise, variance_of_joined};
use crate::layout::{LIGHT_LAYERS, PixelAovs, SURFACE_LAYERS};

/// An output variable, in world space and world units.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aov {
    /// Distance from the eye to what the ray through the pixel's centre hits, along the camera's view direction;
    /// infinity for a miss.
    Depth,
    /// Mean of the samples' shading normals at the first hit, towards the eye; 0 for a miss or a lamp.
    Normal,
    /// The point that the same ray hits; 0 for a miss.
    Position,
    /// Mean of the samples' albedos at the first hit, linear, 0 to 1: what the surface reflects, or lets pass. 0 for a
    /// miss or a lamp.
    Albedo,
    /// Index of the triangle that it hits, in the scene's order; 4294967295 for a miss.
    Id,
    /// Index of the material that it hits; 4294967295 for a miss.
    Material,
    /// Vector from the pixel to where the point of [`Aov::Position`] is in the next frame's picture: pixels to the
    /// right and upwards. For a miss, that of a point infinitely far away.
    Motion,
    /// Number of the rays of the pixel's first sample: primary, secondary and shadow rays.
    Rays,
    /// Number of entries of the acceleration structure that these rays read, such as nodes and triangles in leaves.
    Cost,
    /// Variance of the pixel's mean luminance, before the noise filter, as estimated from its samples. Infinity for a
    /// single sample. Only pictures of paths have it.
    Variance,
    /// Number of the pixel's samples. Only pictures of paths have it.
    Samples,
    /// Light that the camera sees directly, before any bounce: of emitters, the environment and the background. Only
    /// pictures of paths have it.
    Emission,
    /// Light that reaches the camera after one bounce. Only pictures of paths have it.
    Direct,
    /// Light that reaches the camera after more than one bounce. Only pictures of paths have it.
    Indirect,
}

named_enum!(Aov {
    Depth = "depth": "distance along the camera's view; infinity where nothing is hit",
    Normal = "normal": "mean of the samples' shading normals, world space",
    Position = "position": "point that is hit, world space",
    Albedo = "albedo": "mean of the samples' reflectances, of glass its tint, linear, 0 to 1",
    Id = "id": "index of the triangle; 4294967295 where nothing is hit",
    Material = "material": "index of the material; 4294967295 where nothing is hit",
    Motion = "motion": "pixels to the right and up to where the point is one frame later; 0 where nothing moves",
    Rays = "rays": "number of primary, secondary and shadow rays of the pixel's first sample",
    Cost = "cost": "nodes or cells, and triangles that these rays read; also drawn as NAME.cost.png",
    Variance = "variance": "variance of the pixel's mean luminance, from its samples; needs --integrator path",
    Samples = "samples": "number of the pixel's samples; needs --integrator path",
    Emission = "emission": "light that is seen directly: lamps, sky, background; needs --integrator path",
    Direct = "direct": "light after one bounce; needs --integrator path",
    Indirect = "indirect": "light after more than one bounce; needs --integrator path",
});

/// A named channel, with a number for each pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// The name of the layer, a dot and the name of the component, as in `normal.X`.
    pub name: String,
    /// The samples of all pixels, rows from the top.
    pub samples: Samples,
}

/// Samples of a channel, one for each pixel.
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// Single-precision numbers.
    Float(Vec<f32>),
    /// Counts and indices.
    Uint(Vec<u32>),
}

impl PixelAovs {
    /// Notes the noise of a pixel of paths. `mean`: of the radiance of its samples and of their squared luminance.
    pub(crate) fn set_noise(&mut self, mean: [f32; 4], n_samples: u32) {
        self.variance = noise::variance_of_mean(mean, n_samples);
        self.n_samples = n_samples;
    }

    /// Adds the noise of further samples of the pixel.
    pub(crate) fn join_noise(&mut self, next: &Self) {
        let ranges = [&*self, next].map(|aovs| (aovs.n_samples, aovs.variance));
        self.variance = variance_of_joined(ranges.into_iter());
        self.n_samples += next.n_samples;
    }
}

impl Aov {
    /// The layers of light, whose sum is the radiance of a picture without noise filter.
    pub const OF_LIGHT: [Self; LIGHT_LAYERS as usize] = [Self::Emission, Self::Direct, Self::Indirect];

    /// The layers of the surfaces that camera rays hit.
    pub const OF_SURFACES: [Self; SURFACE_LAYERS as usize] = [Self::Albedo, Self::Normal];

    /// The layers that are means of all samples, as the picture is: of light, then of surfaces.
    pub const OF_MEANS: [Self; 5] = [Self::Emission, Self::Direct, Self::Indirect, Self::Albedo, Self::Normal];

    /// Whether only pictures of paths have the output.
    pub fn is_of_paths(self) -> bool {
        matches!(self, Self::Variance | Self::Samples) || self.is_of_light()
    }

    /// Whether the output is a layer of light.
    pub fn is_of_light(self) -> bool {
        Self::OF_LIGHT.contains(&self)
    }

    /// Whether the output is a mean of all samples, as the picture is ([`Aov::OF_MEANS`]).
    pub fn is_of_means(self) -> bool {
        Self::OF_MEANS.contains(&self)
    }

    /// The names of the components of a layer of three.
    #[cfg(feature = "files")]
    pub(crate) fn components(self) -> [&'static str; 3] {
        if matches!(self, Self::Normal | Self::Position) { ["X", "Y", "Z"] } else { ["R", "G", "B"] }
    }

    /// Returns the output's channels, from a picture's AOVs. Layers that are means of all samples are none of them, and
    /// neither is [`Aov::Motion`].
    pub fn channels(self, pixel_aovs: &[PixelAovs]) -> Vec<Channel> {
        let float = |component: &str, value: fn(&PixelAovs) -> f32| Channel {
            name: format!("{self}.{component}"),
            samples: Samples::Float(pixel_aovs.iter().map(value).collect()),
        };
        let uint = |component: &str, value: fn(&PixelAovs) -> u32| Channel {
            name: format!("{self}.{component}"),
            samples: Samples::Uint(pixel_aovs.iter().map(value).collect()),
        };
        match self {
            Self::Depth => vec![float("Z", |f| f.depth)],
            Self::Position => vec![
                float("X", |f| f.position_world.x),
                float("Y", |f| f.position_world.y),
                float("Z", |f| f.position_world.z),
            ],
            Self::Id => vec![uint("ID", |f| f.triangle_ix)],
            Self::Material => vec![uint("ID", |f| f.material_ix)],
            Self::Rays => vec![uint("N", |f| f.n_rays)],
            Self::Cost => vec![uint("N", |f| f.n_steps)],
            Self::Variance => vec![float("Y", |f| f.variance)],
            Self::Samples => vec![uint("N", |f| f.n_samples)],
            Self::Emission | Self::Direct | Self::Indirect | Self::Albedo | Self::Normal | Self::Motion => Vec::new(),
        }
    }
}
