//! A scene as its parts: what files describe, programs fill, and `world` flattens. Nothing here reads a file or knows
//! how kernels lay data out.

pub(crate) mod camera;
pub(crate) mod defaults;
pub mod deformation;
pub(crate) mod environment;
pub(crate) mod error;
pub(crate) mod extent;
pub(crate) mod keys;
pub(crate) mod lacks;
pub(crate) mod light;
pub(crate) mod lighting;
pub(crate) mod load_options;
pub(crate) mod look;
pub(crate) mod material;
pub mod mesh;
pub(crate) mod preset;
pub(crate) mod scene;
pub(crate) mod sky;
pub(crate) mod texture;
pub(crate) mod transform;
pub(crate) mod up;

pub use self::{
    camera::{Camera, Projection},
    defaults::{DenoiseChoice, PathDefaults, PictureChoices, RenderDefaults},
    environment::{Environment, MendedTexels},
    error::SceneError,
    extent::MIN_EXTENT,
    lacks::ChosenLight,
    light::{Ground, Light},
    load_options::{AnimationChoice, AnimationInfo, LoadOptions},
    look::{LightChoice, Look, SkyChoice},
    material::{Alpha, Clearcoat, Conductor, Lobes, Maps, Material, Microfacet, Sheen},
    mesh::Mesh,
    preset::{MaterialChoice, Preset},
    scene::{Instance, RayKinds, Scene},
    sky::Sky,
    texture::{Channel, Encoding, Image, Pixels, Texture, Wrap},
    transform::Transform,
    up::Up,
};
