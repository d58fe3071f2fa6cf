//! The render options that a scene file can set.

use crate::frame::{Denoise, Integrator, RenderOptions, Tonemap};

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
    /// Whether the exposure is to be measured ([`metered_exposure`](crate::cpu::metered_exposure)) in place of
    /// `exposure`. It is for scenes of files whose lights have physical units.
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
    /// Twelve levels of rays and 64 samples, without the noise filter.
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
        let Self { width, height, integrator, max_depth, exposure, tonemap, denoise, .. } = self.for_integrator(None);
        RenderOptions { width, height, integrator, max_depth, exposure, tonemap, denoise, ..RenderOptions::default() }
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
