//! Scenes as files and programs describe them: meshes, their instances in the world, materials, lights, a camera.
//! Nothing here depends on how kernels lay data out; `world` flattens a scene for tracing.
//!
//! A scene file is a TOML file, whose keys `description` lists, a glTF file, a mesh file, OBJ, PLY or STL, or a pack of
//! any of them with all that it names.

mod assemble;
mod camera;
mod coincident;
mod convert;
mod defaults;
mod description;
mod environment;
mod error;
mod extent;
mod few_rays;
mod files;
mod foreign;
mod framing;
pub mod generate;
mod gltf;
pub(crate) mod ground;
mod image;
mod image_files;
mod interior;
mod lamps;
mod light;
mod lighting;
mod look;
mod map_spec;
mod material;
mod material_spec;
pub mod mesh;
mod mesh_file;
mod near;
mod needs;
mod obj;
mod outside;
mod overrides;
pub(crate) mod pack;
mod path;
mod placed;
mod ply;
mod polygon;
mod preset;
mod read;
mod scan_colours;
mod sky;
mod smooth;
mod sources;
mod standard;
mod stl;
mod tangents;
mod terms;
mod texture;
mod transform;
mod up;

use std::path::Path;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

pub use self::{
    camera::{Camera, Projection},
    convert::scene_file_of,
    defaults::{DenoiseChoice, PathDefaults, PictureChoices, RenderDefaults},
    environment::{Environment, MendedTexels},
    error::SceneError,
    extent::MIN_EXTENT,
    light::{Ground, Light},
    look::{LightChoice, Look, SkyChoice, Up},
    material::{Alpha, Clearcoat, Conductor, Lobes, Maps, Material, Microfacet, Sheen},
    mesh::Mesh,
    pack::{ENDING as PACK_ENDING, pack_hash, packed_path},
    path::CameraPath,
    preset::{MaterialChoice, Preset},
    sky::Sky,
    sources::{source_files, source_files_with},
    standard::ChosenLight,
    terms::{Term, TermValue},
    texture::{Channel, Encoding, Image, Pixels, Texture, Wrap},
    transform::Transform,
};
use self::{
    extent::MeshOrigin,
    image_files::Images,
    mesh_file::{Loaded, Loading, MeshFormat},
    outside::Access,
    smooth::Shading,
    standard::Lacks,
};
use crate::util::progress::Progress;

/// Everything that a frame shows. World space is right-handed, +y up by default.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// The file's name without its folder and extension.
    pub name: String,
    /// The point of the file that is the origin of world space, in the file's coordinates. It is 0, unless the scene
    /// was moved there ([`LoadOptions::recentre`]).
    pub origin: DVec3,
    /// Meshes, each of which may have several instances.
    pub meshes: Vec<Mesh>,
    /// Placed meshes. A loaded scene has at least one triangle, all triangles lie within `mesh::MAX_COORDINATE`, and
    /// their bounding box has a side of [`MIN_EXTENT`] or more.
    pub instances: Vec<Instance>,
    /// Materials, to which the instances refer by index.
    pub materials: Vec<Material>,
    /// Images, to which the materials' textures refer by index.
    pub images: Vec<Image>,
    /// Lights, possibly none.
    pub lights: Vec<Light>,
    /// Which lights were chosen, if the file has none and the user has not chosen any.
    pub chosen_light: Option<ChosenLight>,
    /// The image of what is seen beyond the scene; without one, that is `background`. Only the path tracer knows it.
    pub environment: Option<Environment>,
    /// The sky and its sun. Paths: replaces `environment`. Whitted: only the sun is used.
    pub sky: Option<Sky>,
    /// Horizontal unit vector to the viewer of the built-in studio environment (a bright ceiling and three soft boxes),
    /// which reflections see and camera rays do not; `None` for no studio.
    pub studio: Option<Vec3>,
    /// The camera that renders the scene unless another one is set.
    pub camera: Camera,
    /// The cameras of the scene's file with their names, possibly none.
    pub cameras: Vec<(String, Camera)>,
    /// Irradiance that every point receives, linear RGB. The material's `ka` weights it. If there is a `ground`, this
    /// is the irradiance of surfaces that face up.
    pub ambient: Vec3,
    /// The ambient light from below, if it is not that of all sides.
    pub ground: Option<Ground>,
    /// Radiance of rays that leave the scene, linear RGB.
    pub background: Vec3,
    /// The options that the scene is rendered with unless others are set.
    pub defaults: RenderDefaults,
}

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
    /// is that of [`Scene::defaults`].
    pub aspect: Option<f32>,
    /// Whether a scene is moved to the origin if its coordinates are so large that single precision loses details.
    /// [`Scene::origin`] says by how much. Cameras and lights of the file and of `look` are moved with it.
    pub recentre: bool,
    /// What replaces parts of the scene.
    pub look: Look,
    /// Who is told of the progress: of mesh files that are read, and of images that are decoded.
    pub progress: Progress,
}

/// A mesh that is placed in the world.
#[derive(Clone, Debug, PartialEq)]
pub struct Instance {
    /// Index into the scene's meshes.
    pub mesh_ix: usize,
    /// Transform from object space to world space.
    pub transform: Transform,
    /// Indices into the scene's materials, at least one. A face of slot i has the material at index
    /// `i % materials.len()` of this list.
    pub materials: Vec<u32>,
}

impl Scene {
    /// Loads a scene file, `.toml`, a glTF file, `.gltf` or `.glb`, a mesh file, `.obj`, `.ply` or `.stl`, or a pack,
    /// `.kdpack`. The content of a glTF or mesh file says which of the four it is. Emits `tracing` warnings for unknown
    /// OBJ statements, material libraries and images that are missing or leave the folder of the mesh file, undefined
    /// materials, names in the wrong case, normals that an OBJ file names and does not have, terms of MTL files that
    /// are not taken as they are, what is not shown of a file, creases and overrides without effect, and coordinates
    /// too large for the scene's detail.
    ///
    /// # Errors
    /// The file, or one that it names, cannot be read or understood; the scene has no triangles, is too small to be
    /// traced ([`MIN_EXTENT`]), reaches too far from the origin (`mesh::MAX_COORDINATE`), or needs more memory than
    /// there is.
    pub fn load(path: &Path) -> Result<Scene, SceneError> {
        Self::load_with(path, &LoadOptions::default())
    }

    /// Loads a scene as [`Scene::load`] does, with options.
    ///
    /// # Errors
    /// Those of [`Scene::load`]; the file does not have the scene or the camera that `options` names, or its camera
    /// with the changes of `options` shows nothing.
    pub fn load_with(path: &Path, options: &LoadOptions) -> Result<Scene, SceneError> {
        // A pack stays open until all of its files are read.
        let pack = pack::opened(path)?;
        let scene = match pack::scene_of(path, options)? {
            Some(packed) => Self::load_file(&packed.path, &packed.options),
            None => Self::load_file(path, options),
        };
        pack.map_or(Ok(()), |pack| pack.check())?;
        scene
    }

    /// Makes a scene of the text of a scene file that names no other files. `name` is the name that the file would
    /// have.
    ///
    /// # Errors
    /// Those of [`Scene::load`].
    pub fn of_text(name: &str, text: &str) -> Result<Scene, SceneError> {
        let (path, options) = (Path::new(name), LoadOptions::default());
        let (mut scene, lacks) = assemble::parse_toml(path, text, &options)?;
        standard::fill_in(path, &mut scene, lacks, &options).map_err(|what| SceneError::file(path, what))?;
        Ok(scene)
    }

    /// Makes a scene of a mesh, which gets a default material for each slot, a camera and lights, as the mesh of a file
    /// does.
    ///
    /// # Errors
    /// The mesh's arrays do not fit together; it has no triangles, is too small to be traced, or reaches too far.
    pub fn of_mesh(mesh: Mesh, options: &LoadOptions) -> Result<Scene, SceneError> {
        let name = if mesh.name.is_empty() { "mesh".to_owned() } else { mesh.name.clone() };
        let path = Path::new(&name);
        mesh.check().map_err(|what| SceneError::file(path, format!("it {what}")))?;
        if mesh.faces.is_empty() {
            return Err(SceneError::file(path, "has no triangles"));
        }
        let lacks = Lacks::all(options.look.up.unwrap_or_default());
        let (mut scene, lacks) = Self::of_bare_mesh(path, Scene::empty(path), (mesh, Vec::new()), lacks)?;
        preset::replace(&mut scene, &options.look.materials).map_err(|what| SceneError::file(path, what))?;
        standard::fill_in(path, &mut scene, lacks, options).map_err(|what| SceneError::file(path, what))?;
        Ok(scene)
    }

    /// Places a mesh with its own materials in an empty scene, which lacks everything else.
    fn of_bare_mesh(
        path: &Path,
        mut scene: Scene,
        (mesh, materials): (Mesh, Vec<Material>),
        lacks: Lacks,
    ) -> Result<(Scene, Lacks), SceneError> {
        let slots = scene.push_materials(materials);
        scene.push_mesh(mesh, Transform::IDENTITY, slots).map_err(|what| SceneError::file(path, what))?;
        extent::check(path, scene.bounds())?;
        scene.defaults.samples = standard::SAMPLES;
        Ok((scene, lacks))
    }

    /// Loads a scene from a file that is no pack.
    fn load_file(path: &Path, options: &LoadOptions) -> Result<Scene, SceneError> {
        let (mut scene, lacks) = if is_scene_file(path) {
            check_only_scene(path, options)?;
            assemble::load_toml(path, options)?
        } else if MeshFormat::of_name(path).is_some() {
            load_mesh_file(path, options)?
        } else {
            let head = files::head(path, HEAD_BYTES).unwrap_or_else(|_| b" ".to_vec());
            if !mesh_file::is_certain(&head) {
                return Err(SceneError::file(path, foreign::of_other_name(path, &head)));
            }
            load_mesh_file(path, options)?
        };
        preset::replace(&mut scene, &options.look.materials).map_err(|what| SceneError::file(path, what))?;
        scene.add_tangents().map_err(|what| SceneError::file(path, what))?;
        if let Some(name) = &options.camera {
            scene.choose_camera(name).map_err(|what| SceneError::file(path, what))?;
        }
        standard::fill_in(path, &mut scene, lacks, options).map_err(|what| SceneError::file(path, what))?;
        Ok(scene)
    }

    /// Makes one of [`Scene::cameras`] the scene's camera: the first one of this name, or else the one of this index.
    fn choose_camera(&mut self, name: &str) -> Result<(), String> {
        let named = self.cameras.iter().find(|(other, _)| other == name);
        let found = named.or_else(|| self.cameras.get(name.parse::<usize>().ok()?));
        let Some((_, camera)) = found else {
            let cameras = self.cameras.iter().enumerate().map(|(ix, (name, _))| format!("{ix} `{name}`"));
            let cameras = cameras.collect::<Vec<_>>().join(", ");
            return Err(match cameras.is_empty() {
                true => format!("there is no camera `{name}`: the file names no cameras"),
                false => format!("there is no camera `{name}`, but {cameras}"),
            });
        };
        self.camera = *camera;
        Ok(())
    }

    /// Returns the name of the scene in a file: the file's name without its folder and extension.
    pub fn name_of(path: &Path) -> String {
        path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default()
    }

    /// Returns the number of triangles of all instances.
    pub fn n_triangles(&self) -> usize {
        let mesh_of = |instance: &Instance| self.meshes.get(instance.mesh_ix);
        self.instances.iter().filter_map(mesh_of).map(|mesh| mesh.faces.len()).sum()
    }

    /// Returns the smallest and the largest coordinates of all triangles, world space.
    ///
    /// # Panics
    /// An index of a mesh or of a position is out of range.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        self.bounds_of(&self.instances)
    }

    /// Returns the bounds of some instances.
    pub(super) fn bounds_of(&self, instances: &[Instance]) -> (Vec3, Vec3) {
        // Instances share the list of their mesh's corners, in which each point is once.
        let corners: Vec<Vec<Vec3>> = self.meshes.par_iter().map(Mesh::corners).collect();
        let none = || (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let joined = |a: (Vec3, Vec3), b: (Vec3, Vec3)| (a.0.min(b.0), a.1.max(b.1));
        let of_instance = |Instance { mesh_ix, transform, .. }: &Instance| {
            let world = corners[*mesh_ix].par_iter().map(|p| transform.point(*p));
            world.map(|p| (p, p)).reduce(none, joined)
        };
        instances.par_iter().map(of_instance).reduce(none, joined)
    }

    /// Adds a mesh and one instance of it. `materials` becomes [`Instance::materials`].
    ///
    /// # Errors
    /// The mesh reaches beyond `mesh::MAX_COORDINATE` in world space. The error is a message for people.
    pub(crate) fn push_mesh(&mut self, mesh: Mesh, transform: Transform, materials: Vec<u32>) -> Result<(), String> {
        mesh.placed(&transform)?;
        self.instances.push(Instance { mesh_ix: self.meshes.len(), transform, materials });
        self.meshes.push(mesh);
        Ok(())
    }

    /// A scene without meshes, materials and lights. Its camera is a placeholder.
    pub(crate) fn empty(path: &Path) -> Self {
        Self {
            name: Self::name_of(path),
            origin: DVec3::ZERO,
            meshes: Vec::new(),
            instances: Vec::new(),
            materials: Vec::new(),
            images: Vec::new(),
            lights: Vec::new(),
            chosen_light: None,
            camera: Camera {
                eye: Vec3::ZERO,
                target: Vec3::NEG_Z,
                up: Vec3::Y,
                projection: Projection::Perspective { vertical_fov_degrees: 45.0 },
            },
            cameras: Vec::new(),
            ambient: Vec3::ZERO,
            ground: None,
            background: Vec3::ZERO,
            environment: None,
            sky: None,
            studio: None,
            defaults: RenderDefaults::default(),
        }
    }
}

/// Number of bytes at the beginning of a file that tell what it is.
const HEAD_BYTES: usize = 1024;

/// Returns whether a file's name is that of a scene file in TOML.
fn is_scene_file(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml"))
}

/// Loads a mesh file as a scene: the mesh with its own materials. Only a glTF file may have lights and cameras.
fn load_mesh_file(path: &Path, options: &LoadOptions) -> Result<(Scene, Lacks), SceneError> {
    let bytes = mesh_file::read_mesh(path)?;
    if MeshFormat::of(path, &bytes) == MeshFormat::Gltf {
        return gltf::load(path, bytes, options);
    }
    check_only_scene(path, options)?;
    let mut scene = Scene::empty(path);
    let mut images = Images::new(options.look.materials.clone(), &options.progress);
    let access = Access::of(options);
    let origin = if options.recentre { MeshOrigin::Near } else { MeshOrigin::At(DVec3::ZERO) };
    let mut loading = Loading { shading: Shading::default(), origin, n_loaded: 0, access, images: &mut images };
    let (format, head) = (MeshFormat::of(path, &bytes), bytes[..bytes.len().min(up::HEAD_BYTES)].to_vec());
    let Loaded { mesh, materials, origin, .. } = mesh_file::parse_mesh(path, bytes, &mut loading)?;
    if origin != DVec3::ZERO {
        scene.origin = origin;
        extent::note(path, origin);
    }
    let guess = up::guess(format, &head, (&mesh, origin));
    if let (Some(why), None) = (&guess.why, options.look.up) {
        tracing::info!("{}: {why}", path.display());
    }
    scene.images = images.finish();
    Scene::of_bare_mesh(path, scene, (mesh, materials), Lacks::all(guess.up))
}

/// Refuses the choice of a scene for a file that has only one.
fn check_only_scene(path: &Path, options: &LoadOptions) -> Result<(), SceneError> {
    match &options.scene {
        Some(name) => Err(SceneError::file(path, format!("there is no scene `{name}`: only glTF files name scenes"))),
        None => Ok(()),
    }
}
