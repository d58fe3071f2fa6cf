//! Scene files to what a frame is rendered from: world-space triangles, materials, lights, a camera.
//!
//! A scene is a TOML file (`description` lists what it may say) or a bare OBJ file.

mod assemble;
mod description;
mod error;
mod extent;
pub mod framing;
pub mod generate;
mod lighting;
mod material;
pub mod mesh;
mod needs;
pub mod normal;
mod obj;
mod path;
mod read;
mod smooth;
mod sources;

use std::path::Path;

use glam::Vec3;

pub use self::{error::SceneError, extent::MIN_EXTENT, material::illum_flags, path::CameraPath, sources::source_files};
use crate::{
    frame::{Denoise, RenderOptions, Tonemap},
    layout::{Light, Material, Triangle},
};

/// Everything that a frame shows. World space is right-handed, +y up by default.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// The file's name without its folder and extension.
    pub name: String,
    /// World space, at least one. Corners lie within `mesh::MAX_COORDINATE`, and their longest side is [`MIN_EXTENT`]
    /// or more.
    pub triangles: Vec<Triangle>,
    /// One index into `materials` a triangle. Renderers refuse a scene where this does not hold.
    pub triangle_materials: Vec<u32>,
    pub materials: Vec<Material>,
    /// One a material.
    pub material_names: Vec<String>,
    /// May be none.
    pub lights: Vec<Light>,
    pub camera: Camera,
    /// Irradiance that every point receives, weighted by its Ka.
    pub ambient: Vec3,
    /// Radiance of rays that leave the scene.
    pub background: Vec3,
    pub defaults: RenderDefaults,
}

/// A pinhole. `eye`, `target` and `up` span a plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// World space.
    pub eye: Vec3,
    /// What the middle of the picture shows.
    pub target: Vec3,
    /// Unit length, not parallel to the view.
    pub up: Vec3,
    /// Between the picture's lower and upper edge.
    pub vertical_fov_degrees: f32,
}

/// What a scene asks to be rendered with, unless the user says otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderDefaults {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Levels of rays, the primary one counted.
    pub max_depth: u32,
    pub exposure: f32,
    pub tonemap: Tonemap,
    pub denoise: Denoise,
}

impl Default for RenderDefaults {
    fn default() -> Self {
        let RenderOptions { width, height, max_depth, exposure, tonemap, denoise, .. } = RenderOptions::default();
        Self { width, height, max_depth, exposure, tonemap, denoise }
    }
}

impl Scene {
    /// Loads a `.toml` or `.obj` file. What is left out of the picture is a `tracing` warning.
    ///
    /// # Errors
    /// The file, or one that it names, cannot be read or understood; the scene is too small to be traced
    /// ([`MIN_EXTENT`]), reaches too far from the origin (`mesh::MAX_COORDINATE`), or needs more memory than there is.
    pub fn load(path: &Path) -> Result<Scene, SceneError> {
        let extension = path.extension().map(|extension| extension.to_ascii_lowercase());
        match extension.as_ref().and_then(|extension| extension.to_str()) {
            Some("toml") => assemble::load_toml(path),
            Some("obj") => load_bare_obj(path),
            _ => Err(SceneError::file(path, "is no scene: its name ends neither in .toml nor in .obj")),
        }
    }

    /// The name of the scene in a file: the file's name without its folder and extension.
    pub fn name_of(path: &Path) -> String {
        path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default()
    }

    /// Nothing yet, seen from nowhere.
    fn empty(path: &Path) -> Self {
        Self {
            name: Self::name_of(path),
            triangles: Vec::new(),
            triangle_materials: Vec::new(),
            materials: Vec::new(),
            material_names: Vec::new(),
            lights: Vec::new(),
            camera: Camera { eye: Vec3::ZERO, target: Vec3::NEG_Z, up: Vec3::Y, vertical_fov_degrees: 45.0 },
            ambient: Vec3::ZERO,
            background: Vec3::ZERO,
            defaults: RenderDefaults::default(),
        }
    }
}

/// The mesh with its own materials, framed, under one light.
fn load_bare_obj(path: &Path) -> Result<Scene, SceneError> {
    let mut scene = Scene::empty(path);
    let shading = obj::Shading { smooth: true, crease: obj::DEFAULT_CREASE };
    let (mesh, library) = obj::parse_obj(path, &obj::read_obj(path)?, shading, 0)?;
    scene.triangles = mesh.to_world(&mesh::Transform::IDENTITY).map_err(|what| SceneError::file(path, what))?;
    extent::check(path, &scene.triangles)?;
    let slots = scene.push_library(&library);
    scene.push_slots(&mesh, &slots);
    scene.camera = framing::camera(&scene.triangles);
    scene.lights = vec![framing::light()];
    scene.ambient = Vec3::splat(0.25);
    scene.background = Vec3::new(0.32, 0.36, 0.42);
    Ok(scene)
}
