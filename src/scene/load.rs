//! Loads a scene from a file or a text, and fills in what it lacks.

use std::path::Path;

use glam::DVec3;

use super::{
    files::{SourceFile, pack::OpenScene},
    formats::{
        gltf,
        image_cache::Images,
        mesh_file::{self, Loaded, Loading, MeshFile, MeshFormat},
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
        let opened = OpenScene::new(path, options)?;
        let scene = Self::load_file(&opened.file, &opened.options);
        opened.check()?;
        scene
    }

    /// Makes a scene of the text of a scene file that names no other files. `name` is the name that the file would
    /// have.
    ///
    /// # Errors
    /// Those of [`Scene::load`].
    pub fn of_text(name: &str, text: &str) -> Result<Scene, SceneError> {
        let (path, options) = (Path::new(name), LoadOptions::default());
        let file = SourceFile::new(path, &options);
        let Assembled { mut scene, lacks, .. } = assemble::parse_toml(&file, text, &options)?;
        standard::fill_in(path, &mut scene, lacks, &options).map_err(|what| file.error(what))?;
        Ok(scene)
    }

    /// Loads a scene from a file that is no pack.
    fn load_file(file: &SourceFile, options: &LoadOptions) -> Result<Scene, SceneError> {
        let (path, failed) = (&*file.path, |what: String| file.error(what));
        let (mut scene, lacks) = if is_scene_file(path) {
            check_only_scene(file, options)?;
            let Assembled { scene, lacks, .. } = assemble::load_toml(file, options)?;
            (scene, lacks)
        } else {
            if MeshFormat::of_name(path).is_none() {
                file.check_content(mesh_file::is_certain)?;
            }
            load_mesh_file(MeshFile::read(file)?, options)?
        };
        preset::replace(&mut scene, &options.look.materials).map_err(failed)?;
        if options.look.shows_back_faces {
            scene.show_back_faces();
        }
        scene.add_tangents().map_err(failed)?;
        if let Some(name) = &options.camera {
            scene.choose_camera(name).map_err(failed)?;
        }
        standard::fill_in(path, &mut scene, lacks, options).map_err(failed)?;
        Ok(scene)
    }
}

/// Loads a mesh file as a scene: the mesh with its own materials. Only a glTF file may have lights and cameras.
fn load_mesh_file(file: MeshFile, options: &LoadOptions) -> Result<(Scene, Lacks), SceneError> {
    if file.format == MeshFormat::Gltf {
        return gltf::load(file, options);
    }
    check_only_scene(&file.source, options)?;
    let (path, format) = (&*file.source.path.clone(), file.format);
    let mut scene = Scene::empty(path);
    let mut images = Images::new(options.look.materials.clone(), &options.progress);
    let origin = if options.recentre { MeshOrigin::Near } else { MeshOrigin::At(DVec3::ZERO) };
    let mut loading = Loading { shading: Shading::default(), origin, n_loaded: 0, images: &mut images };
    let head = file.bytes[..file.bytes.len().min(up_axis::HEAD_BYTES)].to_vec();
    let Loaded { mesh, materials, origin, .. } = mesh_file::parse_mesh(file, &mut loading)?;
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
fn check_only_scene(file: &SourceFile, options: &LoadOptions) -> Result<(), SceneError> {
    match &options.scene {
        Some(name) => Err(file.error(format!("there is no scene `{name}`: only glTF files name scenes"))),
        None => Ok(()),
    }
}
