//! Scene files: TOML text to a scene and back, camera paths, and the list of the files that a scene is made of.

pub(crate) mod animations;
pub(crate) mod assemble;
pub(crate) mod camera_path;
pub(crate) mod cameras;
pub(crate) mod convert;
pub(crate) mod description;
pub(crate) mod keyframes;
pub(crate) mod overrides;
pub(crate) mod placed;
pub(crate) mod poser;
pub(crate) mod sources;
pub(crate) mod terms;
pub(crate) mod transforms;
