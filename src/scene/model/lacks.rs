//! What a scene's file leaves out.

use super::Up;

/// What a scene's file leaves out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Lacks {
    pub camera: bool,
    /// The axis that points up in a scene without a camera, unless the user states one.
    pub up: Up,
    /// The input is a mesh file, no scene file. It gets a ground under a sky, and ambient light beside its lamps.
    pub description: bool,
    /// The scene has neither lights nor ambient light.
    pub light: bool,
    /// The file has neither a background nor anything in its place. The scene gets one together with standard lights.
    pub background: bool,
    /// How light is computed. If the file leaves it out, the scene's content decides.
    pub integrator: bool,
    /// The exposure, and whether it is measured.
    pub exposure: bool,
}

impl Lacks {
    /// What a bare mesh lacks: everything.
    pub fn all(up: Up) -> Self {
        Self { camera: true, up, description: true, light: true, background: true, integrator: true, exposure: true }
    }
}

/// The lights that kdray has guessed for a scene whose file has none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChosenLight {
    /// Two directional lights and ambient light, for a scene that is seen from outside.
    Outside,
    /// Two point lights and ambient light, for an interior.
    Inside,
    /// No lights, since surfaces that shine light the scene.
    Surfaces,
}

/// Samples per pixel of a picture of a file that is no scene file, enough to smooth its edges.
pub(crate) const SAMPLES: u32 = 4;
