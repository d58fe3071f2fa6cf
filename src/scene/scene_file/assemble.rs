//! Conversion of a scene file's text into a scene.

use std::{
    collections::{BTreeMap, HashMap},
    ops::Range,
    path::Path,
};

use glam::{DVec3, Vec3};
use serde::de::DeserializeOwned;
use toml::{Spanned, Table};

use super::{
    animations::{Animations, Moving, infos_of_files},
    cameras::Cameras,
    description::{
        AmbientSpec, CameraSpec, Description, EnvironmentSpec, HemispheresSpec, LightSpec, MeshSpec, RenderSpec,
        SceneDenoise, SkySpec,
    },
    keyframes::{self, KeyedTable},
    overrides::NamedMaterials,
    placed::{MeshTable, Placer},
};
use crate::{
    frame::{Denoise, Integrator, RenderOptions, SampleRange},
    scene::{
        files::SourceFile,
        formats::{
            image::{Encoded, decode_colours},
            image_cache::Images,
            map_spec::MapSpec,
            material_spec::MaterialSpec,
        },
        model::{
            AnimationInfo, Camera, Environment, Ground, Light, LoadOptions, MaterialChoice, PathDefaults, Projection,
            RenderDefaults, Scene, SceneError, Sky, Up,
            camera::{FOV_DEGREES, HEIGHTS},
            error::Checked,
            extent,
            lacks::Lacks,
            material::{colour, within},
            mesh::MAX_COORDINATE,
            preset,
            sky::above_horizon,
            transform::finite,
        },
    },
    util::{memory, text::escape_controls},
};

/// Memory of a pixel of an environment while its tables are made, bytes: the colour as it is read (12), luminance and
/// weight (16), the texel (16) and its alias (8), and the words that are uploaded (24).
const ENVIRONMENT_BYTES: u64 = 76;

/// A scene as its file states it.
pub(crate) struct Assembled {
    pub scene: Scene,
    pub lacks: Lacks,
    /// The meshes that keys move.
    pub moving: Vec<Moving>,
    /// All lights of the file.
    pub lights: Vec<KeyedTable>,
    pub cameras: Cameras,
    /// Whether animations of glTF files are shown.
    pub plays_files: bool,
}

/// Loads a scene file and the meshes that it names. Their names are relative to the scene file's folder.
pub(crate) fn load_toml(source: &SourceFile, options: &LoadOptions) -> Result<Assembled, SceneError> {
    parse_toml(source, &source.text()?, options)
}

/// Makes a scene of the text of a scene file.
pub(crate) fn parse_toml(source: &SourceFile, text: &str, options: &LoadOptions) -> Result<Assembled, SceneError> {
    let file = File { source, text };
    assemble(&file, file.parse()?, options)
}

/// A file and its text. Errors name the file and the line.
pub(crate) struct File<'a> {
    pub source: &'a SourceFile,
    pub text: &'a str,
}

impl File<'_> {
    /// Parses the text as TOML.
    pub fn parse<T: DeserializeOwned>(&self) -> Result<T, SceneError> {
        toml::from_str(self.text).map_err(|e| match e.span() {
            Some(span) => self.at(&span, e.message()),
            None => self.source.error(e.message()),
        })
    }

    pub fn at(&self, span: &Range<usize>, what: impl AsRef<str>) -> SceneError {
        let before = &self.text.as_bytes()[..span.start.min(self.text.len())];
        SceneError::line(&self.source.path, 1 + before.iter().filter(|byte| **byte == b'\n').count(), what)
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

/// `options`: they name the materials that the user replaces beside those that the file does.
fn assemble(file: &File, description: Description, options: &LoadOptions) -> Result<Assembled, SceneError> {
    let has_beyond = description.environment.is_some() || description.sky.is_some();
    let render = description.render.as_ref().map(|render| render.as_ref());
    let lacks = Lacks {
        up: Up::Y,
        // The file says what there is.
        description: false,
        camera: description.camera.is_none() && description.cameras.is_empty(),
        light: description.light.is_empty() && description.ambient.is_none() && !has_beyond,
        background: description.background.is_none() && !has_beyond,
        integrator: render.is_none_or(|render| render.integrator.is_none()),
        exposure: render.is_none_or(|render| render.exposure.is_none() && render.metered.is_none()),
    };
    let path = &file.source.path;
    let mut scene = Scene::empty(path);
    let replace = description.replace.as_ref().map(|spec| file.check("replace", spec, |words| choices(words)));
    let replace = replace.transpose()?.unwrap_or_default();
    let mut images = Images::new([&replace[..], &options.look.materials].concat(), &options.progress);
    let indices = add_materials(file, (&mut scene, &mut images), &description.materials)?;
    let lights = lights(file, description.light)?;
    let tables = mesh_tables(file, description.mesh)?;
    let cameras = Cameras::new(file, description.camera.as_ref(), &description.cameras)?;
    let own = own_animation(&tables, (&lights, &cameras));
    let moment = Animations::new(file, (&tables, own), options)?;
    scene.lights = lights_at(path, &lights, (moment.of_keys, DVec3::ZERO))?;
    warn_of_black(file, &scene.lights);
    if let Some(spec) = &description.ambient {
        (scene.ambient, scene.ground) = file.check("ambient", spec, ambient)?;
    }
    if let Some(spec) = &description.background {
        scene.background = file.check("background", spec, |rgb| colour("background", Some(*rgb), Vec3::ZERO))?;
    }
    if let Some(spec) = &description.studio {
        scene.studio = Some(file.check("studio", spec, |it| unit("studio", *it))?);
    }
    if let Some(spec) = &description.environment {
        scene.environment = Some(file.check("environment", spec, |spec| environment(file, spec))?);
    }
    if let Some(spec) = &description.sky {
        scene.sky = Some(file.check("sky", spec, sky)?);
        if description.environment.is_some() {
            return Err(file.at(&spec.span(), "sky: the scene has an `environment`, too; only one of them is possible"));
        }
    }
    if let Some(spec) = &description.render {
        scene.defaults = file.check("render", spec, render_defaults)?;
    }
    let materials = NamedMaterials::new(&description.materials, indices);
    let mut placer = Placer::new(file, (scene, images), materials, (&tables, options.recentre, moment));
    placer.read_together(&tables);
    for table in &tables {
        placer.add(table)?;
    }
    placer.materials.warn_of_unmatched(file);
    placer.materials.remove_idle(&mut placer.scene);
    let Placer { mut scene, images, moving, animations, .. } = placer;
    let (moment, plays_files) = (animations.of_keys, animations.plays_files());
    scene.animations = animations.infos;
    scene.images = images.finish();
    if let Some(spec) = &description.replace {
        file.check("replace", spec, |_| preset::replace(&mut scene, &replace))?;
    }
    if let Some(spec) = &description.cull {
        let shows_back_faces = file.check("cull", spec, |word| match &**word {
            "auto" => Ok(false),
            "off" => Ok(true),
            _ => Err(format!("`{}` is not one of auto, off", escape_controls(word))),
        })?;
        if shows_back_faces {
            scene.show_back_faces();
        }
    }
    if scene.n_triangles() == 0 {
        return Err(file.source.error("has no triangles"));
    }
    if options.recentre {
        extent::recentre(path, &mut scene);
        scene.lights = lights_at(path, &lights, (moment, scene.origin))?;
    }
    extent::check(path, scene.bounds())?;
    cameras.pose(path, moment, &mut scene)?;
    Ok(Assembled { scene, lacks, moving, lights, cameras, plays_files })
}

/// Returns what is known of the animations of a scene file: its keys, and those of the glTF files that it names.
pub(crate) fn animations(source: &SourceFile, options: &LoadOptions) -> Result<Vec<AnimationInfo>, SceneError> {
    let file = File { source, text: &source.text()? };
    let Description { mesh, light, camera, cameras, .. } = file.parse()?;
    let (tables, lights) = (mesh_tables(&file, mesh)?, lights(&file, light)?);
    let cameras = Cameras::new(&file, camera.as_ref(), &cameras)?;
    let of_files = infos_of_files(&file, &tables, options)?;
    Ok(own_animation(&tables, (&lights, &cameras))
        .into_iter()
        .chain(of_files.into_iter().flat_map(|(_, infos)| infos))
        .collect())
}

/// Returns the animation that a scene file's keyframes make up, if there are any.
fn own_animation(tables: &[MeshTable], (lights, cameras): (&[KeyedTable], &Cameras)) -> Option<AnimationInfo> {
    let changed = lights.iter().map(KeyedTable::times).chain(cameras.times());
    keyframes::info(tables.iter().map(|table| table.spec.place.times()), changed)
}

/// Reads the tables of meshes.
fn mesh_tables(file: &File, tables: Vec<Spanned<Table>>) -> Result<Vec<MeshTable>, SceneError> {
    let table = |(number, table): (usize, Spanned<Table>)| {
        let span = table.span();
        let spec = MeshSpec::new(table.into_inner());
        let spec = spec.map_err(|what| file.at(&span, format!("mesh {number}: {what}")))?;
        Ok(MeshTable { number, span, spec })
    };
    (1..).zip(tables).map(table).collect()
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
            let named =
                |(key, map): (&str, &MapSpec)| file.source.exact(map.file()).map_err(|what| format!("{key}: {what}"));
            let maps = spec.maps().filter(|_| !images.is_replaced(name)).collect::<Vec<_>>();
            maps.into_iter().map(|map| Ok(images.add(named(map)?))).collect()
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

fn choices(words: &[String]) -> Checked<Vec<MaterialChoice>> {
    words.iter().map(|word| word.parse()).collect()
}

/// Returns the ambient light from above, and that from below if it differs.
fn ambient(spec: &AmbientSpec) -> Checked<(Vec3, Option<Ground>)> {
    match spec {
        AmbientSpec::Even(rgb) => Ok((colour("ambient", Some(*rgb), Vec3::ZERO)?, None)),
        AmbientSpec::Hemispheres(HemispheresSpec { sky, ground, up: word }) => {
            let up = up(word.as_ref())?;
            let ambient = colour("ground", Some(*ground), Vec3::ZERO)?;
            Ok((colour("sky", Some(*sky), Vec3::ZERO)?, Some(Ground { ambient, up })))
        }
    }
}

/// Reads the tables of lights, which are checked as they rest and at all keys.
fn lights(file: &File, tables: Vec<Spanned<Table>>) -> Result<Vec<KeyedTable>, SceneError> {
    let read = |(number, table): (usize, Spanned<Table>)| {
        let read = |table: &Table| {
            let keyed = KeyedTable::new(table.clone())?;
            keyed.check(|spec| light(spec, DVec3::ZERO))?;
            Ok(keyed)
        };
        file.check(&format!("light {number}"), &table, read)
    };
    (1..).zip(tables).map(read).collect()
}

/// Returns the lights at a moment, seconds, or at rest. `origin` is the point of the file that is the origin of world
/// space.
pub(crate) fn lights_at(
    path: &Path,
    lights: &[KeyedTable],
    (seconds, origin): (Option<f64>, DVec3),
) -> Result<Vec<Light>, SceneError> {
    let at = |(number, keyed): (usize, &KeyedTable)| {
        let light = keyed.at(seconds).and_then(|spec| light(&spec, origin));
        light.map_err(|what| SceneError::file(path, format!("light {number}: {what}")))
    };
    (1..).zip(lights).map(at).collect()
}

fn light(spec: &LightSpec, origin: DVec3) -> Checked<Light> {
    let point = |name, value| point(name, value, origin);
    match *spec {
        LightSpec::Point { position, intensity } => Ok(Light::Point {
            position: point("position", position)?,
            intensity: colour("intensity", Some(intensity), Vec3::ZERO)?,
        }),
        LightSpec::Directional { direction, irradiance, angle } => {
            let irradiance = colour("irradiance", Some(irradiance), Vec3::ZERO)?;
            let towards = -unit("direction", direction)?;
            match angle.map(|angle| within("angle", angle, 0.0, 180.0)).transpose()? {
                Some(angle_degrees) if angle_degrees > 0.0 => Ok(Light::Sun { towards, irradiance, angle_degrees }),
                _ => Ok(Light::Directional { towards, irradiance }),
            }
        }
        LightSpec::Rectangle { position, direction, up, width, height, radiance } => {
            let towards = unit("direction", direction)?;
            let up = up.map(|up| unit("up", up)).transpose()?.unwrap_or(Vec3::Y);
            // If up is along the direction, any other one will do.
            let beside = if up.cross(towards).length() > 1e-6 { up } else { towards.any_orthonormal_vector() };
            let up = beside.reject_from_normalized(towards).normalize();
            Ok(Light::Rectangle {
                position: point("position", position)?,
                edge_u: up.cross(towards) * (extent_of("width", width)? / 2.0),
                edge_v: up * (extent_of("height", height)? / 2.0),
                radiance: colour("radiance", Some(radiance), Vec3::ZERO)?,
            })
        }
        LightSpec::Disk { position, direction, radius, radiance } => Ok(Light::Disk {
            position: point("position", position)?,
            towards: unit("direction", direction)?,
            radius: extent_of("radius", radius)?,
            radiance: colour("radiance", Some(radiance), Vec3::ZERO)?,
        }),
        LightSpec::Sphere { position, radius, radiance } => Ok(Light::Sphere {
            position: point("position", position)?,
            radius: extent_of("radius", radius)?,
            radiance: colour("radiance", Some(radiance), Vec3::ZERO)?,
        }),
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

/// Warns once of the lights from which no light comes, if light comes from others. Otherwise, the warning of scenes
/// that nothing lights is enough.
fn warn_of_black(file: &File, lights: &[Light]) {
    let black = (1..).zip(lights).filter(|(_, light)| light.is_black());
    let numbers: Vec<String> = black.map(|(number, _)| number.to_string()).collect();
    if !numbers.is_empty() && numbers.len() < lights.len() {
        let path = file.source.path.display();
        tracing::warn!("{path}: no light comes from light {}, whose power or area is 0", numbers.join(", "));
    }
}

/// Checks a length, which must be at least 0 and at most [`MAX_COORDINATE`].
fn extent_of(name: &str, length: f32) -> Checked<f32> {
    within(name, length, 0.0, MAX_COORDINATE)
}

/// Reads the image of what is seen beyond the scene.
fn environment(file: &File, spec: &EnvironmentSpec) -> Checked<Environment> {
    let bytes = file.source.exact(&spec.file)?.bytes().map_err(|error| error.to_string())?;
    let (size, colours) = decode_colours(&Encoded { name: spec.file.clone(), bytes: bytes.into() })?;
    memory::require("the environment", colours.len() as u64 * ENVIRONMENT_BYTES)?;
    let rotation = within("rotation", spec.rotation.unwrap_or(0.0), -3600.0, 3600.0)?;
    let strength = within("strength", spec.strength.unwrap_or(1.0), 0.0, 1e6)?;
    let (environment, mended) = Environment::new(size, colours, (rotation, strength))?;
    if let Some(message) = mended.message() {
        tracing::warn!("{}: environment `{}` {message}", file.source.path.display(), spec.file);
    }
    Ok(environment)
}

/// Returns the sky of its keys.
fn sky(spec: &SkySpec) -> Checked<Sky> {
    let up = up(spec.up.as_ref())?;
    let placed = match (spec.elevation, spec.direction) {
        (Some(elevation), None) => Sky::new([elevation, spec.azimuth.unwrap_or(0.0)], up)?,
        (None, Some(direction)) if spec.azimuth.is_none() => {
            let towards_sun = above_horizon(-unit("direction", direction)?, up)?;
            Sky { towards_sun, ..Sky::new([0.0; 2], up)? }
        }
        (None, None) => return Err("needs `elevation` or `direction` for the place of the sun".to_owned()),
        _ => return Err("has `direction` beside `elevation` or `azimuth`".to_owned()),
    };
    let placed = placed.with_turbidity(spec.turbidity.unwrap_or(Sky::TURBIDITY))?;
    let ground_albedo = colour("ground_albedo", spec.ground_albedo, placed.ground_albedo)?;
    if ground_albedo.max_element() > 1.0 {
        return Err(format!("ground_albedo = {:?} reflects more than all light", ground_albedo.to_array()));
    }
    let strength = within("strength", spec.strength.unwrap_or(1.0), 0.0, 1e6)?;
    Ok(Sky { ground_albedo, strength, has_sun: spec.sun.unwrap_or(true), ..placed })
}

/// Returns the axis that points up, +y where the key is absent.
fn up(word: Option<&String>) -> Checked<Up> {
    word.map_or(Ok(Up::Y), |word| word.parse()).map_err(|error| format!("up: {error}"))
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

/// Returns a camera. `origin` is the point of its file that is the origin of world space.
pub(crate) fn camera(spec: &CameraSpec, origin: DVec3) -> Checked<Camera> {
    let camera = Camera {
        eye: point("eye", spec.eye, origin)?,
        target: point("target", spec.target, origin)?,
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

/// Checks a point of a file, which must be finite and lie within [`MAX_COORDINATE`]. Returns it in world space, whose
/// origin is another point of the file.
fn point(name: &str, value: [f64; 3], origin: DVec3) -> Checked<Vec3> {
    let point = finite(name, value)?;
    if point.abs().max_element() <= f64::from(MAX_COORDINATE) {
        Ok((point - origin).as_vec3())
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
    let threshold = within("denoise_threshold", threshold, 0.0, RenderOptions::MOST_THRESHOLD)?;
    let is_metered = spec.metered.unwrap_or(false);
    if is_metered && spec.exposure.is_some() {
        return Err("has both `exposure` and `metered = true`".to_owned());
    }
    let samples = count("samples", spec.samples, defaults.samples, SampleRange::MOST)?;
    let max_depth = count("max_depth", spec.max_depth, defaults.max_depth, RenderOptions::MOST_DEPTH)?;
    let filter = Denoise::Paper { threshold };
    let integrator = spec.integrator.as_ref().map(|word| word.parse()).transpose();
    let integrator = integrator.map_err(|e| format!("integrator: {e}"))?;
    // What the file states is for the integrator that it states. If it states none, it is for both.
    let is_for_paths = integrator != Some(Integrator::Whitted);
    let of_paths = PathDefaults {
        max_depth: if is_for_paths && spec.max_depth.is_some() { max_depth } else { defaults.of_paths.max_depth },
        samples: if is_for_paths && spec.samples.is_some() { samples } else { defaults.of_paths.samples },
        denoise: match spec.denoise.filter(|_| is_for_paths) {
            Some(SceneDenoise::Paper) => filter,
            Some(SceneDenoise::Off) => Denoise::Off,
            Some(SceneDenoise::Edge) => Denoise::Edge,
            None => defaults.of_paths.denoise,
        },
    };
    Ok(RenderDefaults {
        integrator: integrator.unwrap_or(defaults.integrator),
        of_paths,
        width: count("width", spec.width, defaults.width, RenderOptions::MOST_SIDE)?,
        height: count("height", spec.height, defaults.height, RenderOptions::MOST_SIDE)?,
        max_depth,
        tonemap: match &spec.tonemap {
            Some(word) => word.parse().map_err(|e| format!("tonemap: {e}"))?,
            None => defaults.tonemap,
        },
        samples,
        exposure: within("exposure", spec.exposure.unwrap_or(defaults.exposure), 1e-6, 1e6)?,
        is_metered,
        denoise: match spec.denoise.unwrap_or(SceneDenoise::Paper) {
            SceneDenoise::Off => Denoise::Off,
            SceneDenoise::Paper => filter,
            // It filters paths only. Other frames of the scene have the default filter.
            SceneDenoise::Edge if is_for_paths => filter,
            SceneDenoise::Edge => return Err("denoise = \"edge\" needs integrator = \"path\"".to_owned()),
        },
    })
}
