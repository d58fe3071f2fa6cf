//! A scene file whose meshes, lights and cameras are posed by their keys at one moment after the other. The file is
//! read once.

use std::path::PathBuf;

use super::{
    animations::Moving,
    assemble::{Assembled, lights_at, load_toml},
    cameras::Cameras,
    keyframes::KeyedTable,
};
use crate::scene::{
    files::SourceFile,
    model::{Instance, LoadOptions, Scene, SceneError},
};

/// A scene file that can be posed.
pub(crate) struct KeyPoser {
    path: PathBuf,
    moving: Vec<Moving>,
    lights: Vec<KeyedTable>,
    /// Whether the scene's lights are the file's.
    has_lights: bool,
    cameras: Cameras,
    /// The camera that the options choose.
    camera: Option<String>,
}

impl KeyPoser {
    /// Reads a file, whose scene at the moment of the options is known. Returns `None` if animations of glTF files are
    /// shown, or if the scene's instances are not the file's.
    pub fn new(file: &SourceFile, options: &LoadOptions, scene: &Scene) -> Option<Self> {
        let Assembled { scene: own, moving, lights, cameras, plays_files, .. } = load_toml(file, options).ok()?;
        let is_same = |(a, b): (&Instance, &Instance)| a.mesh_ix == b.mesh_ix && a.transform == b.transform;
        let fits = own.origin == scene.origin
            && own.instances.len() <= scene.instances.len()
            && own.instances.iter().zip(&scene.instances).all(is_same);
        let has_lights = own.lights == scene.lights && !lights.is_empty();
        let (path, camera) = (file.path.clone(), options.camera.clone());
        (fits && !plays_files).then_some(Self { path, moving, lights, has_lights, cameras, camera })
    }

    /// Poses a scene of the file at a moment, seconds.
    pub fn pose(&self, seconds: f64, scene: &mut Scene) -> Result<(), SceneError> {
        for moving in &self.moving {
            moving.pose(seconds, scene).map_err(|what| SceneError::file(&self.path, what))?;
        }
        if self.has_lights {
            scene.lights = lights_at(&self.path, &self.lights, (Some(seconds), scene.origin))?;
        }
        self.cameras.pose(&self.path, Some(seconds), scene)?;
        if let Some(name) = &self.camera {
            scene.choose_camera(name).map_err(|what| SceneError::file(&self.path, what))?;
        }
        Ok(())
    }
}
