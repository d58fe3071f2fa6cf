//! A scene file whose meshes and lights are posed by their keys at one moment after the other. The file is read once.

use std::path::{Path, PathBuf};

use super::{
    animations::Moving,
    assemble::{Assembled, lights_at, load_toml},
    keys::MovingLight,
};
use crate::scene::model::{Instance, LoadOptions, Scene, SceneError};

/// A scene file that can be posed.
pub(crate) struct KeyPoser {
    path: PathBuf,
    moving: Vec<Moving>,
    lights: Vec<MovingLight>,
    /// Whether the scene's lights are the file's.
    has_lights: bool,
}

impl KeyPoser {
    /// Reads a file, whose scene at the moment of the options is known. Returns `None` if animations of glTF files are
    /// shown, or if the scene's instances are not the file's.
    pub fn new(path: &Path, options: &LoadOptions, scene: &Scene) -> Option<Self> {
        let Assembled { scene: own, moving, lights, plays_files, .. } = load_toml(path, options).ok()?;
        let is_same = |(a, b): (&Instance, &Instance)| a.mesh_ix == b.mesh_ix && a.transform == b.transform;
        let fits = own.origin == scene.origin
            && own.instances.len() <= scene.instances.len()
            && own.instances.iter().zip(&scene.instances).all(is_same);
        let has_lights = own.lights == scene.lights && !lights.is_empty();
        (fits && !plays_files).then(|| Self { path: path.to_owned(), moving, lights, has_lights })
    }

    /// Poses a scene of the file at a moment, seconds.
    pub fn pose(&self, seconds: f64, scene: &mut Scene) -> Result<(), SceneError> {
        for moving in &self.moving {
            moving.pose(seconds, scene).map_err(|what| SceneError::file(&self.path, what))?;
        }
        if self.has_lights {
            scene.lights = lights_at(&self.path, &self.lights, (Some(seconds), scene.origin))?;
        }
        Ok(())
    }
}
