//! What a scene says of the options that it is rendered with.

use crate::frame::{Denoise, RenderOptions, Tonemap};

/// What a scene asks to be rendered with, unless the user says otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderDefaults {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Levels of rays, the primary one counted.
    pub max_depth: u32,
    /// Factor on radiance before the tone curve.
    pub exposure: f32,
    /// The curve from radiance to display.
    pub tonemap: Tonemap,
    /// The noise filter.
    pub denoise: Denoise,
}

impl Default for RenderDefaults {
    fn default() -> Self {
        let RenderOptions { width, height, max_depth, exposure, tonemap, denoise, .. } = RenderOptions::default();
        Self { width, height, max_depth, exposure, tonemap, denoise }
    }
}

impl RenderDefaults {
    /// The options that render the scene as it asks for.
    pub fn options(&self) -> RenderOptions {
        let &Self { width, height, max_depth, exposure, tonemap, denoise } = self;
        RenderOptions { width, height, max_depth, exposure, tonemap, denoise, ..RenderOptions::default() }
    }
}
