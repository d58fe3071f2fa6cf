//! PLY files (Polygon File Format, also called Stanford Triangle Format), as text and as binary in both byte orders.
//! The elements `vertex` (x, y, z and, if all three are there, nx, ny, nz) and `face` (a list of indices) are read.
//! Polygons are cut into fans. Coordinates are taken as they are: the format states neither a unit nor an axis that
//! points up.

use std::path::Path;

use glam::Vec3;
use serde::Deserialize;
use serde_ply::{DeserializeError, ElementDef, PlyReader};

use super::{
    error::Checked,
    mesh::Mesh,
    needs::require_for_triangles,
    smooth::{Shading, smooth_normals},
};

/// Vertex; its normal is zero if the file has none.
#[derive(Deserialize)]
struct Vertex {
    x: f32,
    y: f32,
    z: f32,
    #[serde(default)]
    nx: f32,
    #[serde(default)]
    ny: f32,
    #[serde(default)]
    nz: f32,
}

/// Polygon as the indices of its vertices. Writers use either of the two names.
#[derive(Deserialize)]
struct Polygon {
    #[serde(alias = "vertex_index")]
    vertex_indices: Vec<u32>,
}

/// Row of an element that is not read.
#[derive(Deserialize)]
struct Skipped {}

/// The names of a face's list of indices.
const INDICES: [&str; 2] = ["vertex_indices", "vertex_index"];
/// Properties of vertices that are not shown, with what a warning calls them.
const NOT_SHOWN: [(&str, &str); 4] = [
    ("red", "vertex colours"),
    ("diffuse_red", "vertex colours"),
    ("s", "texture coordinates"),
    ("u", "texture coordinates"),
];

/// Makes a mesh of a file's content. Its faces have slot 0.
pub(super) fn parse_ply(path: &Path, bytes: &[u8], shading: Shading, n_loaded: usize) -> Checked<Mesh> {
    let mut reader = PlyReader::from_reader(bytes).map_err(|error| format!("is no PLY file: {}", text(&error)))?;
    let elements = reader.header().elem_defs.clone();
    check(&elements)?;
    warn(path, &elements);
    let (mut vertices, mut polygons): (Vec<Vertex>, Vec<Polygon>) = (Vec::new(), Vec::new());
    for element in &elements {
        let failed = |error| format!("element `{}`: {}", element.name.escape_debug(), text(&error));
        match element.name.as_str() {
            "vertex" => vertices = reader.next_element().map_err(failed)?,
            "face" => {
                // A row takes at least one byte, so a file has no more rows than bytes, whatever its header states.
                let n_faces = element.count.min(bytes.len());
                require_for_triangles(n_loaded as u64, n_faces as u64)?;
                polygons = reader.next_element().map_err(failed)?;
            }
            // Rows without properties take no bytes, and a header can promise any number of them.
            _ if element.properties.is_empty() && element.count > 0 => {
                return Err(format!("element `{}` has no properties", element.name.escape_debug()));
            }
            _ => drop(reader.next_element::<Vec<Skipped>>().map_err(failed)?),
        }
    }
    let n_triangles: usize = polygons.iter().map(|polygon| polygon.vertex_indices.len().saturating_sub(2)).sum();
    require_for_triangles(n_loaded as u64, n_triangles as u64)?;
    let has_normals = elements.iter().any(|element| element.name == "vertex" && has_all(element, ["nx", "ny", "nz"]));
    mesh(&vertices, &polygons, has_normals, shading)
}

fn has_all<const N: usize>(element: &ElementDef, names: [&str; N]) -> bool {
    names.iter().all(|name| element.has_property(name))
}

/// Refuses files without the elements that a mesh needs.
fn check(elements: &[ElementDef]) -> Checked<()> {
    let element = |name: &str| elements.iter().find(|element| element.name == name);
    let vertex = element("vertex").ok_or("has no element `vertex`")?;
    if !has_all(vertex, ["x", "y", "z"]) {
        return Err("its element `vertex` lacks x, y or z".to_owned());
    }
    match element("face") {
        Some(face) if INDICES.iter().any(|name| face.has_property(name)) => Ok(()),
        Some(_) => Err(format!("its element `face` lacks the list `{}`", INDICES[0])),
        None if element("tristrips").is_some() => {
            Err("has triangle strips and no element `face`: strips are not read".to_owned())
        }
        None => Err("has no element `face`: clouds of points have no triangles".to_owned()),
    }
}

/// Warns of properties that change what the file looks like and that are not read.
fn warn(path: &Path, elements: &[ElementDef]) {
    let vertex = elements.iter().filter(|element| element.name == "vertex");
    let mut names: Vec<_> = vertex
        .flat_map(|vertex| NOT_SHOWN.iter().filter(|(property, _)| vertex.has_property(property)))
        .map(|(_, what)| *what)
        .collect();
    names.dedup();
    if !names.is_empty() {
        tracing::warn!("{}: {} are not shown", path.display(), names.join(" and "));
    }
}

fn mesh(vertices: &[Vertex], polygons: &[Polygon], has_normals: bool, shading: Shading) -> Checked<Mesh> {
    let mut mesh = Mesh { positions: vertices.iter().map(|v| Vec3::new(v.x, v.y, v.z)).collect(), ..Mesh::default() };
    for (polygon_ix, Polygon { vertex_indices }) in polygons.iter().enumerate() {
        if let Some(ix) = vertex_indices.iter().find(|ix| **ix as usize >= vertices.len()) {
            let n = vertices.len();
            return Err(format!("face {polygon_ix} (counted from 0) has vertex {ix}, but there are {n} vertices"));
        }
        if let [first, rest @ ..] = &vertex_indices[..] {
            mesh.faces.extend(rest.array_windows().map(|[second, third]| [*first, *second, *third]));
        }
    }
    mesh.slots = vec![0; mesh.faces.len()];
    mesh.normals = match has_normals && shading.smooth {
        true => {
            let normal = |ix: u32| {
                let Vertex { nx, ny, nz, .. } = vertices[ix as usize];
                Vec3::new(nx, ny, nz).normalize_or_zero()
            };
            mesh.faces.iter().map(|face| face.map(normal)).collect()
        }
        false => smooth_normals(&mesh.positions, &mesh.faces, shading),
    };
    Ok(mesh)
}

/// The reader's error without its prefix, in one line.
fn text(DeserializeError(error): &DeserializeError) -> String {
    match error.kind() {
        std::io::ErrorKind::UnexpectedEof => "the file ends too early".to_owned(),
        _ => error.to_string().escape_debug().to_string(),
    }
}
