//! The render options that a scene file can set, and what a user sets in their place.

use crate::frame::{Denoise, Integrator, PathOptions, RenderOptions, Tonemap};

/// Render options of a scene, which the user may override.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderDefaults {
    /// Width of the picture, pixels.
    pub width: u32,
    /// Height of the picture, pixels.
    pub height: u32,
    /// How light is computed.
    pub integrator: Integrator,
    /// Number of ray levels, including the primary rays: 1 stands for primary rays only.
    pub max_depth: u32,
    /// Number of samples per pixel of a picture.
    pub samples: u32,
    /// Values of `max_depth`, `samples` and `denoise` for [`Integrator::Path`], which take the place of the others.
    pub of_paths: PathDefaults,
    /// Factor on radiance before the tone curve.
    pub exposure: f32,
    /// Whether `Engine::load` measures the exposure in place of `exposure`. It is for scenes of files whose lights have
    /// physical units.
    pub is_metered: bool,
    /// The curve from radiance to display.
    pub tonemap: Tonemap,
    /// The noise filter.
    pub denoise: Denoise,
}

/// Render options whose values differ if paths are traced.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathDefaults {
    /// Number of ray levels, including the primary rays.
    pub max_depth: u32,
    /// Number of samples per pixel of a picture.
    pub samples: u32,
    /// The noise filter.
    pub denoise: Denoise,
}

impl Default for PathDefaults {
    /// Rays up to a depth of twelve and 64 samples, without the noise filter.
    fn default() -> Self {
        Self { max_depth: 12, samples: 64, denoise: Denoise::Off }
    }
}

impl Default for RenderDefaults {
    fn default() -> Self {
        let RenderOptions { width, height, integrator, max_depth, exposure, tonemap, denoise, .. } =
            RenderOptions::default();
        let of_paths = PathDefaults::default();
        Self {
            width,
            height,
            integrator,
            max_depth,
            samples: 1,
            of_paths,
            exposure,
            is_metered: false,
            tonemap,
            denoise,
        }
    }
}

impl RenderDefaults {
    /// Returns full render options with the scene's values.
    pub fn options(&self) -> RenderOptions {
        self.with(&PictureChoices::default())
    }

    /// Returns full render options: the user's choices, and the scene's values where the user has made none.
    pub fn with(&self, choices: &PictureChoices) -> RenderOptions {
        let &PictureChoices { size, integrator, max_depth, exposure, tonemap, denoise, paths } = choices;
        let scene = self.for_integrator(integrator);
        let (width, height) = size.unwrap_or((scene.width, scene.height));
        RenderOptions {
            width,
            height,
            integrator: scene.integrator,
            paths,
            max_depth: max_depth.unwrap_or(scene.max_depth),
            exposure: exposure.unwrap_or(scene.exposure),
            tonemap: tonemap.unwrap_or(scene.tonemap),
            denoise: denoise.map_or(scene.denoise, |choice| choice.of(scene.denoise)),
            ..RenderOptions::default()
        }
    }

    /// Returns the options for an integrator, or for the scene's own if there is none.
    pub fn for_integrator(&self, integrator: Option<Integrator>) -> Self {
        let integrator = integrator.unwrap_or(self.integrator);
        let PathDefaults { max_depth, samples, denoise } = self.of_paths;
        match integrator {
            Integrator::Whitted => Self { integrator, ..*self },
            Integrator::Path => Self { integrator, max_depth, samples, denoise, ..*self },
        }
    }
}

/// Options of pictures that a user sets in place of the scene's.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PictureChoices {
    /// Width and height of the picture, pixels.
    pub size: Option<(u32, u32)>,
    /// How light is computed.
    pub integrator: Option<Integrator>,
    /// Number of ray levels, including the primary rays.
    pub max_depth: Option<u32>,
    /// Factor on radiance before the tone curve. Without one, it is metered where the scene's light has physical units.
    pub exposure: Option<f32>,
    /// The curve from radiance to display.
    pub tonemap: Option<Tonemap>,
    /// The noise filter.
    pub denoise: Option<DenoiseChoice>,
    /// Options of paths, which scenes do not set.
    pub paths: PathOptions,
}

/// A user's choice of a noise filter: [`Denoise`], whose threshold may be left to the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DenoiseChoice {
    /// The paper's filter, with the scene's threshold or [`Denoise::DEFAULT_THRESHOLD`] where none is given.
    Paper(Option<f32>),
    /// The filter of paths.
    Edge,
    /// No filter.
    Off,
}

impl DenoiseChoice {
    /// Returns the filter for a scene with the filter `scene`.
    fn of(self, scene: Denoise) -> Denoise {
        match (self, scene) {
            (Self::Off, _) => Denoise::Off,
            (Self::Edge, _) => Denoise::Edge,
            (Self::Paper(Some(threshold)), _) | (Self::Paper(None), Denoise::Paper { threshold }) => {
                Denoise::Paper { threshold }
            }
            (Self::Paper(None), _) => Denoise::Paper { threshold: Denoise::DEFAULT_THRESHOLD },
        }
    }
}
