//! PLY files (Polygon File Format, also called Stanford Triangle Format), as text and as binary in both byte orders.
//! The elements `vertex`, `face` (a list of indices) and `tristrips` are read, and the comment `TextureFile`, by which
//! MeshLab names the image of the surface. Coordinates are taken as they are: the format states neither a unit nor an
//! axis that points up.

mod vertex;

use std::{
    fs,
    io::BufReader,
    path::{Path, PathBuf},
};

use glam::Vec2;
use serde::Deserialize;
use serde_ply::{DeserializeError, ElementDef, PlyReader};

use self::vertex::{Vertices, upper_left};
use super::{
    error::Checked,
    image_files::{ImageFiles, Images, View},
    material::MaterialSpec,
    mesh::Mesh,
    needs::require_for_triangles,
    obj::Library,
    outside::Access,
    polygon::Triangulator,
    smooth::{Shading, smooth_normals},
    texture::Texture,
};

/// Polygon as the indices of its vertices. Writers use either of the two names.
#[derive(Deserialize)]
struct Polygon {
    #[serde(alias = "vertex_index")]
    vertex_indices: Vec<u32>,
    /// Texture coordinates u and v of each corner, or nothing.
    #[serde(default)]
    texcoord: Vec<f32>,
    /// Number of the image that the polygon shows.
    #[serde(default)]
    texnumber: f64,
}

/// Strips of triangles as the indices of their vertices; -1 begins a new strip.
#[derive(Deserialize)]
struct Strips {
    #[serde(alias = "vertex_index")]
    vertex_indices: Vec<i64>,
}

/// Row of an element that is not read.
#[derive(Deserialize)]
struct Skipped {}

/// The names of a face's list of indices.
const INDICES: [&str; 2] = ["vertex_indices", "vertex_index"];

/// The elements of a file.
#[derive(Default)]
struct Elements {
    vertices: Vertices,
    polygons: Vec<Polygon>,
    strips: Vec<Strips>,
}

/// Makes a mesh of a file's content, and reads the images that it names. Its faces have the slot of their image.
pub(super) fn parse_ply(
    path: &Path,
    bytes: &[u8],
    shading: Shading,
    n_loaded: usize,
    access: Access,
) -> Checked<(Mesh, Library)> {
    let mut reader = PlyReader::from_reader(bytes).map_err(|error| format!("is no PLY file: {}", text(&error)))?;
    let header = reader.header().clone();
    check(&header.elem_defs)?;
    let elements = read(&mut reader, &header.elem_defs, bytes.len(), n_loaded)?;
    let n_of_polygons: usize = elements.polygons.iter().map(|p| p.vertex_indices.len().saturating_sub(2)).sum();
    let n_of_strips: usize = elements.strips.iter().map(|strips| strips.vertex_indices.len().saturating_sub(2)).sum();
    require_for_triangles(n_loaded as u64, (n_of_polygons + n_of_strips) as u64)?;
    let names: Vec<&str> = texture_files(&header.comments).collect();
    let mesh = mesh(elements, names.len(), shading)?;
    let library = if mesh.uvs[0].is_empty() { Library::default() } else { library(path, &names, access) };
    Ok((mesh, library))
}

/// Reads the elements in the order of the file, of `n_bytes`.
fn read(reader: &mut PlyReader<&[u8]>, elements: &[ElementDef], n_bytes: usize, n_loaded: usize) -> Checked<Elements> {
    let mut found = Elements::default();
    for element in elements {
        let failed = |error| format!("element `{}`: {}", element.name.escape_debug(), text(&error));
        match element.name.as_str() {
            "vertex" => found.vertices = Vertices::read(reader, element)?,
            "face" => {
                // A row takes at least one byte, so a file has no more rows than bytes, whatever its header states.
                require_for_triangles(n_loaded as u64, element.count.min(n_bytes) as u64)?;
                found.polygons = reader.next_element().map_err(failed)?;
            }
            "tristrips" => found.strips = reader.next_element().map_err(failed)?,
            // Rows without properties take no bytes, and a header can promise any number of them.
            _ if element.properties.is_empty() && element.count > 0 => {
                return Err(format!("element `{}` has no properties", element.name.escape_debug()));
            }
            _ => drop(reader.next_element::<Vec<Skipped>>().map_err(failed)?),
        }
    }
    Ok(found)
}

/// Returns the names of images in the comments `TextureFile NAME`.
fn texture_files(comments: &[String]) -> impl Iterator<Item = &str> {
    comments.iter().filter_map(|comment| Some(comment.strip_prefix("TextureFile ")?.trim())).filter(|n| !n.is_empty())
}

/// Returns one material for each name of an image, which is its base colour. Warns of images that cannot be read.
fn library(path: &Path, names: &[&str], access: Access) -> Library {
    let reach = access.beside(path);
    let warn = |what: &str| tracing::warn!("{}: TextureFile is not shown: {}", path.display(), what.escape_debug());
    let mut files = ImageFiles::default();
    let mut add = |name: &&str| reach.find(reach.root, name).map(|file| files.add(file.path)).map_err(|e| warn(&e));
    let of_names: Vec<Option<usize>> = names.iter().map(|name| add(name).ok()).collect();
    let decoded = files.decode().into_iter().map(|image| image.map_err(|what| warn(&what)).ok()).collect();
    let mut images = Images::new(decoded);
    let mut material = |(name, file): (&&str, Option<usize>)| {
        let file = file.filter(|file| images.get(*file).is_some());
        let spec = MaterialSpec { kd: file.map(|_| [1.0; 3]), ..MaterialSpec::default() };
        let mut material = spec.material(name).expect("defaults are in range");
        material.maps.base_colour = file.map(|file| Texture::of_image(images.show(file, View::Plain)));
        material
    };
    let materials = names.iter().zip(of_names).map(&mut material).collect();
    Library { materials, images: images.finish() }
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
    for name in ["face", "tristrips"] {
        let has_list = |element: &ElementDef| INDICES.iter().any(|list| element.has_property(list));
        if element(name).is_some_and(|element| !has_list(element)) {
            return Err(format!("its element `{name}` lacks the list `{}`", INDICES[0]));
        }
    }
    match element("face").or(element("tristrips")) {
        Some(_) => Ok(()),
        None => Err("has no element `face`: clouds of points have no triangles".to_owned()),
    }
}

/// Makes the mesh. `n_images`: the number of images that polygons can show.
fn mesh(elements: Elements, n_images: usize, shading: Shading) -> Checked<Mesh> {
    let Elements { vertices, polygons, strips } = elements;
    let mut mesh = Mesh::default();
    let has_own_uvs = |polygon: &Polygon| polygon.texcoord.len() == 2 * polygon.vertex_indices.len();
    let has_uvs = !vertices.uvs.is_empty() || polygons.iter().any(|p| !p.texcoord.is_empty() && has_own_uvs(p));
    let uv_of_vertex = |ix: u32| vertices.uvs.get(ix as usize).copied().unwrap_or(Vec2::ZERO);
    let mut triangulator = Triangulator::default();
    let mut corners = Vec::new();
    for (polygon_ix, polygon) in polygons.iter().enumerate() {
        let indices = &polygon.vertex_indices;
        let what = || format!("face {polygon_ix} (counted from 0)");
        check_indices(indices.iter().map(|ix| i64::from(*ix)), vertices.positions.len(), what)?;
        corners.clear();
        corners.extend(indices.iter().map(|ix| vertices.positions[*ix as usize]));
        // A number of an image that is out of range is a face without one.
        let is_image = (0.0..n_images as f64).contains(&polygon.texnumber);
        let slot = if is_image { polygon.texnumber as u32 } else { n_images as u32 };
        triangulator.cut(&corners, |triangle| {
            mesh.faces.push(triangle.map(|corner| indices[corner]));
            mesh.slots.push(slot);
            if has_uvs && has_own_uvs(polygon) {
                let own = |corner: usize| upper_left(polygon.texcoord[2 * corner], polygon.texcoord[2 * corner + 1]);
                mesh.uvs[0].push(triangle.map(own));
            } else if has_uvs {
                mesh.uvs[0].push(triangle.map(|corner| uv_of_vertex(indices[corner])));
            }
        });
    }
    for strip in strips.iter().flat_map(|strips| strips.vertex_indices.split(|ix| *ix == -1)) {
        check_indices(strip.iter().copied(), vertices.positions.len(), || "a triangle strip".to_owned())?;
        for (ix, [a, b, c]) in strip.array_windows().enumerate().filter(|(_, [a, b, c])| a != b && b != c && c != a) {
            let face = if ix % 2 == 0 { [a, b, c] } else { [b, a, c] }.map(|ix| *ix as u32);
            mesh.faces.push(face);
            mesh.slots.push(0);
            if has_uvs {
                mesh.uvs[0].push(face.map(uv_of_vertex));
            }
        }
    }
    if !has_uvs {
        // Without texture coordinates, no image is shown.
        mesh.slots.fill(0);
    }
    if !vertices.colours.is_empty() {
        mesh.colours = mesh.faces.iter().map(|face| face.map(|ix| vertices.colours[ix as usize])).collect();
    }
    mesh.normals = match shading.smooth && !vertices.normals.is_empty() {
        true => mesh.faces.iter().map(|face| face.map(|ix| vertices.normals[ix as usize])).collect(),
        false => smooth_normals(&vertices.positions, &mesh.faces, shading),
    };
    mesh.positions = vertices.positions;
    Ok(mesh)
}

/// Refuses indices that are no vertices.
fn check_indices(mut indices: impl Iterator<Item = i64>, n: usize, what: impl Fn() -> String) -> Checked<()> {
    match indices.find(|ix| !(0..n as i64).contains(ix)) {
        Some(ix) => Err(format!("{} has vertex {ix}, but there are {n} vertices", what())),
        None => Ok(()),
    }
}

/// Returns the images that the comments of a file's header name. Names that are refused are left out.
pub(super) fn named_images(path: &Path, access: Access) -> Vec<PathBuf> {
    // Reading a device or a pipe might never end.
    let file = fs::metadata(path).ok().filter(fs::Metadata::is_file).and_then(|_| fs::File::open(path).ok());
    let reader = file.and_then(|file| PlyReader::from_reader(BufReader::new(file)).ok());
    let reach = access.beside(path);
    let comments = reader.map(|reader| reader.header().comments.clone()).unwrap_or_default();
    texture_files(&comments).filter_map(|name| Some(reach.find(reach.root, name).ok()?.path)).collect()
}

/// The reader's error without its prefix, in one line.
fn text(DeserializeError(error): &DeserializeError) -> String {
    match error.kind() {
        std::io::ErrorKind::UnexpectedEof => "the file ends too early".to_owned(),
        _ => error.to_string().escape_debug().to_string(),
    }
}
