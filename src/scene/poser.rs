//! Files whose meshes, lights and cameras are posed at one moment after the other.

use std::path::Path;

use super::{
    files::pack::OpenScene,
    formats::{
        gltf,
        mesh_file::{MeshFile, MeshFormat},
    },
    model::{AnimationChoice, AnimationInfo, LoadOptions, Scene, SceneError, deformation::ChangedMeshes},
    scene_file::{assemble, poser::KeyPoser, sources::is_scene_file},
};

/// A file that can be posed.
pub(crate) enum Poser {
    Gltf(Box<gltf::Poser>),
    Keys(KeyPoser),
}

impl Poser {
    /// Reads a file, or that of a pack, whose scene at the moment of the options is known. Returns `None` if it must be
    /// read again at each moment.
    pub fn new(path: &Path, options: &LoadOptions, scene: &Scene) -> Option<Self> {
        let OpenScene { file, options, .. } = &OpenScene::new(path, options).ok()?;
        match is_scene_file(&file.path) {
            true => KeyPoser::new(file, options, scene).map(Self::Keys),
            false => {
                let mesh = MeshFile::read(file).ok()?;
                gltf::Poser::new(mesh, options, scene).map(|poser| Self::Gltf(Box::new(poser)))
            }
        }
    }

    /// Chooses the animations that further moments show. Returns `None` if the file must then be read again at each
    /// moment: a scene file may now show those of the files that it names.
    pub fn with_animation(self, animation: AnimationChoice) -> Option<Self> {
        let Self::Gltf(mut poser) = self else { return None };
        poser.set_animation(animation);
        Some(Self::Gltf(poser))
    }

    /// Poses a scene of the file at a moment, seconds. Returns the meshes that are deformed, or `None` if the file must
    /// be read again for this moment.
    pub fn pose(&mut self, seconds: f64, scene: &mut Scene) -> Result<Option<ChangedMeshes>, SceneError> {
        match self {
            Self::Gltf(poser) => poser.pose(seconds, scene),
            Self::Keys(poser) => poser.pose(seconds, scene).map(|()| Some(ChangedMeshes::new())),
        }
    }
}

/// Returns the animations of a file, or of that of a pack, that options choose, without reading its meshes.
///
/// # Errors
/// The file cannot be read or understood, or has no animation of the name that the options choose.
pub fn animations_of(path: &Path, options: &LoadOptions) -> Result<Vec<AnimationInfo>, SceneError> {
    let OpenScene { file, options, .. } = &OpenScene::new(path, options)?;
    let mut all = if is_scene_file(&file.path) {
        assemble::animations(file, options)?
    } else {
        match MeshFile::read(file)? {
            mesh if mesh.format == MeshFormat::Gltf => gltf::animations(mesh, options)?,
            _ => Vec::new(),
        }
    };
    let names: Vec<&str> = all.iter().map(|info| info.name.as_str()).collect();
    let chosen = options.animation.among(&names).map_err(|what| file.error(what))?;
    let mut ix = 0..;
    all.retain(|_| ix.next().is_some_and(|ix| chosen.contains(&ix)));
    Ok(all)
}
