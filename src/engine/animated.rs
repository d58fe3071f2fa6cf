//! The worlds of a file whose animations play: one for each moment, of which each shares with the one before what has
//! not changed.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::Arc,
    time::{Duration, Instant},
};

use glam::DVec3;
use serde::Serialize;
use tracing::dispatcher::{Dispatch, with_default};

use super::load::{LoadError, LoadRequest, Opened};
use crate::{
    scene::{
        AnimationChoice, Camera, Instance, Light, LoadOptions, Poser, Scene,
        deformation::{ChangedMeshes, PosedMesh},
    },
    world::{FlatScene, InstanceUpdate, World},
};

/// A file whose animations play.
///
/// What is guessed is guessed at the first moment: camera and lights of a file without any, exposure, and the way of
/// storing meshes. A glTF file is read once; of other files that name glTF files, all is read at each moment.
///
/// A world that keeps instances shares with the next one all but what moves. Where only instances move, no tree is
/// built but the one over them ([`World::with_instances_changed`]); where meshes are deformed, theirs. A flattened
/// world is built as a whole.
pub struct AnimatedWorld {
    path: PathBuf,
    request: LoadRequest,
    /// Poses the scene; none if its file must be read again at each moment.
    poser: Option<Poser>,
    /// The scene at the last moment that the poser has shown, or else at the first one.
    scene: Scene,
    /// The poses of the scene's meshes whose arrays are still those of an earlier moment, by index.
    poses: BTreeMap<usize, Arc<PosedMesh>>,
    /// The world of the scene.
    world: World,
    /// The meshes of the scene that differ from the world's: the last moment had no world.
    deformed: ChangedMeshes,
    work: MomentWork,
}

/// What the world of a moment took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct MomentWork {
    /// Time of placing what moves and of deforming meshes, or of reading the file if it is read again, milliseconds.
    pub pose_ms: f64,
    /// Time of building what rays search, and whatever else the new world does not share, milliseconds.
    pub build_ms: f64,
    /// The number of instances that have moved since the world before. The tree over the instances is built for them.
    pub n_moved: usize,
    /// The number of meshes whose vertices have changed since then, of which each needs a new tree or grid. If the file
    /// is read again and has other meshes, all of them count.
    pub n_deformed: usize,
}

impl AnimatedWorld {
    /// Joins a file, the scene that was read of it at some moment, and the world of the scene. `request`: that of the
    /// reading.
    pub fn new(path: &Path, request: &LoadRequest, scene: Scene, world: &World) -> Self {
        let poser = with_default(&Dispatch::none(), || Poser::new(path, &request.scene, &scene));
        let (path, request, world) = (path.to_owned(), request.clone(), world.clone());
        let (poses, deformed, work) = Default::default();
        Self { path, request, poser, scene, poses, world, deformed, work }
    }

    /// Chooses the animations that further moments show.
    pub fn set_animation(&mut self, animation: AnimationChoice) {
        self.poser = self.poser.take().and_then(|poser| poser.with_animation(animation.clone()));
        self.request.scene.animation = animation;
    }

    /// Returns what the last moment that had a world took.
    pub fn work(&self) -> MomentWork {
        self.work
    }

    /// Returns the world at another moment, seconds, and its camera. A warning tells of things that cannot be shown
    /// then.
    ///
    /// # Errors
    /// The file cannot be read any more, or shows nothing at this moment.
    pub fn at(&mut self, seconds: f64) -> Result<(World, Camera), LoadError> {
        let begin = Instant::now();
        let before = (self.scene.instances.clone(), self.scene.lights.clone());
        // Its warnings are those of the first moment.
        let pose = |poser: &mut Poser| with_default(&Dispatch::none(), || poser.pose(seconds, &mut self.scene));
        let deformed = match self.poser.as_mut().map(pose).transpose() {
            Ok(deformed) => deformed.flatten(),
            Err(error) => {
                (self.scene.instances, self.scene.lights) = before;
                return Err(error.into());
            }
        };
        let Some(deformed) = deformed else { return self.read_again(seconds) };
        let posed = Instant::now();
        for (mesh_ix, pose) in deformed {
            match pose.clone() {
                Some(pose) => drop(self.poses.insert(mesh_ix, pose)),
                None => drop(self.poses.remove(&mesh_ix)),
            }
            self.deformed.insert(mesh_ix, pose);
        }
        let posed_world = self.posed(&self.scene, &before).transpose();
        match posed_world.unwrap_or_else(|| self.built_of_own()) {
            Ok(world) => {
                self.world = world.clone();
                self.work = MomentWork::of([begin, posed], (&self.scene, &before.0), self.deformed.len());
                self.deformed.clear();
                Ok((world, self.scene.camera))
            }
            Err(error) => {
                (self.scene.instances, self.scene.lights) = before;
                Err(error)
            }
        }
    }

    /// Returns the world of a scene that has been posed, unless it must be built. `before`: the instances and lights of
    /// this one's world.
    fn posed(&self, scene: &Scene, before: &(Vec<Instance>, Vec<Light>)) -> Result<Option<World>, LoadError> {
        let (instances, lights) = before;
        if self.deformed.is_empty() && scene.lights == *lights && self.world.scene().instances.is_some() {
            let changed = |(instance_ix, (now, before)): (usize, (&Instance, &Instance))| {
                let update = || {
                    let transform = Some(now.transform.clone());
                    InstanceUpdate { instance_ix, transform, ..InstanceUpdate::default() }
                };
                (now.transform != before.transform).then(update)
            };
            let updates: Vec<_> = scene.instances.iter().zip(instances).enumerate().filter_map(changed).collect();
            // An update may be refused, such as a transform that magnifies rounding, by which a new world places
            // triangles.
            if let Ok(world) = self.world.with_instances_changed(&updates) {
                return Ok(Some(world));
            }
        }
        Ok(self.world.posed(scene, &self.deformed)?)
    }

    /// Gives all meshes of the scene their arrays.
    fn deform(&mut self) {
        let poses = std::mem::take(&mut self.poses);
        poses.into_iter().for_each(|(mesh_ix, pose)| pose.deform(&mut self.scene.meshes[mesh_ix]));
    }

    fn built_of_own(&mut self) -> Result<World, LoadError> {
        self.deform();
        self.built(&self.scene)
    }

    /// Reads the file again at a moment. What is shown at the next moment does not depend on it.
    fn read_again(&mut self, seconds: f64) -> Result<(World, Camera), LoadError> {
        let begin = Instant::now();
        self.deform();
        let scene = LoadOptions { at: Some(seconds), ..self.request.scene.clone() };
        let request = LoadRequest { scene, ..self.request.clone() };
        let read = || Opened::read(&self.path, &request);
        let mut scene = with_default(&Dispatch::none(), read)?.scene;
        if scene.instances.len() < self.scene.instances.len() {
            let n_missing = self.scene.instances.len() - scene.instances.len();
            tracing::warn!("{}: at {seconds} s, {n_missing} meshes cannot be shown", self.path.display());
        }
        self.keep_guesses(&mut scene);
        let posed = Instant::now();
        let is_same = self.deformed.is_empty()
            && scene.materials == self.scene.materials
            && scene.meshes == self.scene.meshes
            && scene.instances.len() == self.scene.instances.len()
            && scene.instances.iter().zip(&self.scene.instances).all(|(now, before)| {
                let before = Instance { transform: now.transform.clone(), ..before.clone() };
                *now == before
            });
        let before = || (self.scene.instances.clone(), self.scene.lights.clone());
        let posed_world = if is_same { self.posed(&scene, &before())? } else { None };
        let world = posed_world.map_or_else(|| self.built(&scene), Ok)?;
        let n_deformed = if is_same { 0 } else { scene.meshes.len() };
        self.work = MomentWork::of([begin, posed], (&scene, &self.scene.instances), n_deformed);
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
        if first.chosen_camera {
            scene.camera = first.camera;
            scene.chosen_camera = true;
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

    fn built(&self, scene: &Scene) -> Result<World, LoadError> {
        let flat = match self.world.scene().instances {
            Some(_) => FlatScene::with_instances(scene)?,
            None => FlatScene::new(scene)?,
        };
        Ok(World::with_accel(flat, self.world.accel_options())?)
    }
}

impl MomentWork {
    /// Returns the work on a moment that is ready now. `begin`, `posed`: when it began, and when what moves had its
    /// place. `before`: the instances of the world before.
    fn of([begin, posed]: [Instant; 2], (scene, before): (&Scene, &[Instance]), n_deformed: usize) -> Self {
        let ms = |time: Duration| time.as_secs_f64() * 1e3;
        let has_moved = |(now, before): &(&Instance, &Instance)| now.transform != before.transform;
        let n_moved = scene.instances.iter().zip(before).filter(has_moved).count();
        Self { pose_ms: ms(posed - begin), build_ms: ms(posed.elapsed()), n_moved, n_deformed }
    }
}
