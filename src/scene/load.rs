//! Loads a scene from a file or a text, and fills in what it lacks.

use std::path::Path;

use glam::DVec3;

use super::{
    files::{foreign, pack, source_file::Access, store},
    formats::{
        gltf,
        image_files::Images,
        mesh_file::{self, Loaded, Loading, MeshFormat},
    },
    guess::{standard, up_axis},
    meshes::smooth::Shading,
    model::{
        error::SceneError,
        extent::{self, MeshOrigin},
        lacks::Lacks,
        load_options::LoadOptions,
        preset,
        scene::Scene,
    },
    scene_file::{
        assemble::{self, Assembled},
        sources::is_scene_file,
    },
};

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
    /// traced ([`MIN_EXTENT`](super::MIN_EXTENT)), reaches too far from the origin (`mesh::MAX_COORDINATE`), or needs
    /// more memory than there is.
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
        let Assembled { mut scene, lacks, .. } = assemble::parse_toml(path, text, &options)?;
        standard::fill_in(path, &mut scene, lacks, &options).map_err(|what| SceneError::file(path, what))?;
        Ok(scene)
    }

    /// Loads a scene from a file that is no pack.
    fn load_file(path: &Path, options: &LoadOptions) -> Result<Scene, SceneError> {
        let (mut scene, lacks) = if is_scene_file(path) {
            check_only_scene(path, options)?;
            let Assembled { scene, lacks, .. } = assemble::load_toml(path, options)?;
            (scene, lacks)
        } else if MeshFormat::of_name(path).is_some() {
            load_mesh_file(path, options)?
        } else {
            let head = store::head(path, HEAD_BYTES).unwrap_or_else(|_| b" ".to_vec());
            if !mesh_file::is_certain(&head) {
                return Err(SceneError::file(path, foreign::of_other_name(path, &head)));
            }
            load_mesh_file(path, options)?
        };
        preset::replace(&mut scene, &options.look.materials).map_err(|what| SceneError::file(path, what))?;
        if options.look.shows_back_faces {
            scene.show_back_faces();
        }
        scene.add_tangents().map_err(|what| SceneError::file(path, what))?;
        if let Some(name) = &options.camera {
            scene.choose_camera(name).map_err(|what| SceneError::file(path, what))?;
        }
        standard::fill_in(path, &mut scene, lacks, options).map_err(|what| SceneError::file(path, what))?;
        Ok(scene)
    }
}

/// Number of bytes at the beginning of a file that tell what it is.
const HEAD_BYTES: usize = 1024;

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
    let (format, head) = (MeshFormat::of(path, &bytes), bytes[..bytes.len().min(up_axis::HEAD_BYTES)].to_vec());
    let Loaded { mesh, materials, origin, .. } = mesh_file::parse_mesh(path, bytes, &mut loading)?;
    if origin != DVec3::ZERO {
        scene.origin = origin;
        extent::note(path, origin);
    }
    let guess = up_axis::guess(format, &head, (&mesh, origin));
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
