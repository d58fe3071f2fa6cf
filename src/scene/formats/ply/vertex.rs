//! Vertices of PLY files, with the colours and texture coordinates that some have.

use std::fmt;

use glam::{DVec3, Vec2, Vec3, Vec4};
use serde::{
    Deserialize, Deserializer,
    de::{IgnoredAny, MapAccess, Visitor},
};
use serde_ply::{ElementDef, PlyReader, PropertyType, ScalarType};

use super::{Counted, text};
use crate::scene::model::{error::Checked, texture::linear_of_srgb};

/// Vertices; a list that the file lacks is empty.
#[derive(Debug, Default)]
pub struct Vertices {
    pub positions: Vec<Vec3>,
    /// Unit normals, or zero.
    pub normals: Vec<Vec3>,
    /// Linear RGB and opacity.
    pub colours: Vec<Vec4>,
    /// Whether all opacities of the file are 0, which then count as 1: the surface would never be seen.
    pub would_be_invisible: bool,
    /// Texture coordinates, (0, 0) at the upper left corner of the image.
    pub uvs: Vec<Vec2>,
}

/// Point with its normal, which is zero if the file has none.
#[derive(Deserialize)]
struct Plain {
    x: f64,
    y: f64,
    z: f64,
    #[serde(default)]
    nx: f32,
    #[serde(default)]
    ny: f32,
    #[serde(default)]
    nz: f32,
}

/// Names of properties. Writers use several for one thing.
#[derive(Clone, Copy, Deserialize)]
#[serde(field_identifier, rename_all = "snake_case")]
enum Property {
    X,
    Y,
    Z,
    Nx,
    Ny,
    Nz,
    #[serde(alias = "diffuse_red", alias = "r")]
    Red,
    #[serde(alias = "diffuse_green", alias = "g")]
    Green,
    #[serde(alias = "diffuse_blue", alias = "b")]
    Blue,
    #[serde(alias = "diffuse_alpha", alias = "a")]
    Alpha,
    #[serde(alias = "u", alias = "texture_u")]
    S,
    #[serde(alias = "v", alias = "texture_v")]
    T,
    #[serde(other)]
    Other,
}

/// Number of properties that are read.
const N_PROPERTIES: usize = Property::Other as usize;
/// Names of the red part of a colour, and of the first texture coordinate.
pub const REDS: [&str; 3] = ["red", "diffuse_red", "r"];
const FIRST_UVS: [&str; 3] = ["s", "u", "texture_u"];

/// The coordinates of a vertex, and its numbers by property. Those of the coordinates are 0.
struct Painted(DVec3, [f32; N_PROPERTIES]);

impl<'de> Deserialize<'de> for Painted {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(PaintedVisitor)
    }
}

struct PaintedVisitor;

impl<'de> Visitor<'de> for PaintedVisitor {
    type Value = Painted;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a vertex")
    }

    fn visit_map<M: MapAccess<'de>>(self, mut map: M) -> Result<Painted, M::Error> {
        let (mut point, mut numbers) = (DVec3::ZERO, [0.0; N_PROPERTIES]);
        while let Some(property) = map.next_key::<Property>()? {
            match property {
                Property::Other => drop(map.next_value::<IgnoredAny>()?),
                Property::X | Property::Y | Property::Z => point[property as usize] = map.next_value()?,
                property => numbers[property as usize] = map.next_value()?,
            }
        }
        Ok(Painted(point, numbers))
    }
}

impl Vertices {
    /// Returns the memory that a vertex takes while vertices are read, bytes: its row, and what the row becomes.
    pub fn n_row_bytes(element: &ElementDef) -> usize {
        let has_more = has_more(element);
        let row = if has_more { size_of::<Painted>() } else { size_of::<Plain>() };
        let more = if has_more { size_of::<Vec4>() + size_of::<Vec2>() } else { 0 };
        row + 2 * size_of::<Vec3>() + more
    }

    /// Reads the vertices, the element that comes next in the file. `origin` is subtracted from their coordinates.
    pub fn read(reader: &mut PlyReader<Counted>, element: &ElementDef, origin: DVec3) -> Checked<Self> {
        let failed = |error| format!("element `vertex`: {}", text(&error));
        let has = |name: &&str| element.has_property(name);
        let has_normals = ["nx", "ny", "nz"].iter().all(has);
        let (red, has_uvs) = (REDS.iter().find(|name| has(name)), FIRST_UVS.iter().any(has));
        let mut vertices = Self::default();
        if red.is_none() && !has_uvs {
            let plain: Vec<Plain> = reader.next_element().map_err(failed)?;
            vertices.positions = plain.iter().map(|v| (DVec3::new(v.x, v.y, v.z) - origin).as_vec3()).collect();
            if has_normals {
                vertices.normals = plain.iter().map(|v| Vec3::new(v.nx, v.ny, v.nz).normalize_or_zero()).collect();
            }
            return Ok(vertices);
        }
        let painted: Vec<Painted> = reader.next_element().map_err(failed)?;
        let three = |p: &Painted, first: Property| Vec3::from_slice(&p.1[first as usize..]);
        vertices.positions = painted.iter().map(|p| (p.0 - origin).as_vec3()).collect();
        if has_normals {
            vertices.normals = painted.iter().map(|p| three(p, Property::Nx).normalize_or_zero()).collect();
        }
        if let Some(red) = red {
            let has_alpha = ["alpha", "diffuse_alpha", "a"].iter().any(has);
            let colours = painted.iter().map(|p| Vec4::from_slice(&p.1[Property::Red as usize..]));
            vertices.would_be_invisible = has_alpha && colours.clone().all(|colour| colour.w == 0.0);
            let has_alpha = has_alpha && !vertices.would_be_invisible;
            let one = largest_colour(element, red, colours.clone().map(Vec4::truncate));
            let linear = |colour: Vec4| {
                let rgb = Vec3::from_array((colour.truncate() / one).to_array().map(linear_of_srgb));
                let has_opacity = has_alpha && colour.w.is_finite();
                rgb.extend(if has_opacity { (colour.w / one).clamp(0.0, 1.0) } else { 1.0 })
            };
            vertices.colours = colours.map(linear).collect();
        }
        if has_uvs {
            let uv = |p: &Painted| upper_left(p.1[Property::S as usize], p.1[Property::T as usize]);
            vertices.uvs = painted.iter().map(uv).collect();
        }
        Ok(vertices)
    }
}

/// Returns whether vertices have colours or texture coordinates.
pub fn has_more(element: &ElementDef) -> bool {
    REDS.iter().chain(&FIRST_UVS).any(|name| element.has_property(name))
}

/// Returns the number that stands for 1 in the colours: the largest of an integer type, 1 for floats, or 255 for floats
/// that exceed 1.
pub fn largest_colour(element: &ElementDef, red: &str, mut colours: impl Iterator<Item = Vec3>) -> f32 {
    let property = element.properties.iter().find(|property| property.name == red);
    match property.map(|property| &property.property_type) {
        Some(PropertyType::Scalar(ScalarType::F32 | ScalarType::F64)) => {
            if colours.any(|colour| colour.max_element() > 1.0) { 255.0 } else { 1.0 }
        }
        Some(PropertyType::Scalar(ScalarType::I8)) => 127.0,
        Some(PropertyType::Scalar(ScalarType::U16)) => 65_535.0,
        _ => 255.0,
    }
}

/// Returns texture coordinates whose origin is the upper left corner of the image. PLY files count from the lower left
/// one. Numbers that are not finite become 0.
pub fn upper_left(u: f32, v: f32) -> Vec2 {
    let uv = Vec2::new(u, 1.0 - v);
    if uv.is_finite() { uv } else { Vec2::ZERO }
}
