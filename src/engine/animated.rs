//! The worlds of a file whose animations play: one for each moment, of which each shares with the first what has not
//! changed.

use std::path::{Path, PathBuf};

use glam::DVec3;
use tracing::dispatcher::{Dispatch, with_default};

use super::load::{LoadError, LoadRequest, Opened};
use crate::{
    scene::{Camera, Instance, LoadOptions, Scene},
    world::{FlatScene, InstanceUpdate, World},
};

/// A file whose animations play.
///
/// What is guessed is guessed at the first moment: camera and lights of a file without any, exposure, and the way of
/// storing meshes. Where only instances move, no tree is built but the one over them
/// ([`World::with_instances_changed`]). Otherwise the whole world is built.
pub struct AnimatedWorld {
    path: PathBuf,
    request: LoadRequest,
    /// The scene at the first moment.
    scene: Scene,
    /// Its world.
    world: World,
}

impl AnimatedWorld {
    /// Joins a file, the scene that was read of it at some moment, and the world of the scene. `request`: that of the
    /// reading.
    pub fn new(path: &Path, request: &LoadRequest, scene: Scene, world: &World) -> Self {
        Self { path: path.to_owned(), request: request.clone(), scene, world: world.clone() }
    }

    /// Returns the world at another moment, seconds, and its camera. A warning tells of things that cannot be shown
    /// then.
    ///
    /// # Errors
    /// The file cannot be read any more, or shows nothing at this moment.
    pub fn at(&self, seconds: f64) -> Result<(World, Camera), LoadError> {
        let scene = LoadOptions { at: Some(seconds), ..self.request.scene.clone() };
        let request = LoadRequest { scene, ..self.request.clone() };
        // Its warnings are those of the first moment.
        let read = || Opened::read(&self.path, &request);
        let mut scene = with_default(&Dispatch::none(), read)?.scene;
        if scene.instances.len() < self.scene.instances.len() {
            let n_missing = self.scene.instances.len() - scene.instances.len();
            tracing::warn!("{}: at {seconds} s, {n_missing} meshes cannot be shown", self.path.display());
        }
        self.keep_guesses(&mut scene);
        // An update may be refused, such as a transform that magnifies rounding, by which a new world places triangles.
        let moved = self.updates(&scene).and_then(|updates| self.world.with_instances_changed(&updates).ok());
        let world = moved.map_or_else(|| self.built(&scene), Ok)?;
        Ok((world, scene.camera))
    }

    /// Gives a scene what was guessed at the first moment.
    fn keep_guesses(&self, scene: &mut Scene) {
        let first = &self.scene;
        let shift = scene.origin - first.origin;
        if shift != DVec3::ZERO {
            scene.instances.iter_mut().for_each(|it| it.transform = it.transform.moved(shift));
            scene.origin = first.origin;
        }
        if scene.cameras.is_empty() {
            scene.camera = first.camera;
        }
        if first.chosen_light.is_some() {
            scene.lights.clone_from(&first.lights);
            scene.chosen_light = first.chosen_light;
        }
        (scene.ambient, scene.ground, scene.studio) = (first.ambient, first.ground, first.studio);
        (scene.background, scene.sky) = (first.background, first.sky);
        scene.environment.clone_from(&first.environment);
        scene.defaults = first.defaults;
    }

    /// Returns what has moved, if the world keeps instances and nothing else has changed but camera and lights.
    fn updates(&self, scene: &Scene) -> Option<Vec<InstanceUpdate>> {
        let first = &self.scene;
        let is_same = self.world.scene().instances.is_some()
            && scene.instances.len() == first.instances.len()
            && scene.lights == first.lights
            && scene.materials == first.materials
            && scene.meshes == first.meshes
            && scene.instances.iter().zip(&first.instances).all(|(now, before)| {
                let before = Instance { transform: now.transform.clone(), ..before.clone() };
                *now == before
            });
        let changed = |(instance_ix, (now, before)): (usize, (&Instance, &Instance))| {
            let update = || {
                let transform = Some(now.transform.clone());
                InstanceUpdate { instance_ix, transform, ..InstanceUpdate::default() }
            };
            (now.transform != before.transform).then(update)
        };
        is_same.then(|| scene.instances.iter().zip(&first.instances).enumerate().filter_map(changed).collect())
    }

    fn built(&self, scene: &Scene) -> Result<World, LoadError> {
        let flat = match self.world.scene().instances {
            Some(_) => FlatScene::with_instances(scene)?,
            None => FlatScene::new(scene)?,
        };
        Ok(World::with_accel(flat, self.world.accel_options())?)
    }
}
