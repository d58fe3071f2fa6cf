//! Scenes as files and programs describe them: meshes, their instances in the world, materials, lights, a camera.
//! Nothing here depends on how kernels lay data out; `world` flattens a scene for tracing.
//!
//! A scene is loaded from a scene file (TOML, whose keys `description` lists), from a mesh file (glTF, OBJ, PLY, STL),
//! or from a pack of either with all files that it names.

// Readers of files alone use many functions of the model.
#![cfg_attr(not(feature = "files"), allow(dead_code))]

#[cfg(feature = "files")]
mod files;
#[cfg(feature = "files")]
mod formats;
pub(crate) mod guess;
#[cfg(feature = "files")]
mod load;
mod meshes;
mod model;
mod of_mesh;
#[cfg(feature = "files")]
mod poser;
#[cfg(feature = "files")]
mod scene_file;

#[doc(hidden)]
pub use self::model::deformation;
pub(crate) use self::model::{scene::MOST_TRIANGLES, texture::half_bits};
#[cfg(feature = "files")]
pub(crate) use self::{files::pack, poser::Poser};
#[cfg(feature = "files")]
pub use self::{
    files::pack::{ENDING as PACK_ENDING, pack_hash, packed_path},
    poser::animations_of,
    scene_file::{
        camera_path::CameraPath,
        convert::scene_file_of,
        sources::{source_files, source_files_with},
        terms::{Term, TermValue},
    },
};
pub use self::{
    guess::turntable::Turntable,
    meshes::generate,
    model::{
        Alpha, AnimationChoice, AnimationInfo, Camera, Channel, ChosenLight, Clearcoat, Conductor, DenoiseChoice,
        Encoding, Environment, Ground, Image, Instance, Light, LightChoice, LoadOptions, Lobes, Look, MIN_EXTENT, Maps,
        Material, MaterialChoice, MendedTexels, Mesh, Microfacet, PathDefaults, PictureChoices, Pixels, Preset,
        Projection, RayKinds, RenderDefaults, Scene, SceneError, Sheen, Sky, SkyChoice, Texture, Transform, Up, Wrap,
        mesh,
    },
};
