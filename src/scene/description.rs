//! What a scene file may say, as serde reads it. Checks of values follow in `assemble`.

use std::collections::BTreeMap;

use serde::Deserialize;
use toml::{Spanned, Table};

use super::{
    error::Checked,
    generate::Generator,
    material::MaterialSpec,
    obj::{DEFAULT_CREASE, Shading},
    transform::TransformSpec,
};

/// A scene file. Vectors are arrays of three numbers; colours are linear RGB.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Description {
    /// Absent: one that frames the meshes.
    pub camera: Option<Spanned<CameraSpec>>,
    #[serde(default)]
    pub light: Vec<Spanned<LightSpec>>,
    /// Irradiance from everywhere, weighted by Ka; black where absent.
    pub ambient: Option<Spanned<[f32; 3]>>,
    /// Radiance of rays that leave the scene; black where absent.
    pub background: Option<Spanned<[f32; 3]>>,
    #[serde(default)]
    pub materials: BTreeMap<String, Spanned<MaterialSpec>>,
    /// Read further by `MeshSpec::new`.
    #[serde(default)]
    pub mesh: Vec<Spanned<Table>>,
    pub render: Option<Spanned<RenderSpec>>,
}

/// World space.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CameraSpec {
    pub eye: [f32; 3],
    pub target: [f32; 3],
    pub up: Option<[f32; 3]>,
    /// Degrees between the picture's lower and upper edge.
    pub vertical_fov: Option<f32>,
}

#[derive(Debug, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum LightSpec {
    /// Irradiance falls with the square of distance.
    Point { position: [f32; 3], intensity: [f32; 3] },
    /// The way the light travels.
    Directional { direction: [f32; 3], irradiance: [f32; 3] },
}

/// What the command line may override.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RenderSpec {
    pub width: Option<u32>,
    pub height: Option<u32>,
    pub max_depth: Option<u32>,
    pub exposure: Option<f32>,
    /// linear, agx or aces.
    pub tonemap: Option<String>,
    pub denoise: Option<DenoiseWord>,
    pub denoise_threshold: Option<f32>,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum DenoiseWord {
    Off,
    Paper,
}

/// One `[[mesh]]`.
#[derive(Debug)]
pub(super) struct MeshSpec {
    pub source: Source,
    pub common: CommonSpec,
}

/// Where a mesh comes from.
#[derive(Debug)]
pub(super) enum Source {
    /// Relative to the scene file's folder.
    File { path: String, shading: Shading },
    /// Made from parameters.
    Generator(Generator),
}

/// What files and generators have in common.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct CommonSpec {
    pub transform: TransformSpec,
    /// One for the whole mesh; a file's own materials otherwise.
    pub material: Option<String>,
    /// One a slot of a generator that has several (a room's walls, a checkered plane's fields), used in rotation.
    pub materials: Vec<String>,
    /// False: every face shows its own plane.
    pub smooth: Option<bool>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct FileSpec {
    file: String,
    /// Degrees beyond which an edge is sharp; only for files without normals.
    crease: Option<f32>,
}

const COMMON_KEYS: [&str; 4] = ["transform", "material", "materials", "smooth"];

impl MeshSpec {
    /// Splits a mesh's table into what all meshes have and what this kind has. No key is left over unread.
    pub fn new(mut table: Table) -> Checked<Self> {
        let common = COMMON_KEYS.iter().filter_map(|key| table.remove_entry(*key)).collect();
        let common: CommonSpec = read(common)?;
        if common.material.is_some() && !common.materials.is_empty() {
            return Err("has both `material` and `materials`".to_owned());
        }
        let source = match (table.contains_key("file"), table.contains_key("generator")) {
            (true, false) => {
                let FileSpec { file: path, crease } = read(table)?;
                let crease = super::material::within("crease", crease.unwrap_or(DEFAULT_CREASE), 0.0, 180.0)?;
                Source::File { path, shading: Shading { smooth: common.smooth.unwrap_or(true), crease } }
            }
            (false, true) => Source::Generator(read(table)?),
            (true, true) => return Err("has both `file` and `generator`".to_owned()),
            (false, false) => return Err("has neither `file` nor `generator`".to_owned()),
        };
        Ok(Self { source, common })
    }
}

fn read<T: serde::de::DeserializeOwned>(table: Table) -> Checked<T> {
    table.try_into().map_err(|e: toml::de::Error| e.message().to_owned())
}
