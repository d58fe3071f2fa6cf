//! PLY files (Polygon File Format, also called Stanford Triangle Format), as text and as binary in both byte orders.
//! The elements `vertex`, `face` (a list of indices) and `tristrips` are read, and the comment `TextureFile`, by which
//! MeshLab names the image of the surface. Coordinates are taken as they are: the format states neither a unit nor an
//! axis that points up.

mod header;
mod rows;
mod text;
mod vertex;

use std::borrow::Cow;

use glam::{DVec3, Vec2, Vec3, Vec4};
use rayon::prelude::*;

use self::{
    header::{Element, Encoding, Header, Property},
    rows::{Row, Rows},
    text::binary_rows,
    vertex::{Colours, Vertices, coordinates, upper_left},
};
use super::{
    image_cache::{Images, View},
    mesh_file::Loaded,
};
use crate::{
    scene::{
        files::SourceFile,
        meshes::{
            needs::{Attributes, MeshSize, require_for_mesh},
            polygon::Triangulator,
            smooth::{Shading, smooth_normals},
        },
        model::{Material, Mesh, Texture, error::Checked},
    },
    util::{
        memory::require,
        progress::{Progress, Work},
        text::one_line,
    },
};

/// The names of a face's list of indices.
const INDICES: [&str; 2] = ["vertex_indices", "vertex_index"];

/// The elements of a file.
#[derive(Default)]
struct Elements<'a> {
    vertices: Vertices,
    faces: Option<Faces<'a>>,
    /// The rows of strips of triangles, and the property that has their indices. -1 begins a new strip.
    strips: Option<(Rows<'a>, usize)>,
}

/// The rows of polygons, and where they have what.
struct Faces<'a> {
    rows: Rows<'a>,
    /// Indices of the vertices.
    indices: usize,
    /// Texture coordinates u and v of each corner, or none.
    texcoord: Option<usize>,
    /// Number of the image that the polygon shows.
    texnumber: Option<usize>,
    colours: Option<Colours>,
}

/// The mesh of a file without its materials. Its faces have the slot of their image.
pub(crate) struct PlyMesh {
    pub mesh: Mesh,
    /// The names of the images.
    names: Vec<String>,
    /// Whether normals depend on the crease angle.
    uses_crease: bool,
    warnings: Vec<String>,
}

/// Makes a mesh of a file's content. `n_loaded`: the number of triangles that the scene has already.
pub(crate) fn ply_mesh(
    bytes: &[u8],
    (shading, origin): (Shading, DVec3),
    n_loaded: usize,
    progress: &Progress,
) -> Checked<PlyMesh> {
    let header = Header::read(bytes).map_err(|what| format!("is no PLY file: {what}"))?;
    check(&header.elements)?;
    check_counts(&header, bytes.len() as u64)?;
    let mut warnings = Vec::new();
    let meter = progress.begin(Work::Reading, bytes.len() as u64);
    let content = &bytes[header.n_bytes..];
    let content = match header.encoding {
        Encoding::Text => {
            let (rows, warning) = binary_rows(&header, content, &meter)?;
            warnings.extend(warning);
            Cow::Owned(rows)
        }
        _ => Cow::Borrowed(content),
    };
    let mut elements = Elements::default();
    let mut rest = &content[..];
    for element in &header.elements {
        let too_early =
            || format!("element `{}`: the file ends too early, or a list has no length", element.name.escape_debug());
        let n_before = rest.len();
        let (rows, after) = Rows::take(element, header.encoding, rest).ok_or_else(too_early)?;
        rest = after;
        elements.add(rows, origin);
        if header.encoding != Encoding::Text {
            meter.add((n_before - rest.len()) as u64);
        }
    }
    if header.encoding != Encoding::Text && !rest.trim_ascii().is_empty() {
        warnings.push(format!("{} bytes behind the last row are not read", rest.len()));
    }
    progress.report(Work::Reading, 1.0);
    require_for_mesh(n_loaded as u64, &elements.size())?;
    let names: Vec<String> = texture_files(&header.comments).map(str::to_owned).collect();
    let uses_crease = shading.smooth && elements.vertices.normals.is_empty();
    if elements.vertices.would_be_invisible {
        warnings.push("the opacity of all vertices is 0: shown opaque".to_owned());
    }
    let (mesh, n_left_out) = mesh(elements, names.len(), shading)?;
    if n_left_out > 0 {
        warnings.push(format!("{n_left_out} faces are left out, since their corners are not finite"));
    }
    Ok(PlyMesh { mesh, names, uses_crease, warnings })
}

impl PlyMesh {
    /// Reads the images that the file names.
    pub fn with_materials(self, file: &SourceFile, images: &mut Images) -> Loaded {
        let Self { mesh, names, uses_crease, warnings } = self;
        warnings.iter().for_each(|warning| tracing::warn!("{}: {warning}", file.path.display()));
        let materials = if mesh.uvs[0].is_empty() { Vec::new() } else { materials(file, &names, images) };
        Loaded { mesh, origin: DVec3::ZERO, materials, uses_crease }
    }
}

impl<'a> Elements<'a> {
    /// Adds the rows of an element, which [`check`] has accepted.
    fn add(&mut self, rows: Rows<'a>, origin: DVec3) {
        let element = rows.element;
        match (&*element.name, coordinates(element), element.list(&INDICES)) {
            ("vertex", Some(coordinates), _) => self.vertices = Vertices::read(&rows, coordinates, origin),
            ("face", _, Some(indices)) => {
                let (texcoord, texnumber) = (element.list(&["texcoord"]), element.number(&["texnumber"]));
                let colours = Colours::of(element);
                self.faces = Some(Faces { rows, indices, texcoord, texnumber, colours });
            }
            ("tristrips", _, Some(indices)) => self.strips = Some((rows, indices)),
            _ => {}
        }
    }

    /// Returns the size of the mesh.
    fn size(&self) -> MeshSize {
        let lists =
            [self.faces.as_ref().map(|faces| (&faces.rows, faces.indices)), self.strips.as_ref().map(|s| (&s.0, s.1))];
        let n_triangles = |(rows, indices): (&Rows, usize)| {
            let of_row = |ix| rows.row(ix).list(indices).len().saturating_sub(2) as u64;
            (0..rows.len()).into_par_iter().map(of_row).sum::<u64>()
        };
        let has_uvs =
            !self.vertices.uvs.is_empty() || self.faces.as_ref().is_some_and(|faces| faces.texcoord.is_some());
        let has_colours =
            !self.vertices.colours.is_empty() || self.faces.as_ref().is_some_and(|it| it.colours.is_some());
        MeshSize {
            n_triangles: lists.into_iter().flatten().map(n_triangles).sum(),
            // The points are there already.
            n_points: 0,
            attributes: Attributes { n_uv_sets: u64::from(has_uvs), has_colours, has_tangents: false },
        }
    }
}

impl Faces<'_> {
    /// Returns the triangles, if all faces are triangles of `n_vertices` vertices and have nothing more.
    fn triangles(&self, n_vertices: usize) -> Option<Vec<[u32; 3]>> {
        if self.texcoord.is_some() || self.texnumber.is_some() || self.colours.is_some() {
            return None;
        }
        let is_triangle = |row: Row| {
            let mut indices = row.list(self.indices);
            indices.len() == 3 && indices.all(|ix| vertex_ix(ix, n_vertices).is_some())
        };
        let triangle = |row: Row| {
            let mut indices = row.list(self.indices);
            [0; 3].map(|_: u32| indices.next().expect("three indices") as u32)
        };
        // A list whose length is known is written in place. Lists of parts would have to be joined.
        self.rows.all(is_triangle).then(|| self.rows.map(triangle))
    }

    /// Returns the texture coordinates u and v of all corners of a polygon of `n` corners, if it has them.
    fn uvs(&self, row: Row, n: usize) -> Option<Vec<f32>> {
        let uvs = row.list(self.texcoord?);
        (n > 0 && uvs.len() == 2 * n).then(|| uvs.map(|number| number as f32).collect())
    }
}

/// Refuses a header that promises more rows than a file of `n_bytes` can hold, or more than there is memory for.
fn check_counts(header: &Header, n_bytes: u64) -> Checked<()> {
    let is_text = header.encoding == Encoding::Text;
    let (mut n_promised, mut n_held) = (0_u64, 0_u64);
    for element in &header.elements {
        let (name, n_rows) = (element.name.escape_debug(), element.n_rows as u64);
        if element.properties.is_empty() && n_rows > 0 {
            return Err(format!("element `{name}` has no properties"));
        }
        // In a text, a number takes a digit and a blank, and the file need not end in one.
        let least = |it: &Property| if is_text { 2 } else { it.length.unwrap_or(it.number).n_bytes() as u64 };
        let n_row_bytes: u64 = element.properties.iter().map(least).sum();
        n_promised = n_promised.saturating_add(n_rows.saturating_mul(n_row_bytes));
        if n_promised > n_bytes.saturating_add(1) {
            return Err(format!(
                "element `{name}`: the file ends too early: {n_bytes} bytes do not hold its {n_rows} rows"
            ));
        }
        let of_vertex = if element.name == "vertex" { Vertices::n_row_bytes(element) } else { 0 };
        let has_list = element.properties.iter().any(|property| property.length.is_some());
        let of_row = of_vertex + if has_list { size_of::<usize>() } else { 0 };
        n_held = n_held.saturating_add(n_rows.saturating_mul(of_row as u64));
    }
    // The numbers of a text become eight bytes each.
    let n_content = n_bytes.saturating_mul(if is_text { 5 } else { 1 });
    Ok(require("reading its rows", n_held.saturating_add(n_content))?)
}

/// Returns the names of images in the comments `TextureFile NAME`.
fn texture_files(comments: &[String]) -> impl Iterator<Item = &str> {
    comments.iter().filter_map(|comment| Some(comment.strip_prefix("TextureFile ")?.trim())).filter(|n| !n.is_empty())
}

/// Returns one material for each name of an image, which is its base colour. Warns of images that cannot be read.
fn materials(ply: &SourceFile, names: &[String], images: &mut Images) -> Vec<Material> {
    let warn = |what: &str| tracing::warn!("{}: TextureFile is not shown: {}", ply.path.display(), one_line(what));
    let mut add = |name: &String| {
        let is_shown = !images.is_replaced(name);
        is_shown.then(|| ply.find(ply.folder(), name).map(|file| images.add(file)))
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

/// Refuses files without the elements that a mesh needs.
fn check(elements: &[Element]) -> Checked<()> {
    let element = |name: &str| elements.iter().find(|element| element.name == name);
    let vertex = element("vertex").ok_or("has no element `vertex`")?;
    for element in elements {
        match &*element.name {
            "vertex" if coordinates(element).is_none() => {
                return Err("its element `vertex` lacks x, y or z".to_owned());
            }
            name @ ("face" | "tristrips") if element.list(&INDICES).is_none() => {
                return Err(format!("its element `{name}` lacks the list `{}`", INDICES[0]));
            }
            _ => {}
        }
    }
    match element("face").or(element("tristrips")) {
        Some(_) => Ok(()),
        None if vertex.number(&["f_dc_0"]).is_some() => {
            Err("has Gaussian splats, which are not shown: no element `face`".to_owned())
        }
        None => Err(format!(
            "has no element `face`: it is a cloud of {} points, without triangles to show. MeshLab, for example, \
             makes a mesh of it",
            vertex.n_rows
        )),
    }
}

/// Makes the mesh, without faces whose corners are not finite, and returns their number. `n_images`: the number of
/// images that polygons can show.
fn mesh(elements: Elements, n_images: usize, shading: Shading) -> Checked<(Mesh, usize)> {
    let Elements { vertices, faces, strips } = elements;
    let mut mesh = Mesh::default();
    if let Some(faces) = faces {
        match faces.triangles(vertices.positions.len()) {
            Some(triangles) => add_triangles(triangles, &vertices, &mut mesh),
            None => add_polygons(&faces, &vertices, n_images, &mut mesh)?,
        }
    }
    if let Some((rows, indices)) = strips {
        add_strips(&rows, indices, &vertices, &mut mesh)?;
    }
    if mesh.uvs[0].is_empty() {
        // Without texture coordinates, no image is shown.
        mesh.slots.fill(0);
    }
    if !mesh.colours.is_empty() {
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

/// Adds faces that are triangles with the texture coordinates of their vertices, if these have some.
fn add_triangles(triangles: Vec<[u32; 3]>, vertices: &Vertices, mesh: &mut Mesh) {
    if !vertices.uvs.is_empty() {
        mesh.uvs[0] = triangles.par_iter().map(|face| face.map(|ix| vertices.uvs[ix as usize])).collect();
    }
    mesh.slots = vec![0; triangles.len()];
    mesh.faces = triangles;
}

/// Adds polygons with their images, colours and texture coordinates. If vertices have several colours, those of
/// polygons do not count: programs write one colour for all vertices where the faces have the colours.
fn add_polygons(faces: &Faces, vertices: &Vertices, n_images: usize, mesh: &mut Mesh) -> Checked<()> {
    let of_vertices = &vertices.colours;
    let colours = faces.colours.as_ref().filter(|_| of_vertices.iter().all(|colour| *colour == of_vertices[0]));
    let colours = colours.map(|colours| (colours, colours.one(&faces.rows)));
    let n_corners = |row: Row| row.list(faces.indices).len();
    let has_uvs = !vertices.uvs.is_empty() || !faces.rows.all(|row: Row| faces.uvs(row, n_corners(row)).is_none());
    let uv_of_vertex = |ix: u32| vertices.uvs.get(ix as usize).copied().unwrap_or(Vec2::ZERO);
    let mut triangulator = Triangulator::default();
    let (mut indices, mut corners) = (Vec::new(), Vec::new());
    for face_ix in 0..faces.rows.len() {
        let row = faces.rows.row(face_ix);
        let what = || format!("face {face_ix} (counted from 0)");
        indices.clear();
        for ix in row.list(faces.indices) {
            indices.push(checked_ix(ix, vertices, what)?);
        }
        corners.clear();
        corners.extend(indices.iter().map(|ix| vertices.positions[*ix as usize]));
        // A number of an image that is out of range is a face without one.
        let texnumber = faces.texnumber.map_or(0.0, |property| row.number(property));
        let slot = if (0.0..n_images as f64).contains(&texnumber) { texnumber as u32 } else { n_images as u32 };
        let colour = colours.map(|(colours, one)| colours.linear(row, one).extend(1.0));
        let uvs = faces.uvs(row, indices.len());
        triangulator.cut(&corners, |triangle| {
            mesh.faces.push(triangle.map(|corner| indices[corner]));
            mesh.slots.push(slot);
            mesh.colours.extend(colour.map(|colour| [colour; 3]));
            if has_uvs {
                let own = |uvs: &Vec<f32>| triangle.map(|corner| upper_left(uvs[2 * corner], uvs[2 * corner + 1]));
                let of_vertices = || triangle.map(|corner| uv_of_vertex(indices[corner]));
                mesh.uvs[0].push(uvs.as_ref().map_or_else(of_vertices, own));
            }
        });
    }
    Ok(())
}

/// Adds strips of triangles. `property`: the list of their indices.
fn add_strips(rows: &Rows, property: usize, vertices: &Vertices, mesh: &mut Mesh) -> Checked<()> {
    let has_uvs = !vertices.uvs.is_empty() || !mesh.uvs[0].is_empty();
    let uv_of_vertex = |ix: u32| vertices.uvs.get(ix as usize).copied().unwrap_or(Vec2::ZERO);
    for row_ix in 0..rows.len() {
        let indices: Vec<f64> = rows.row(row_ix).list(property).collect();
        for strip in indices.split(|ix| *ix == -1.0) {
            let checked = |ix: &f64| checked_ix(*ix, vertices, || "a triangle strip".to_owned());
            let strip: Vec<u32> = strip.iter().map(checked).collect::<Checked<_>>()?;
            for (ix, [a, b, c]) in strip.array_windows().enumerate().filter(|(_, [a, b, c])| a != b && b != c && c != a)
            {
                let face = if ix % 2 == 0 { [*a, *b, *c] } else { [*b, *a, *c] };
                mesh.faces.push(face);
                mesh.slots.push(0);
                if has_uvs {
                    mesh.uvs[0].push(face.map(uv_of_vertex));
                }
            }
        }
    }
    Ok(())
}

/// Returns a stated index, if it is one of `n` vertices.
fn vertex_ix(stated: f64, n: usize) -> Option<u32> {
    let ix = stated as u32;
    (f64::from(ix) == stated && (ix as usize) < n).then_some(ix)
}

/// Returns a stated index, if it is that of a vertex. `what` names the face.
fn checked_ix(stated: f64, vertices: &Vertices, what: impl Fn() -> String) -> Checked<u32> {
    let n = vertices.positions.len();
    vertex_ix(stated, n).ok_or_else(|| format!("{} has vertex {stated}, but there are {n} vertices", what()))
}

/// Returns the images that the comments of a file's header name. Names that are refused are left out.
pub(crate) fn named_images(ply: &SourceFile, bytes: &[u8]) -> Vec<SourceFile> {
    let comments = Header::read(bytes).map(|header| header.comments).unwrap_or_default();
    texture_files(&comments).filter_map(|name| ply.find(ply.folder(), name).ok()).collect()
}
