//! A scene with all that is made from it before there is a device.

use std::{
    path::{Path, PathBuf},
    time::Instant,
};

use glam::Vec3;

use crate::{
    kdtree::{BuildOptions, KdTree, Statistics},
    scene::{Scene, SceneError, framing},
};

/// A scene and its tree.
pub struct Loaded {
    pub path: PathBuf,
    pub scene: Scene,
    pub tree: KdTree,
    pub statistics: Statistics,
    pub build_ms: f64,
}

impl Loaded {
    /// Reads the scene and builds its tree.
    ///
    /// # Errors
    /// The scene cannot be loaded.
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        Ok(Self::with_tree(path, Scene::load(path)?))
    }

    /// Builds a scene's tree.
    pub fn with_tree(path: &Path, scene: Scene) -> Self {
        let options = BuildOptions::default();
        let start = Instant::now();
        let tree = KdTree::build(&scene.triangles, &options);
        let build_ms = start.elapsed().as_secs_f64() * 1e3;
        let statistics = tree.statistics(scene.triangles.len(), &options);
        Self { path: path.to_owned(), scene, tree, statistics, build_ms }
    }

    /// Smallest and largest coordinates.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        framing::bounds(&self.scene.triangles)
    }
}
