//! PLY files (Polygon File Format, also called Stanford Triangle Format), as text and as binary in both byte orders.
//! The elements `vertex`, `face` (a list of indices) and `tristrips` are read, and the comment `TextureFile`, by which
//! MeshLab names the image of the surface. Coordinates are taken as they are: the format states neither a unit nor an
//! axis that points up.

mod mended;
mod quick;
mod vertex;

use std::{
    io::{self, BufRead, Read},
    path::{Path, PathBuf},
};

use glam::{DVec3, Vec2, Vec3, Vec4};
use rayon::prelude::*;
use serde::Deserialize;
use serde_ply::{DeserializeError, ElementDef, PlyFormat, PlyHeader, PlyProperty, PlyReader, PropertyType, ScalarType};

use self::{
    mended::{mended, widened},
    quick::{quick_triangles, quick_vertices},
    vertex::{REDS, Vertices, largest_colour, upper_left},
};
use super::{
    image_files::{Images, View},
    mesh_file::Loaded,
};
use crate::{
    scene::{
        files::outside::Access,
        meshes::{
            needs::{Attributes, MeshSize, require_for_mesh, require_for_rows},
            polygon::Triangulator,
            smooth::{Shading, smooth_normals},
        },
        model::{Material, Mesh, Texture, error::Checked, texture::linear_of_srgb},
    },
    util::{
        progress::{Meter, Progress, Work},
        text::one_line,
    },
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
    /// Colour, if the element has one.
    #[serde(default, alias = "diffuse_red", alias = "r")]
    red: f32,
    #[serde(default, alias = "diffuse_green", alias = "g")]
    green: f32,
    #[serde(default, alias = "diffuse_blue", alias = "b")]
    blue: f32,
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

/// The rest of a file's content. It reports the bytes that have been read.
struct Counted<'a> {
    rest: &'a [u8],
    /// What follows `rest`.
    then: &'a [u8],
    meter: Meter<'a>,
    n_unreported: usize,
}

impl<'a> Counted<'a> {
    /// Number of bytes between two reports.
    const REPORTED_BYTES: usize = 1 << 20;

    /// Joins two parts. Numbers in binary form must not be cut by the parts.
    fn new(first: &'a [u8], then: &'a [u8], progress: &'a Progress) -> Self {
        let n_bytes = (first.len() + then.len()) as u64;
        Self { rest: first, then, meter: progress.begin(Work::Reading, n_bytes), n_unreported: 0 }
    }

    /// Goes on to the second part at the end of the first one.
    fn go_on(&mut self) {
        if self.rest.is_empty() {
            self.rest = std::mem::take(&mut self.then);
        }
    }

    fn count(&mut self, n: usize) {
        self.n_unreported += n;
        if self.n_unreported >= Self::REPORTED_BYTES || self.rest.is_empty() {
            self.meter.add(std::mem::take(&mut self.n_unreported) as u64);
        }
    }
}

impl Read for Counted<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        self.go_on();
        let n = self.rest.read(out)?;
        self.count(n);
        Ok(n)
    }

    fn read_exact(&mut self, out: &mut [u8]) -> io::Result<()> {
        self.go_on();
        self.rest.read_exact(out)?;
        self.count(out.len());
        Ok(())
    }
}

impl BufRead for Counted<'_> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        self.go_on();
        Ok(self.rest)
    }

    fn consume(&mut self, n: usize) {
        self.rest.consume(n);
        self.count(n);
    }
}

/// The elements of a file.
#[derive(Default)]
struct Elements {
    vertices: Vertices,
    /// All faces, if they were read in the quick way.
    triangles: Vec<[u32; 3]>,
    polygons: Vec<Polygon>,
    /// Linear colours of the polygons, or empty if the file has none that are shown.
    polygon_colours: Vec<Vec3>,
    strips: Vec<Strips>,
}

/// The mesh of a file without its materials. Its faces have the slot of their image.
pub(crate) struct PlyMesh {
    mesh: Mesh,
    /// The names of the images.
    names: Vec<String>,
    /// Whether normals depend on the crease angle.
    uses_crease: bool,
    /// Number of faces that are left out, since their corners are not finite.
    n_left_out: usize,
    /// Whether all vertices would be invisible, as [`Vertices`] states it.
    would_be_invisible: bool,
}

/// Makes a mesh of a file's content. `n_loaded`: the number of triangles that the scene has already.
pub(crate) fn ply_mesh(
    bytes: &[u8],
    (shading, origin): (Shading, DVec3),
    n_loaded: usize,
    progress: &Progress,
) -> Checked<PlyMesh> {
    let mended = mended(bytes);
    let bytes = &mended[..];
    let (head, rest) = widened(bytes);
    let mut reader = PlyReader::from_reader(Counted::new(&head, rest, progress))
        .map_err(|error| format!("is no PLY file: {}", text(&error)))?;
    let header = reader.header().clone();
    check(&header.elem_defs)?;
    check_counts(&header, bytes.len() as u64)?;
    let elements = read(&mut reader, (&header, bytes), origin)?;
    progress.report(Work::Reading, 1.0);
    require_for_mesh(n_loaded as u64, &elements.size())?;
    let names: Vec<String> = texture_files(&header.comments).map(str::to_owned).collect();
    let uses_crease = shading.smooth && elements.vertices.normals.is_empty();
    let would_be_invisible = elements.vertices.would_be_invisible;
    let (mesh, n_left_out) = mesh(elements, names.len(), shading)?;
    Ok(PlyMesh { mesh, names, uses_crease, n_left_out, would_be_invisible })
}

impl PlyMesh {
    /// The mesh without its materials.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// Reads the images that the file names.
    pub fn with_materials(self, path: &Path, access: Access, images: &mut Images) -> Loaded {
        let Self { mesh, names, uses_crease, n_left_out, would_be_invisible } = self;
        if would_be_invisible {
            tracing::warn!("{}: the opacity of all vertices is 0: shown opaque", path.display());
        }
        if n_left_out > 0 {
            tracing::warn!("{}: {n_left_out} faces are left out, since their corners are not finite", path.display());
        }
        let materials = if mesh.uvs[0].is_empty() { Vec::new() } else { materials(path, &names, access, images) };
        Loaded { mesh, origin: DVec3::ZERO, materials, uses_crease }
    }
}

impl Elements {
    /// Returns the size of the mesh.
    fn size(&self) -> MeshSize {
        let of_polygons = self.polygons.iter().map(|polygon| polygon.vertex_indices.len());
        let n_corners = of_polygons.chain(self.strips.iter().map(|strips| strips.vertex_indices.len()));
        let has_uvs = !self.vertices.uvs.is_empty() || self.polygons.iter().any(|p| !p.texcoord.is_empty());
        let has_colours = !self.vertices.colours.is_empty() || !self.polygon_colours.is_empty();
        MeshSize {
            n_triangles: self.triangles.len() as u64 + n_corners.map(|n| n.saturating_sub(2) as u64).sum::<u64>(),
            // The points are there already.
            n_points: 0,
            attributes: Attributes { n_uv_sets: u64::from(has_uvs), has_colours, has_tangents: false },
        }
    }
}

/// Refuses a header that promises more rows than a file of `n_bytes` can hold, or more than there is memory for.
fn check_counts(header: &PlyHeader, n_bytes: u64) -> Checked<()> {
    let is_text = matches!(header.format, PlyFormat::Ascii);
    let (mut n_promised, mut n_held) = (0_u64, 0_u64);
    for element in &header.elem_defs {
        let name = element.name.escape_debug();
        if element.properties.is_empty() && element.count > 0 {
            return Err(format!("element `{name}` has no properties"));
        }
        // In a text, a number takes a digit and a blank, and the file need not end in one.
        let least = |property: &PlyProperty| if is_text { 2 } else { least_bytes(&property.property_type) };
        let n_row_bytes: u64 = element.properties.iter().map(least).sum();
        n_promised = n_promised.saturating_add((element.count as u64).saturating_mul(n_row_bytes));
        if n_promised > n_bytes.saturating_add(1) {
            let n = element.count;
            return Err(format!("element `{name}`: the file ends too early: {n_bytes} bytes do not hold its {n} rows"));
        }
        let of_row = match element.name.as_str() {
            "vertex" => Vertices::n_row_bytes(element),
            "face" => size_of::<Polygon>(),
            "tristrips" => size_of::<Strips>(),
            _ => 0,
        };
        n_held = n_held.saturating_add((element.count as u64).saturating_mul(of_row as u64));
    }
    require_for_rows(n_held.saturating_add(n_bytes))
}

/// Returns the least number of bytes that a property takes in a binary file: those of a number, or of a list's length.
fn least_bytes(property: &PropertyType) -> u64 {
    let (PropertyType::Scalar(number) | PropertyType::List { count_type: number, .. }) = property;
    match number {
        ScalarType::I8 | ScalarType::U8 => 1,
        ScalarType::I16 | ScalarType::U16 => 2,
        ScalarType::I32 | ScalarType::U32 | ScalarType::F32 => 4,
        ScalarType::F64 => 8,
    }
}

/// Reads the elements, in the order of the file if they are not read in the quick way.
fn read(reader: &mut PlyReader<Counted>, (header, bytes): (&PlyHeader, &[u8]), origin: DVec3) -> Checked<Elements> {
    let mut found = Elements::default();
    if let Some(triangles) = quick_triangles(bytes, header) {
        let vertices = quick_vertices(bytes, header, origin);
        let vertices = vertices.map_or_else(|| Vertices::read(reader, &header.elem_defs[0], origin), Ok)?;
        return Ok(Elements { vertices, triangles, ..found });
    }
    for element in &header.elem_defs {
        let failed = |error| format!("element `{}`: {}", element.name.escape_debug(), text(&error));
        match element.name.as_str() {
            "vertex" => found.vertices = Vertices::read(reader, element, origin)?,
            "face" => {
                found.polygons = reader.next_element().map_err(failed)?;
                found.polygon_colours = polygon_colours(element, &found.polygons);
            }
            "tristrips" => found.strips = reader.next_element().map_err(failed)?,
            _ => drop(reader.next_element::<Vec<Skipped>>().map_err(failed)?),
        }
    }
    if found.vertices.colours.iter().any(|colour| *colour != found.vertices.colours[0]) {
        found.polygon_colours.clear();
    }
    Ok(found)
}

/// Returns the linear colours of polygons, or nothing if they have none.
fn polygon_colours(element: &ElementDef, polygons: &[Polygon]) -> Vec<Vec3> {
    let Some(red) = REDS.iter().find(|name| element.has_property(name)) else { return Vec::new() };
    let colours = polygons.iter().map(|polygon| Vec3::new(polygon.red, polygon.green, polygon.blue));
    let one = largest_colour(element, red, colours.clone());
    colours.map(|colour| (colour / one).map(linear_of_srgb)).collect()
}

/// Returns the names of images in the comments `TextureFile NAME`.
fn texture_files(comments: &[String]) -> impl Iterator<Item = &str> {
    comments.iter().filter_map(|comment| Some(comment.strip_prefix("TextureFile ")?.trim())).filter(|n| !n.is_empty())
}

/// Returns one material for each name of an image, which is its base colour. Warns of images that cannot be read.
fn materials(path: &Path, names: &[String], access: Access, images: &mut Images) -> Vec<Material> {
    let reach = access.beside(path);
    let warn = |what: &str| tracing::warn!("{}: TextureFile is not shown: {}", path.display(), one_line(what));
    let mut add = |name: &String| {
        let is_shown = !images.is_replaced(name);
        is_shown.then(|| reach.find(reach.root, name).map(|file| images.add(file.path)))
    };
    let files: Vec<Option<Checked<usize>>> = names.iter().map(&mut add).collect();
    images.decode();
    let material = |(name, file): (&String, Option<Checked<usize>>)| {
        let image = file.and_then(|file| {
            let image = file.and_then(|file| {
                images.get(file)?;
                images.show(file, View::Plain)
            });
            image.map_err(|what| warn(&what)).ok()
        });
        let mut material = Material { name: name.clone(), ..Material::default() };
        if image.is_some() {
            (material.ka, material.kd) = (Vec3::ONE, Vec3::ONE);
        }
        material.maps.base_colour = image.map(Texture::of_image);
        material
    };
    names.iter().zip(files).map(material).collect()
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
        None if vertex.has_property("f_dc_0") => {
            Err("has Gaussian splats, which are not shown: no element `face`".to_owned())
        }
        None => Err(format!(
            "has no element `face`: it is a cloud of {} points, without triangles to show. MeshLab, for example, \
             makes a mesh of it",
            vertex.count
        )),
    }
}

/// Makes the mesh, without faces whose corners are not finite, and returns their number. `n_images`: the number of
/// images that polygons can show.
fn mesh(elements: Elements, n_images: usize, shading: Shading) -> Checked<(Mesh, usize)> {
    let Elements { vertices, triangles, polygons, polygon_colours, strips } = elements;
    let mut mesh = Mesh { slots: vec![0; triangles.len()], faces: triangles, ..Mesh::default() };
    let has_own_uvs = |polygon: &Polygon| polygon.texcoord.len() == 2 * polygon.vertex_indices.len();
    let has_uvs = !vertices.uvs.is_empty() || polygons.iter().any(|p| !p.texcoord.is_empty() && has_own_uvs(p));
    let uv_of_vertex = |ix: u32| vertices.uvs.get(ix as usize).copied().unwrap_or(Vec2::ZERO);
    if !vertices.uvs.is_empty() {
        mesh.uvs[0] = mesh.faces.par_iter().map(|face| face.map(uv_of_vertex)).collect();
    }
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
            if let Some(colour) = polygon_colours.get(polygon_ix) {
                mesh.colours.push([colour.extend(1.0); 3]);
            }
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
    if !polygon_colours.is_empty() {
        mesh.colours.resize(mesh.faces.len(), [Vec4::ONE; 3]);
    } else if !vertices.colours.is_empty() {
        mesh.colours = mesh.faces.par_iter().map(|face| face.map(|ix| vertices.colours[ix as usize])).collect();
    }
    mesh.positions = vertices.positions;
    let n_left_out = mesh.leave_out_broken_faces();
    mesh.normals = match shading.smooth && !vertices.normals.is_empty() {
        true => mesh.faces.par_iter().map(|face| face.map(|ix| vertices.normals[ix as usize])).collect(),
        false => smooth_normals(&mesh.positions, &mesh.faces, shading),
    };
    Ok((mesh, n_left_out))
}

/// Refuses indices that are no vertices.
fn check_indices(mut indices: impl Iterator<Item = i64>, n: usize, what: impl Fn() -> String) -> Checked<()> {
    match indices.find(|ix| !(0..n as i64).contains(ix)) {
        Some(ix) => Err(format!("{} has vertex {ix}, but there are {n} vertices", what())),
        None => Ok(()),
    }
}

/// Returns the images that the comments of a file's header name. Names that are refused are left out.
pub(crate) fn named_images(path: &Path, bytes: &[u8], access: Access) -> Vec<PathBuf> {
    let mended = mended(bytes);
    let reader = PlyReader::from_reader(&*mended).ok();
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
