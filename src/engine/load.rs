//! The one way into the library: a file, a scene or a mesh becomes a world that is ready to be rendered or cast into.
//!
//! ```text
//! Source ─> Opened ─────────────> Loaded
//!           scene, options        world with its structure, options with exposure
//!           (read, checked)       (structure chosen, memory checked, built, metered)
//! ```
//!
//! [`Engine::load`] goes all the way. A command that has more to check before the long work looks at [`Opened`] first.

use std::{
    path::{Path, PathBuf},
    time::Instant,
};

use glam::Vec3;

use super::{
    Engine,
    choices::{ChosenAccel, Methods, Processor, Request, Workload},
    first_view,
};
use crate::{
    accel::{Accel, bottom_level::BottomLevel},
    cpu::metered_exposure,
    frame::RenderOptions,
    gpu::GpuError,
    scene::{Camera, LoadOptions, Mesh, PictureChoices, Scene, SceneError, Up},
    util::{memory::OutOfMemory, progress::Progress},
    world::{FlatScene, Mismatch, World, instances::Instancing},
};

/// What is loaded.
#[derive(Clone, Debug)]
pub enum Source {
    /// A scene file, a glTF file, a mesh file or a pack, as [`Scene::load`] reads them.
    #[cfg(feature = "files")]
    File(PathBuf),
    /// A scene that a program has described.
    Scene(Box<Scene>),
    /// Triangles without a scene. They get a camera and lights as a mesh file does.
    Mesh(Box<Mesh>),
}

#[cfg(feature = "files")]
impl<P: AsRef<Path> + ?Sized> From<&P> for Source {
    fn from(path: &P) -> Self {
        Self::File(path.as_ref().to_owned())
    }
}

impl From<Scene> for Source {
    fn from(scene: Scene) -> Self {
        Self::Scene(Box::new(scene))
    }
}

impl From<Mesh> for Source {
    fn from(mesh: Mesh) -> Self {
        Self::Mesh(Box::new(mesh))
    }
}

/// What is loaded of a source, and for which work.
#[derive(Clone, Debug)]
pub struct LoadRequest {
    /// The part of the scene's file that is loaded, and what replaces parts of the scene.
    pub scene: LoadOptions,
    /// What replaces the scene's own options of pictures. `None` where no picture is made: then nothing warns of
    /// missing light, and no exposure is metered.
    pub picture: Option<PictureChoices>,
    /// The work for which [`Engine::load`] chooses the structure.
    pub work: Work,
}

impl Default for LoadRequest {
    fn default() -> Self {
        Self::pictures(PictureChoices::default())
    }
}

impl LoadRequest {
    /// Asks for one picture of the scene's own camera. The scene is moved to the origin if it is far away
    /// ([`LoadOptions::recentre`]).
    pub fn pictures(choices: PictureChoices) -> Self {
        let scene = LoadOptions { recentre: true, ..LoadOptions::default() };
        Self { scene, picture: Some(choices), work: Work::picture() }
    }

    /// Asks for `n_rays` rays in the coordinates of the file.
    pub fn rays(n_rays: u64) -> Self {
        Self { scene: LoadOptions::default(), picture: None, work: Work::Rays(n_rays) }
    }
}

/// The work of a run. The choice of the structure depends on it.
#[derive(Clone, Debug, PartialEq)]
pub enum Work {
    /// Pictures of the scene.
    Pictures {
        /// One camera per picture; the scene's own camera if there are none.
        cameras: Vec<Camera>,
        /// Samples per pixel of each picture.
        n_samples: u32,
        /// Number of pictures that are in memory at the same time.
        n_at_once: u32,
    },
    /// A window, whose cameras have no bound.
    Window {
        /// Number of samples per pixel in all; `None` if that has no bound.
        n_samples: Option<u64>,
    },
    /// This number of rays, without a picture.
    Rays(u64),
}

impl Work {
    /// One picture of one sample per pixel, from the scene's own camera.
    pub fn picture() -> Self {
        Self::Pictures { cameras: Vec::new(), n_samples: 1, n_at_once: 1 }
    }

    /// Returns the estimate on which choices depend.
    fn workload(&self, scene: &Scene, options: &RenderOptions) -> Workload {
        let of_pictures = |n: u64| Workload::of_pictures(options, scene.lights.len(), n);
        match self {
            Self::Pictures { cameras, n_samples, .. } if cameras.is_empty() => {
                of_pictures((*n_samples).into()).with_cameras([&scene.camera].into_iter())
            }
            Self::Pictures { cameras, n_samples, .. } => {
                of_pictures(u64::from(*n_samples) * cameras.len() as u64).with_cameras(cameras.iter())
            }
            Self::Window { n_samples: Some(n_samples) } => of_pictures(*n_samples),
            Self::Window { n_samples: None } => Workload::of_window((options.width, options.height)),
            Self::Rays(n_rays) => Workload::of_rays(*n_rays),
        }
    }
}

/// A scene that was read, before its structure is built.
#[derive(Clone, Debug)]
pub struct Opened {
    /// The scene.
    pub scene: Scene,
    /// The options of its pictures: the user's, and the scene's own where the user has set none. The exposure is
    /// metered later.
    pub options: RenderOptions,
    /// What was assumed about the file, one line each.
    pub notes: Vec<String>,
    /// Time of reading, milliseconds.
    pub load_ms: f64,
    /// Whether the exposure is metered.
    is_metered: bool,
}

impl Opened {
    /// Reads a source. Emits the warnings of [`Scene::load`] and, where a picture is made, of missing light.
    ///
    /// # Errors
    /// The source cannot be read or understood, shows nothing, or needs more memory than there is.
    pub fn read(source: impl Into<Source>, request: &LoadRequest) -> Result<Self, SceneError> {
        let begin = Instant::now();
        let LoadRequest { scene: options, picture, work: _ } = request;
        let aspect = options.aspect.or_else(|| Some(picture.as_ref()?.size?).map(|(w, h)| w as f32 / h as f32));
        let integrator = options.integrator.or_else(|| picture.as_ref()?.integrator);
        let options = LoadOptions { aspect, integrator, ..options.clone() };
        let (scene, file): (Scene, Option<PathBuf>) = match source.into() {
            #[cfg(feature = "files")]
            Source::File(path) => (Scene::load_with(&path, &options)?, Some(path)),
            Source::Scene(scene) => (*scene, None),
            Source::Mesh(mesh) => (Scene::of_mesh(*mesh, &options)?, None),
        };
        let mut notes = Vec::new();
        let render_options = scene.defaults.with(&picture.clone().unwrap_or_default());
        if let (Some(path), true) = (&file, picture.is_some()) {
            scene.warn_of_missing_light(path, render_options.integrator);
            notes.extend(note_of_up(path, &scene, options.look.up));
        }
        let is_metered = scene.defaults.is_metered && picture.as_ref().is_some_and(|it| it.exposure.is_none());
        let load_ms = begin.elapsed().as_secs_f64() * 1e3;
        Ok(Self { scene, options: render_options, notes, load_ms, is_metered })
    }

    /// Returns the request for frames of so many samples, if the scene moves: see [`Request::for_motion`].
    pub fn for_motion(&self, asked: Request, processor: Processor, n_samples: u32) -> (Request, Option<String>) {
        let n_lights = self.scene.lights.len();
        let frame = Workload::of_pictures(&self.options, n_lights, n_samples.into());
        asked.for_motion(processor, &self.scene, &frame)
    }
}

/// Returns a note that says which axis of an STL file points up, if the user has not stated it.
fn note_of_up(path: &Path, scene: &Scene, stated: Option<Up>) -> Option<String> {
    let is_stl = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("stl"));
    let is_assumed = is_stl && stated.is_none() && scene.camera.up == Up::Z.vector();
    is_assumed.then(|| "+z points up, as in most STL files; --up y turns the picture".to_owned())
}

/// Returns a note that says which meshes are stored once, if the user has left that open.
fn note_of_instances(scene: &FlatScene, instancing: Instancing) -> Option<String> {
    let instances = scene.instances.as_ref().filter(|_| instancing == Instancing::Auto)?;
    Some(format!(
        "{} meshes of {} triangles are kept as {} instances, {} triangles in all; --instances flatten stores all of \
         them",
        instances.ranges.len(),
        scene.triangles.len(),
        instances.list.len(),
        scene.n_triangles()
    ))
}

/// A world with its acceleration structure, ready to be rendered or cast into.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The scene with its structure.
    pub world: World,
    /// The options of its pictures, with the metered exposure. [`Engine::load`] has chosen their methods, too.
    pub options: RenderOptions,
    /// The structure, and for a kd-tree why it was chosen.
    pub accel: ChosenAccel,
    /// The work that it was chosen for.
    pub workload: Workload,
    /// Minimum and maximum corner of what the scene shows, world space: see [`Scene::shown_bounds`].
    pub bounds: (Vec3, Vec3),
    /// What was assumed and metered, one line each.
    pub notes: Vec<String>,
    /// Time of reading, milliseconds.
    pub load_ms: f64,
    /// Time of building the structure, milliseconds.
    pub build_ms: f64,
}

/// Builds structures for a processor, which need not be open yet.
#[derive(Clone, Debug)]
pub struct Builder {
    /// The processor that will trace rays.
    pub processor: Processor,
    /// The user's choices.
    pub request: Request,
    /// Who is told of the progress of kd-trees.
    pub progress: Progress,
}

impl Builder {
    /// A builder that reports no progress.
    pub fn new(processor: Processor, request: Request) -> Self {
        Self { processor, request, progress: Progress::default() }
    }

    /// Chooses the structure for the work, checks that structure and pictures fit in memory, builds on the current
    /// rayon pool, and meters the exposure if the scene's light has physical units and the user has set no exposure.
    ///
    /// # Errors
    /// The scene does not fit together, or the host has too little memory.
    pub fn build(&self, opened: Opened, work: &Work) -> Result<Loaded, LoadError> {
        let Opened { scene, mut options, mut notes, load_ms, is_metered } = opened;
        if let Work::Pictures { n_samples, n_at_once, .. } = *work {
            self.require_for_pictures(&options, n_samples, n_at_once)?;
        }
        let keeps_instances = self.request.instances.keeps(&scene);
        let workload = work.workload(&scene, &options);
        let accel = self.request.choose_accel(self.processor, scene.n_triangles(), (&workload, keeps_instances));
        self.require_for_build(accel, &scene)?;
        let flat = if keeps_instances { FlatScene::with_instances(&scene)? } else { FlatScene::new(&scene)? };
        notes.extend(note_of_instances(&flat, self.request.instances));
        let bounds = scene.shown_bounds();
        // The memory of the scene is freed for the build of the structure.
        drop(scene);
        let begin = Instant::now();
        let world = World::with_accel_observed(flat, &accel.options(self.processor), &self.progress)?;
        let build_ms = begin.elapsed().as_secs_f64() * 1e3;
        // A structure that devices build is not built here, too, for some warnings.
        let is_built = match world.accel() {
            Accel::KdTree(_) => true,
            Accel::TwoLevel(two) => two.structures().iter().all(|it| matches!(**it, BottomLevel::KdTree(_))),
            Accel::LazyTree(_) | Accel::Grid(_) => false,
        };
        if let (Work::Pictures { .. }, true) = (work, is_built) {
            first_view::warn(&world, &options);
        }
        if is_metered {
            options.exposure = metered_exposure(&world);
            notes.push(format!("exposure {0}, measured in the first view; --exposure {0} pins it", options.exposure));
        }
        Ok(Loaded { world, options, accel, workload, bounds, notes, load_ms, build_ms })
    }
}

impl Engine {
    /// Loads a file, a scene or a mesh: reads it, chooses and builds its structure, meters its exposure, and chooses
    /// the traversal and the primary visibility. The notes of the result are meant for people.
    ///
    /// # Errors
    /// The source cannot be read or does not fit together, the host has too little memory, or the device is lost.
    pub fn load(&self, source: impl Into<Source>, request: &LoadRequest) -> Result<Loaded, LoadError> {
        let (mut loaded, methods) = self.build(Opened::read(source, request)?, &request.work)?;
        loaded.options = methods.apply(&loaded.options);
        Ok(loaded)
    }

    /// Does what [`Engine::load`] does after reading. Returns the chosen methods, which the options do not have yet.
    ///
    /// # Errors
    /// Fails as [`Builder::build`] does, or if the device is lost.
    pub fn build(&self, opened: Opened, work: &Work) -> Result<(Loaded, Methods), LoadError> {
        let loaded = self.builder().build(opened, work)?;
        let methods = self.methods(&loaded.world, &loaded.workload)?;
        Ok((loaded, methods))
    }

    /// Returns a builder for the engine's processor.
    pub fn builder(&self) -> Builder {
        Builder { processor: self.processor(), request: self.request, progress: self.progress.clone() }
    }
}

/// The reason why something cannot be loaded. It displays as one line.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The source cannot be read or understood.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The scene's parts do not fit together.
    #[error(transparent)]
    Mismatch(#[from] Mismatch),
    /// The host has too little memory.
    #[error(transparent)]
    Memory(#[from] OutOfMemory),
    /// The device is lost.
    #[error(transparent)]
    Device(#[from] GpuError),
}
