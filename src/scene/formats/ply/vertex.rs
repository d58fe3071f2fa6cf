//! Vertices of PLY files, with the colours and texture coordinates that some have.

use glam::{DVec3, Vec2, Vec3, Vec4};

use super::{
    header::{Element, Number},
    rows::{Row, Rows},
};
use crate::scene::model::texture::linear_of_srgb;

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

// Writers use several names for one thing.
const ALPHAS: [&str; 3] = ["alpha", "diffuse_alpha", "a"];
const UVS: [[&str; 3]; 2] = [["s", "u", "texture_u"], ["t", "v", "texture_v"]];

/// Returns the indices of the properties x, y and z, if vertices have all three.
pub fn coordinates(vertex: &Element) -> Option<[usize; 3]> {
    three(vertex, ["x", "y", "z"])
}

fn three(vertex: &Element, names: [&str; 3]) -> Option<[usize; 3]> {
    let [a, b, c] = names.map(|name| vertex.number(&[name]));
    Some([a?, b?, c?])
}

impl Vertices {
    /// Returns the memory that a vertex takes, bytes.
    pub fn n_row_bytes(vertex: &Element) -> usize {
        let has_uvs = vertex.number(&UVS[0]).is_some();
        let has_normals = three(vertex, ["nx", "ny", "nz"]).is_some();
        let n_vectors = 1 + usize::from(has_normals);
        let n_colours = usize::from(Colours::of(vertex).is_some());
        n_vectors * size_of::<Vec3>() + n_colours * size_of::<Vec4>() + usize::from(has_uvs) * size_of::<Vec2>()
    }

    /// Reads the vertices, which have coordinates. `origin` is subtracted from these.
    pub fn read(rows: &Rows, coordinates: [usize; 3], origin: DVec3) -> Self {
        let mut vertices = Self {
            positions: rows.map(|row| (DVec3::from_array(coordinates.map(|ix| row.number(ix))) - origin).as_vec3()),
            ..Self::default()
        };
        if let Some(normal) = three(rows.element, ["nx", "ny", "nz"]) {
            let normal = |row: Row| Vec3::from_array(normal.map(|ix| row.number(ix) as f32)).normalize_or_zero();
            vertices.normals = rows.map(normal);
        }
        if let Some(colours) = Colours::of(rows.element) {
            let one = colours.one(rows);
            let alpha = rows.element.number(&ALPHAS);
            vertices.would_be_invisible = alpha.is_some_and(|alpha| rows.all(|row| row.number(alpha) == 0.0));
            let alpha = alpha.filter(|_| !vertices.would_be_invisible);
            let opacity = |row: Row| {
                let alpha = alpha.map(|alpha| row.number(alpha) as f32).filter(|alpha| alpha.is_finite());
                alpha.map_or(1.0, |alpha| (alpha / one).clamp(0.0, 1.0))
            };
            vertices.colours = rows.map(|row| colours.linear(row, one).extend(opacity(row)));
        }
        let uvs = UVS.map(|names| rows.element.number(&names));
        if uvs[0].is_some() {
            vertices.uvs = rows.map(|row| {
                let [u, v] = uvs.map(|ix| ix.map_or(0.0, |ix| row.number(ix) as f32));
                upper_left(u, v)
            });
        }
        vertices
    }
}

/// Where the rows of an element have colours.
pub struct Colours {
    red: usize,
    green: Option<usize>,
    blue: Option<usize>,
}

impl Colours {
    /// Returns where an element has colours, if it has any.
    pub fn of(element: &Element) -> Option<Self> {
        let [red, green, blue] =
            [["red", "diffuse_red", "r"], ["green", "diffuse_green", "g"], ["blue", "diffuse_blue", "b"]]
                .map(|names| element.number(&names));
        Some(Self { red: red?, green, blue })
    }

    fn stated(&self, row: Row) -> Vec3 {
        let parts = [Some(self.red), self.green, self.blue];
        Vec3::from_array(parts.map(|ix| ix.map_or(0.0, |ix| row.number(ix) as f32)))
    }

    /// Returns the number that stands for 1: the largest of an integer type, 1 for floats, or 255 for floats that
    /// exceed 1.
    pub fn one(&self, rows: &Rows) -> f32 {
        match rows.element.properties[self.red].number {
            Number::F32 | Number::F64 if rows.all(|row| !(self.stated(row).max_element() > 1.0)) => 1.0,
            Number::I8 => 127.0,
            Number::U16 => 65_535.0,
            _ => 255.0,
        }
    }

    /// Returns the linear colour of a row.
    pub fn linear(&self, row: Row, one: f32) -> Vec3 {
        (self.stated(row) / one).map(linear_of_srgb)
    }
}

/// Returns texture coordinates whose origin is the upper left corner of the image. PLY files count from the lower left
/// one. Numbers that are not finite become 0.
pub fn upper_left(u: f32, v: f32) -> Vec2 {
    let uv = Vec2::new(u, 1.0 - v);
    if uv.is_finite() { uv } else { Vec2::ZERO }
}
