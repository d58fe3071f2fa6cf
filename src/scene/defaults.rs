//! The render options that a scene file can set.

use crate::frame::{Denoise, RenderOptions, Tonemap};

/// Render options of a scene, which the user may override.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderDefaults {
    /// Width of the picture, pixels.
    pub width: u32,
    /// Height of the picture, pixels.
    pub height: u32,
    /// Number of ray levels, including the primary rays: 1 stands for primary rays only.
    pub max_depth: u32,
    /// Number of samples per pixel of a picture.
    pub samples: u32,
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

impl Default for RenderDefaults {
    fn default() -> Self {
        let RenderOptions { width, height, max_depth, exposure, tonemap, denoise, .. } = RenderOptions::default();
        Self { width, height, max_depth, samples: 1, exposure, is_metered: false, tonemap, denoise }
    }
}

impl RenderDefaults {
    /// Returns full render options with the scene's values.
    pub fn options(&self) -> RenderOptions {
        let &Self { width, height, max_depth, exposure, tonemap, denoise, .. } = self;
        RenderOptions { width, height, max_depth, exposure, tonemap, denoise, ..RenderOptions::default() }
    }
}
