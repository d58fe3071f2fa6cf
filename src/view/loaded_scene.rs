//! A loaded scene with its acceleration structure, before it is uploaded to a device; or an empty one in its place.

use std::{
    path::{Path, PathBuf},
    time::Instant,
};

use glam::Vec3;

use crate::{
    accel::Statistics,
    engine::choices::{ChosenAccel, Processor, Request, Workload},
    scene::{self, Scene, SceneError},
    util::progress::Progress,
    world::{FlatScene, World},
};

/// The inputs to the choice of an acceleration structure. They stay the same each time that the scene is read.
#[derive(Clone, Debug)]
pub struct LoadOptions {
    /// What is loaded of the scene's file.
    pub scene: scene::LoadOptions,
    /// The user's choices.
    pub request: Request,
    /// The processor that traces rays.
    pub processor: Processor,
    /// The work that the structure is chosen for.
    pub workload: Workload,
}

/// A scene and its acceleration structure.
pub struct LoadedScene {
    /// The scene's file; none while no file is open.
    pub path: Option<PathBuf>,
    /// The scene with its structure.
    pub world: World,
    /// The structure that was chosen.
    pub accel: ChosenAccel,
    /// The inputs to that choice.
    pub load_options: LoadOptions,
    /// Figures of the structure.
    pub statistics: Statistics,
    /// Time of building the structure, milliseconds.
    pub build_ms: f64,
    /// Minimum and maximum corner of what the scene shows, world space: see [`Scene::shown_bounds`].
    bounds: (Vec3, Vec3),
}

impl LoadedScene {
    /// Reads the scene and builds its acceleration structure.
    ///
    /// # Errors
    /// The scene cannot be loaded.
    pub fn load(path: &Path, load_options: &LoadOptions) -> Result<Self, SceneError> {
        let scene = Scene::load_with(path, &load_options.scene)?;
        Ok(Self::with_tree(path, scene, load_options, &Progress::default()))
    }

    /// Builds a scene's acceleration structure, a kd-tree or a grid, and reports its progress.
    ///
    /// # Panics
    /// The scene has a triangle without a material, which no loaded scene has.
    pub fn with_tree(path: &Path, scene: Scene, load_options: &LoadOptions, progress: &Progress) -> Self {
        let &LoadOptions { request, processor, workload, .. } = load_options;
        let accel = request.choose_accel(processor, scene.n_triangles(), &workload);
        let bounds = scene.shown_bounds();
        let flat = FlatScene::new(&scene).expect("a loaded scene fits together");
        // The unflattened scene is freed here, because building the structure needs the memory.
        drop(scene);
        let start = Instant::now();
        let world = World::with_accel_observed(flat, &accel.options(processor), progress);
        let world = world.expect("a material for each triangle");
        let build_ms = start.elapsed().as_secs_f64() * 1e3;
        let statistics = world.statistics();
        let path = Some(path.to_owned());
        Self { path, world, accel, load_options: load_options.clone(), statistics, build_ms, bounds }
    }

    /// Returns a scene without triangles. It takes the place of a loaded scene while no file is open.
    pub fn none(load_options: &LoadOptions) -> Self {
        let empty = Scene { background: Vec3::splat(0.02), ..Scene::empty(Path::new("")) };
        let flat = FlatScene::new(&empty).expect("an empty scene fits together");
        let &LoadOptions { request, processor, workload, .. } = load_options;
        let accel = request.choose_accel(processor, 0, &workload);
        let world = World::with_accel(flat, &accel.options(processor)).expect("a material for each of no triangles");
        let (statistics, bounds) = (world.statistics(), empty.shown_bounds());
        Self { path: None, world, accel, load_options: load_options.clone(), statistics, build_ms: 0.0, bounds }
    }

    /// Returns whether a file is open.
    pub fn is_open(&self) -> bool {
        self.path.is_some()
    }

    /// Returns the scene.
    pub fn scene(&self) -> &FlatScene {
        self.world.scene()
    }

    /// Returns the minimum and the maximum corner of what the scene shows, world space.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        self.bounds
    }
}
