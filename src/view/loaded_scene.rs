//! A loaded scene with its acceleration structure, before it is uploaded to a device; or an empty one in its place.

use std::path::{Path, PathBuf};

use glam::Vec3;

use super::timeline::Timeline;
use crate::{
    accel::Statistics,
    engine::{Builder, LoadError, LoadRequest, Loaded, Opened},
    scene::{AnimationChoice, Scene},
    util::progress::Progress,
    world::FlatScene,
};

/// How scenes are loaded. It stays the same each time that the scene is read.
#[derive(Clone, Debug)]
pub struct LoadSettings {
    /// What is loaded of the scene's file, and for which work.
    pub request: LoadRequest,
    /// What builds the structure.
    pub builder: Builder,
}

/// A scene and its acceleration structure.
pub struct LoadedScene {
    /// The scene's file; none while no file is open.
    pub path: Option<PathBuf>,
    /// How it was loaded.
    pub load_settings: LoadSettings,
    /// The scene with its structure, and the options of its pictures.
    pub built: Loaded,
    /// Figures of the structure, as it was when the scene was loaded.
    pub statistics: Statistics,
    /// The animations; none if the scene has none, or none of them is to be shown.
    pub(super) timeline: Option<Timeline>,
}

impl LoadedScene {
    /// Reads the scene and builds its acceleration structure.
    ///
    /// # Errors
    /// The scene cannot be loaded, or the host has too little memory.
    pub fn load(path: &Path, settings: &LoadSettings) -> Result<Self, LoadError> {
        Self::build(Some(path), Opened::read(path, &settings.request)?, settings)
    }

    /// Builds the acceleration structure of a scene that was read from `path`.
    ///
    /// # Errors
    /// The scene's parts do not fit together, or the host has too little memory.
    pub fn build(path: Option<&Path>, opened: Opened, settings: &LoadSettings) -> Result<Self, LoadError> {
        let is_animated = path.is_some()
            && !opened.scene.animations.is_empty()
            && settings.request.scene.animation != AnimationChoice::None;
        let first = is_animated.then(|| opened.scene.clone());
        let asked = settings.builder.request;
        let of_motion = is_animated.then(|| opened.for_motion(asked, settings.builder.processor, 1));
        let (request, note) = of_motion.unwrap_or((asked, None));
        let mut built = Builder { request, ..settings.builder.clone() }.build(opened, &settings.request.work)?;
        built.notes.extend(note);
        let (path, statistics) = (path.map(Path::to_owned), built.world.statistics());
        // When the file is read again, nobody waits for it, and the window keeps its exposure.
        let mut load_settings = settings.clone();
        load_settings.builder.progress = Progress::default();
        load_settings.request.scene.progress = Progress::default();
        if let Some(picture) = &mut load_settings.request.picture {
            picture.exposure = Some(built.options.exposure);
        }
        let timeline =
            path.as_deref().zip(first).map(|(path, first)| Timeline::new(path, &load_settings.request, first));
        Ok(Self { path, statistics, built, load_settings, timeline })
    }

    /// Returns a scene without triangles. It takes the place of a loaded scene while no file is open.
    ///
    /// # Errors
    /// The host has too little memory.
    pub fn none(settings: &LoadSettings) -> Result<Self, LoadError> {
        let empty = Scene { background: Vec3::splat(0.02), ..Scene::empty(Path::new("")) };
        Self::build(None, Opened::read(empty, &settings.request)?, settings)
    }

    /// Returns whether a file is open.
    pub fn is_open(&self) -> bool {
        self.path.is_some()
    }

    /// Returns the scene.
    pub fn scene(&self) -> &FlatScene {
        self.built.world.scene()
    }
}
