//! The keys of a scene file, as serde reads them. `assemble` checks the values.

use std::collections::BTreeMap;

use serde::Deserialize;
use toml::{Spanned, Table};

use super::keyframes;
use crate::scene::{
    formats::material_spec::MaterialSpec,
    meshes::generate::Generator,
    model::{
        RayKinds,
        error::Checked,
        material::within,
        transform::{MovingTransform, TransformSpec},
    },
};

/// A scene file. Vectors are arrays of three numbers; colours are linear RGB.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Description {
    /// Camera, as a table that `KeyedTable::new` reads; where absent, and without `cameras`, `standard` chooses one.
    pub camera: Option<Spanned<Table>>,
    /// Cameras, as such tables that have a `name`. Without `camera`, the first one is the scene's.
    #[serde(default)]
    pub cameras: Vec<Spanned<Table>>,
    /// Lights, as tables that `KeyedTable::new` reads; without any and without `ambient`, `standard` chooses lights,
    /// `ambient` and, where absent, `background`.
    #[serde(default)]
    pub light: Vec<Spanned<Table>>,
    /// Irradiance that every point receives, weighted by Ka; black where absent.
    pub ambient: Option<Spanned<AmbientSpec>>,
    /// Radiance of rays that leave the scene; black where absent.
    pub background: Option<Spanned<[f32; 3]>>,
    /// Studio that surfaces mirror, by the direction towards its viewer.
    pub studio: Option<Spanned<[f32; 3]>>,
    /// Image of what rays see that leave the scene, for `path`.
    pub environment: Option<Spanned<EnvironmentSpec>>,
    /// The sky and its sun, for `path`, in place of `environment`.
    pub sky: Option<Spanned<SkySpec>>,
    /// Whether camera rays pass through back faces of single-sided materials, as `--cull` takes it: `auto` or `off`.
    pub cull: Option<Spanned<String>>,
    /// Presets in place of materials, as `--material` takes them.
    pub replace: Option<Spanned<Vec<String>>>,
    #[serde(default)]
    pub materials: BTreeMap<String, Spanned<MaterialSpec>>,
    /// Meshes, as tables that `MeshSpec::new` reads.
    #[serde(default)]
    pub mesh: Vec<Spanned<Table>>,
    pub render: Option<Spanned<RenderSpec>>,
}

/// Ambient light: one colour, or two that are blended by the normal's coordinate along `up`.
#[derive(Debug, Deserialize)]
#[serde(untagged, expecting = "expected a colour, or a table of `sky`, `ground` and perhaps `up`")]
pub(crate) enum AmbientSpec {
    Even([f32; 3]),
    Hemispheres(HemispheresSpec),
}

/// Irradiance of surfaces that face up, and of those that face down.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct HemispheresSpec {
    pub sky: [f32; 3],
    pub ground: [f32; 3],
    /// `y` or `z`; `y` where absent.
    pub up: Option<String>,
}

/// A camera in world space.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct CameraSpec {
    /// In double precision, since the scene may be moved to the origin.
    pub eye: [f64; 3],
    pub target: [f64; 3],
    pub up: Option<[f32; 3]>,
    /// Angle between the picture's lower and upper edge, degrees; 45 where absent.
    pub vertical_fov: Option<f32>,
    /// Distance between the picture's lower and upper edge, world units; makes the camera orthographic.
    pub orthographic_height: Option<f32>,
}

#[derive(Debug, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub(crate) enum LightSpec {
    /// A point light, whose irradiance falls with the square of the distance.
    Point { position: [f64; 3], intensity: [f32; 3] },
    /// A point light that shines into a cone about `direction`: whole up to `inner_angle` from it, dark beyond
    /// `outer_angle`, both in degrees. In double precision, angles stand for every cosine of single precision.
    Spot { position: [f64; 3], direction: [f32; 3], intensity: [f32; 3], inner_angle: f64, outer_angle: f64 },
    /// A light whose rays all travel along `direction`. With an `angle`, in degrees, it is seen as a disk by `path`.
    Directional { direction: [f32; 3], irradiance: [f32; 3], angle: Option<f32> },
    /// A rectangle that shines along `direction`, for `path`. Its height is along `up`, as far as that is possible; +y
    /// where absent.
    Rectangle {
        position: [f64; 3],
        direction: [f32; 3],
        up: Option<[f32; 3]>,
        width: f32,
        height: f32,
        radiance: [f32; 3],
    },
    /// A disk that shines along `direction`, for `path`.
    Disk { position: [f64; 3], direction: [f32; 3], radius: f32, radiance: [f32; 3] },
    /// A sphere, for `path`.
    Sphere { position: [f64; 3], radius: f32, radiance: [f32; 3] },
}

/// The image of what rays see that leave the scene.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct EnvironmentSpec {
    /// HDR or EXR, equirectangular; relative to the scene file's folder.
    pub file: String,
    /// Turn about +y, counter-clockwise as seen from above, degrees; 0 where absent.
    pub rotation: Option<f32>,
    /// Factor on the image's radiance; 1 where absent.
    pub strength: Option<f32>,
}

/// The sky. The place of its sun is stated as `elevation` and perhaps `azimuth`, or as `direction`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SkySpec {
    /// Angle of the sun above the horizon, degrees.
    pub elevation: Option<f32>,
    /// Degrees from -z clockwise as seen from above, or from +y if `up` is `z`; 0 where absent.
    pub azimuth: Option<f32>,
    /// Direction in which the sun's light travels.
    pub direction: Option<[f32; 3]>,
    pub turbidity: Option<f32>,
    pub ground_albedo: Option<[f32; 3]>,
    /// Factor on all radiance; 1 where absent.
    pub strength: Option<f32>,
    /// Whether the sun shines; true where absent.
    pub sun: Option<bool>,
    /// `y` or `z`; `y` where absent.
    pub up: Option<String>,
}

/// Options of rendering, which the command line may override.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RenderSpec {
    pub width: Option<u32>,
    pub height: Option<u32>,
    /// `whitted` or `path`; where absent, `path` if surfaces or an environment light the scene.
    pub integrator: Option<String>,
    pub max_depth: Option<u32>,
    /// Number of samples per pixel.
    pub samples: Option<u32>,
    pub exposure: Option<f32>,
    /// Whether the exposure is measured in the first view, for lights in physical units; an error beside `exposure`.
    pub metered: Option<bool>,
    /// `linear`, `agx`, `aces` or `neutral`.
    pub tonemap: Option<String>,
    pub denoise: Option<SceneDenoise>,
    pub denoise_threshold: Option<f32>,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum SceneDenoise {
    Off,
    Paper,
    Edge,
}

/// One `[[mesh]]` table.
#[derive(Debug)]
pub(crate) struct MeshSpec {
    pub source: Source,
    pub common: CommonSpec,
    /// Where the mesh is: `transform`, or what `keys` make of it.
    pub place: MovingTransform,
}

/// Source of a mesh's triangles.
#[derive(Debug)]
pub(crate) enum Source {
    /// A mesh file.
    File(FileSpec),
    /// A generator that makes the mesh from a few parameters.
    Generator(Generator),
}

/// Keys that meshes from files and from generators have in common.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct CommonSpec {
    transform: TransformSpec,
    /// What the transform is at some times.
    keys: Vec<Table>,
    /// A NumPy file of transforms, each of which places the mesh once; relative to the scene file's folder.
    pub instances: Option<String>,
    /// The kinds of rays that meet the mesh; all of them where absent.
    pub rays: Option<Vec<RayKind>>,
    /// Name of the material of the whole mesh. Where it is absent, a mesh from a file keeps its own materials.
    pub material: Option<String>,
    /// Names of materials, one for each slot of the mesh (a room's walls, a checkered plane's fields). If there are
    /// fewer names than slots, they repeat.
    pub materials: Vec<String>,
    /// If false, every face is shaded with its own plane's normal; true where absent.
    pub smooth: Option<bool>,
    /// Factors on the texture coordinates u and v; 1 and 1 where absent.
    pub uv_scale: Option<[f32; 2]>,
    /// Whether materials of the mesh file take the terms that materials of the same names in the scene file state;
    /// false where absent.
    #[serde(rename = "override")]
    pub overrides: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum RayKind {
    Camera,
    Shadow,
    Other,
}

impl CommonSpec {
    /// Returns the rays that meet the mesh.
    pub fn rays(&self) -> Checked<RayKinds> {
        let Some(kinds) = &self.rays else { return Ok(RayKinds::ALL) };
        if kinds.is_empty() {
            return Err("`rays` is empty: no ray would meet the mesh".to_owned());
        }
        let has = |kind| kinds.contains(&kind);
        Ok(RayKinds { camera: has(RayKind::Camera), shadow: has(RayKind::Shadow), other: has(RayKind::Other) })
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FileSpec {
    /// Relative to the scene file's folder.
    pub file: String,
    /// Angle between two faces, in degrees, beyond which their common edge is sharp. Applies to faces without
    /// normals.
    pub crease: Option<f32>,
    /// Scene of a glTF file by its name or its index, counted from 0; the file's default scene where absent.
    pub scene: Option<String>,
    /// Point of the file that becomes the origin of the mesh, in double precision; 0 where absent.
    pub origin: Option<[f64; 3]>,
}

/// Largest coordinate of an origin. Farther away, double precision is coarse, too.
const MAX_ORIGIN: f64 = 1e12;

const COMMON_KEYS: [&str; 9] =
    ["transform", "keys", "instances", "rays", "material", "materials", "smooth", "uv_scale", "override"];

impl MeshSpec {
    /// Splits a mesh's table into the keys that all meshes have and those of its own kind. An unknown key is an
    /// error.
    pub fn new(mut table: Table) -> Checked<Self> {
        let common = COMMON_KEYS.iter().filter_map(|key| table.remove_entry(*key)).collect();
        let mut common: CommonSpec = read(common)?;
        let place = keyframes::moving(&common.transform, std::mem::take(&mut common.keys))?;
        if common.material.is_some() && !common.materials.is_empty() {
            return Err("has both `material` and `materials`".to_owned());
        }
        if common.overrides && (common.material.is_some() || !common.materials.is_empty()) {
            return Err("has both `override` and `material` or `materials`".to_owned());
        }
        let source = match (table.contains_key("file"), table.contains_key("generator")) {
            (true, false) => {
                let file: FileSpec = read(table)?;
                if let Some(origin) = file.origin.filter(|origin| !origin.iter().all(|x| x.abs() <= MAX_ORIGIN)) {
                    return Err(format!("origin = {origin:?} is not within {MAX_ORIGIN:e}"));
                }
                file.crease.map(|crease| within("crease", crease, 0.0, 180.0)).transpose()?;
                Source::File(file)
            }
            (false, true) if common.overrides => {
                return Err("has `override`, but only mesh files have materials of their own".to_owned());
            }
            (false, true) => Source::Generator(read(table)?),
            (true, true) => return Err("has both `file` and `generator`".to_owned()),
            (false, false) => return Err("has neither `file` nor `generator`".to_owned()),
        };
        Ok(Self { source, common, place })
    }
}

/// Reads a table.
pub(crate) fn read<T: serde::de::DeserializeOwned>(table: Table) -> Checked<T> {
    table.try_into().map_err(|e: toml::de::Error| e.message().to_owned())
}
