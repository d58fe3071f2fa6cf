//! A scene with all that is made from it before there is a device.

use std::{
    path::{Path, PathBuf},
    time::Instant,
};

use glam::Vec3;

use crate::{
    accel::Statistics,
    engine::choices::{ChosenAccel, Processor, Request, Workload},
    scene::{Scene, SceneError},
    world::{FlatScene, World},
};

/// What the choice of a scene's tree depends on, each time that the scene is read.
#[derive(Clone, Copy, Debug)]
pub struct LoadOptions {
    pub request: Request,
    pub processor: Processor,
    pub workload: Workload,
}

/// A scene and its tree.
pub struct Loaded {
    pub path: PathBuf,
    pub world: World,
    pub accel: ChosenAccel,
    pub load_options: LoadOptions,
    pub statistics: Statistics,
    pub build_ms: f64,
}

impl Loaded {
    /// Reads the scene and builds its tree.
    ///
    /// # Errors
    /// The scene cannot be loaded.
    pub fn load(path: &Path, load_options: LoadOptions) -> Result<Self, SceneError> {
        Ok(Self::with_tree(path, Scene::load(path)?, load_options))
    }

    /// Builds a scene's tree.
    ///
    /// # Panics
    /// The scene has a triangle without a material, which no loaded scene has.
    pub fn with_tree(path: &Path, scene: Scene, load_options: LoadOptions) -> Self {
        let LoadOptions { request, processor, workload } = load_options;
        let accel = request.choose_accel(processor, scene.n_triangles(), &workload);
        let flat = FlatScene::new(&scene).expect("a loaded scene fits together");
        // The structure needs the memory.
        drop(scene);
        let start = Instant::now();
        let world = World::with_accel(flat, &accel.options(processor)).expect("a material for each triangle");
        let build_ms = start.elapsed().as_secs_f64() * 1e3;
        let statistics = world.statistics();
        Self { path: path.to_owned(), world, accel, load_options, statistics, build_ms }
    }

    /// The scene.
    pub fn scene(&self) -> &FlatScene {
        self.world.scene()
    }

    /// Smallest and largest coordinates.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        self.scene().bounds()
    }
}
