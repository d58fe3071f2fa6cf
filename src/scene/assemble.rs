//! Conversion of a scene file's text into a scene.

use std::{
    collections::{BTreeMap, HashMap},
    ops::Range,
    path::Path,
};

use glam::{DVec3, Vec3};
use serde::de::DeserializeOwned;
use toml::Spanned;

use super::{
    Camera, Light, LoadOptions, Material, Projection, RenderDefaults, Scene,
    camera::{FOV_DEGREES, HEIGHTS},
    description::{CameraSpec, Description, LightSpec, MeshSpec, RenderSpec, SceneDenoise},
    error::{Checked, SceneError},
    extent,
    image_files::Images,
    look::Up,
    map_spec::MapSpec,
    material::{MaterialSpec, colour, within},
    mesh::MAX_COORDINATE,
    outside::Access,
    overrides::NamedMaterials,
    placed::{MeshTable, Placer},
    read::read_utf8,
    standard::Lacks,
    transform::finite,
};
use crate::{frame::Denoise, util::progress::Progress};

/// Name of the material of meshes and faces that name none.
pub(super) const DEFAULT_MATERIAL: &str = "(default)";

/// Loads a scene file and the meshes that it names. Their names are relative to the scene file's folder.
pub(super) fn load_toml(path: &Path, options: &LoadOptions) -> Result<(Scene, Lacks), SceneError> {
    let text = read_utf8(path)?;
    let file = File { path, text: &text, access: Access::of(options) };
    assemble(&file, file.parse()?, &options.progress)
}

/// A file and its text. Errors name the file and the line.
pub(super) struct File<'a> {
    pub path: &'a Path,
    pub text: &'a str,
    /// Which files it may name.
    pub access: Access,
}

impl File<'_> {
    /// Parses the text as TOML.
    pub fn parse<T: DeserializeOwned>(&self) -> Result<T, SceneError> {
        toml::from_str(self.text).map_err(|e| match e.span() {
            Some(span) => self.at(&span, e.message()),
            None => SceneError::file(self.path, e.message()),
        })
    }

    pub fn at(&self, span: &Range<usize>, what: impl AsRef<str>) -> SceneError {
        let before = &self.text.as_bytes()[..span.start.min(self.text.len())];
        SceneError::line(self.path, 1 + before.iter().filter(|byte| **byte == b'\n').count(), what)
    }

    /// Returns the checked value. An error names the object and its line.
    pub fn check<T, U>(
        &self,
        object: &str,
        spec: &Spanned<T>,
        check: impl FnOnce(&T) -> Checked<U>,
    ) -> Result<U, SceneError> {
        check(spec.get_ref()).map_err(|what| self.at(&spec.span(), format!("{object}: {what}")))
    }
}

fn assemble(file: &File, description: Description, progress: &Progress) -> Result<(Scene, Lacks), SceneError> {
    let lacks = Lacks {
        up: Up::Y,
        camera: description.camera.is_none() && description.cameras.is_empty(),
        light: description.light.is_empty() && description.ambient.is_none(),
        background: description.background.is_none(),
    };
    let mut scene = Scene::empty(file.path);
    let mut images = Images::new(progress);
    let indices = add_materials(file, (&mut scene, &mut images), &description.materials)?;
    for (ix, spec) in description.light.iter().enumerate() {
        scene.lights.push(file.check(&format!("light {}", ix + 1), spec, light)?);
    }
    if let Some(spec) = &description.ambient {
        scene.ambient = file.check("ambient", spec, |rgb| colour("ambient", Some(*rgb), Vec3::ZERO))?;
    }
    if let Some(spec) = &description.background {
        scene.background = file.check("background", spec, |rgb| colour("background", Some(*rgb), Vec3::ZERO))?;
    }
    if let Some(spec) = &description.render {
        scene.defaults = file.check("render", spec, render_defaults)?;
    }
    let mut tables = Vec::new();
    for (ix, table) in description.mesh.into_iter().enumerate() {
        let (number, span) = (ix + 1, table.span());
        let spec = MeshSpec::new(table.into_inner());
        let spec = spec.map_err(|what| file.at(&span, format!("mesh {number}: {what}")))?;
        tables.push(MeshTable { number, span, spec });
    }
    let materials = NamedMaterials::new(&description.materials, indices);
    let mut placer = Placer::new(file, (scene, images), materials, &tables);
    for table in &tables {
        placer.add(table)?;
    }
    placer.materials.warn_of_unmatched(file);
    placer.materials.remove_idle(&mut placer.scene);
    let Placer { mut scene, images, .. } = placer;
    scene.images = images.finish();
    if scene.n_triangles() == 0 {
        return Err(SceneError::file(file.path, "has no triangles"));
    }
    extent::check(file.path, scene.bounds())?;
    for (ix, spec) in description.cameras.iter().enumerate() {
        let named = file.check(&format!("camera {}", ix + 1), spec, |spec| camera(&spec.camera()))?;
        scene.cameras.push((spec.get_ref().name.clone(), named));
    }
    scene.camera = match (&description.camera, scene.cameras.first()) {
        (Some(spec), _) => file.check("camera", spec, camera)?,
        (None, Some((_, first))) => *first,
        (None, None) => scene.camera,
    };
    Ok((scene, lacks))
}

/// Adds the materials of a scene file and their images. Returns the indices of the materials by their names.
fn add_materials(
    file: &File,
    (scene, images): (&mut Scene, &mut Images),
    specs: &BTreeMap<String, Spanned<MaterialSpec>>,
) -> Result<HashMap<String, u32>, SceneError> {
    let mut of_materials: Vec<Vec<usize>> = Vec::new();
    for (name, spec) in specs {
        of_materials.push(file.check(&format!("material `{name}`"), spec, |spec| {
            let path = |(key, map): (&str, &MapSpec)| {
                file.access.beside(file.path).exact(map.file()).map_err(|what| format!("{key}: {what}"))
            };
            spec.maps().map(|map| Ok(images.add(path(map)?))).collect()
        })?);
    }
    images.decode();
    let mut indices = HashMap::new();
    for ((name, spec), files) in specs.iter().zip(of_materials) {
        let material = file.check(&format!("material `{name}`"), spec, |spec| {
            let mut material = spec.material(name)?;
            for ((key, map), ix) in spec.maps().zip(files) {
                map.set(&mut material, key, images, ix).map_err(|what| format!("{key}: {what}"))?;
            }
            Ok(material)
        })?;
        indices.insert(name.clone(), scene.push_material(material));
    }
    Ok(indices)
}

impl Scene {
    /// Adds a material and returns its index.
    pub(super) fn push_material(&mut self, material: Material) -> u32 {
        self.materials.push(material);
        (self.materials.len() - 1) as u32
    }

    /// Returns the index of the default material, for meshes and faces that name none. Adds it at the first call.
    pub(super) fn default_material(&mut self) -> u32 {
        if let Some(ix) = self.materials.iter().position(|material| material.name == DEFAULT_MATERIAL) {
            return ix as u32;
        }
        self.push_material(MaterialSpec::default().material(DEFAULT_MATERIAL).expect("defaults are in range"))
    }

    /// Adds the materials of a mesh that came with them. Returns their indices for the slots of the mesh; the last one
    /// is the default material, for faces without one.
    pub(super) fn push_materials(&mut self, materials: Vec<Material>) -> Vec<u32> {
        let mut slots: Vec<u32> = materials.into_iter().map(|material| self.push_material(material)).collect();
        slots.push(self.default_material());
        slots
    }
}

fn light(spec: &LightSpec) -> Checked<Light> {
    match *spec {
        LightSpec::Point { position, intensity } => Ok(Light::Point {
            position: point("position", position)?,
            intensity: colour("intensity", Some(intensity), Vec3::ZERO)?,
        }),
        LightSpec::Directional { direction, irradiance } => {
            let irradiance = colour("irradiance", Some(irradiance), Vec3::ZERO)?;
            Ok(Light::Directional { towards: -unit("direction", direction)?, irradiance })
        }
        LightSpec::Spot { position, direction, intensity, inner_angle, outer_angle } => {
            if !(0.0 <= inner_angle && inner_angle <= outer_angle && outer_angle <= 90.0) {
                return Err(format!(
                    "inner_angle = {inner_angle} and outer_angle = {outer_angle} are not in order from 0 to 90 degrees"
                ));
            }
            // The cosine of a right angle is rounded to a number above 0.
            let cosine = |degrees: f64| if degrees < 90.0 { degrees.to_radians().cos() as f32 } else { 0.0 };
            Ok(Light::Spot {
                position: point("position", position)?,
                towards: unit("direction", direction)?,
                intensity: colour("intensity", Some(intensity), Vec3::ZERO)?,
                inner_cos: cosine(inner_angle),
                outer_cos: cosine(outer_angle),
            })
        }
    }
}

/// Returns a vector's direction as a unit vector.
fn unit(name: &str, value: [f32; 3]) -> Checked<Vec3> {
    let direction = normalized(finite(name, value)?);
    if direction == Vec3::ZERO { Err(format!("{name} = {value:?} has no direction")) } else { Ok(direction) }
}

/// Returns a vector of length 1, or 0 for a vector without a direction. A vector whose length is 1 up to the rounding
/// of its coordinates is kept as it is, so that a unit vector that was written is read.
fn normalized(vector: DVec3) -> Vec3 {
    let is_unit = (vector.length_squared() - 1.0).abs() <= f64::from(4.0 * f32::EPSILON);
    if is_unit { vector.as_vec3() } else { vector.normalize_or_zero().as_vec3() }
}

pub(super) fn camera(spec: &CameraSpec) -> Checked<Camera> {
    let camera = Camera {
        eye: point("eye", spec.eye)?,
        target: point("target", spec.target)?,
        up: normalized(finite("up", spec.up.unwrap_or([0.0, 1.0, 0.0]))?),
        projection: projection(spec.vertical_fov, spec.orthographic_height)?,
    };
    if !camera.spans_picture() {
        return Err(
            "eye, target and up span no picture: eye and target coincide, or up points along the view".to_owned()
        );
    }
    Ok(camera)
}

fn projection(vertical_fov: Option<f32>, orthographic_height: Option<f32>) -> Checked<Projection> {
    let Some(height) = orthographic_height else {
        let (least, most) = FOV_DEGREES;
        let vertical_fov_degrees = within("vertical_fov", vertical_fov.unwrap_or(45.0), least, most)?;
        return Ok(Projection::Perspective { vertical_fov_degrees });
    };
    if vertical_fov.is_some() {
        return Err("has both `vertical_fov` and `orthographic_height`".to_owned());
    }
    Ok(Projection::Orthographic { height: within("orthographic_height", height, HEIGHTS.0, HEIGHTS.1)? })
}

/// Checks a point in world space, which must be finite and lie within [`MAX_COORDINATE`].
fn point(name: &str, value: [f32; 3]) -> Checked<Vec3> {
    let point = finite(name, value)?.as_vec3();
    if point.abs().max_element() <= MAX_COORDINATE {
        Ok(point)
    } else {
        Err(format!("{name} = {value:?} lies beyond {MAX_COORDINATE:e}"))
    }
}

fn render_defaults(spec: &RenderSpec) -> Checked<RenderDefaults> {
    let defaults = RenderDefaults::default();
    let count = |name: &str, value: Option<u32>, default: u32, max: u32| match value.unwrap_or(default) {
        value if (1..=max).contains(&value) => Ok(value),
        value => Err(format!("{name} = {value} is outside 1 to {max}")),
    };
    let threshold = spec.denoise_threshold.unwrap_or(Denoise::DEFAULT_THRESHOLD);
    let threshold = within("denoise_threshold", threshold, 0.0, 4.0)?;
    let is_metered = spec.metered.unwrap_or(false);
    if is_metered && spec.exposure.is_some() {
        return Err("has both `exposure` and `metered = true`".to_owned());
    }
    Ok(RenderDefaults {
        width: count("width", spec.width, defaults.width, 16_384)?,
        height: count("height", spec.height, defaults.height, 16_384)?,
        max_depth: count("max_depth", spec.max_depth, defaults.max_depth, 64)?,
        tonemap: match &spec.tonemap {
            Some(word) => word.parse().map_err(|e| format!("tonemap: {e}"))?,
            None => defaults.tonemap,
        },
        samples: count("samples", spec.samples, defaults.samples, 65_536)?,
        exposure: within("exposure", spec.exposure.unwrap_or(defaults.exposure), 1e-6, 1e6)?,
        is_metered,
        denoise: match spec.denoise.unwrap_or(SceneDenoise::Paper) {
            SceneDenoise::Off => Denoise::Off,
            SceneDenoise::Paper => Denoise::Paper { threshold },
        },
    })
}
