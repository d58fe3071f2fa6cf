//! Options of loading a scene.

use super::Look;
use crate::{frame::Integrator, util::progress::Progress};

/// Options of loading a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LoadOptions {
    /// The scene of a glTF file by its name or its index, counted from 0. Where absent, it is the file's default scene.
    pub scene: Option<String>,
    /// The camera of the scene's file by its name or its index, counted from 0. Where absent, it is the file's default
    /// camera.
    pub camera: Option<String>,
    /// Whether the scene's files may name files that do not lie below their own folders.
    pub allow_outside: bool,
    /// Width of the picture divided by its height, which a camera is made for where the file has none. Where absent, it
    /// is that of [`Scene::defaults`](super::Scene::defaults).
    pub aspect: Option<f32>,
    /// The integrator that the user asks for. It decides as one of a scene file whether surfaces that shine count as
    /// lamps.
    pub integrator: Option<Integrator>,
    /// Whether a scene is moved to the origin if its coordinates are so large that single precision loses details.
    /// [`Scene::origin`](super::Scene::origin) says by how much. Cameras and lights of the file and of `look` are moved
    /// with it.
    pub recentre: bool,
    /// What replaces parts of the scene.
    pub look: Look,
    /// Who is told of the progress: of mesh files that are read, and of images that are decoded.
    pub progress: Progress,
}
