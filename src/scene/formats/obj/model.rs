//! Parts of an OBJ file whose faces have one kind and one material, and the mesh that they make.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::{
    content::ObjFile,
    elements::Elements,
    faces::{self, Faces, Run},
    statement::split_keyword,
};
use crate::scene::{
    meshes::{
        coincident::{Coincident, CoincidentTriangles, FaceGroup, Looks},
        polygon::Triangulator,
        smooth::{Shading, crease_normals},
    },
    model::{Mesh, texture::linear_of_srgb},
};

/// What the faces of a model have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct FaceKind {
    has_uvs: bool,
    has_normals: bool,
    /// Whether faces without normals are flat, by `s off`. A file without `s` is smooth except at creases.
    is_flat: bool,
}

/// Faces of one kind and one material.
#[derive(Debug)]
struct Model<'a> {
    kind: FaceKind,
    material_ix: Option<usize>,
    elements: &'a Elements,
    /// Three numbers a position, in the order in which the faces name them first.
    positions: Vec<f32>,
    /// Three numbers a position, or empty.
    colours: Vec<f32>,
    /// Indices of positions, and of the file's texture coordinates and normals, one each per corner. There are only
    /// those that `kind` says.
    corners: [Vec<u32>; 3],
    /// Numbers of the faces' corners.
    arities: Vec<u32>,
}

/// Divides the faces of a file into models. `material_ix` returns the index of a named material.
fn models(file: &ObjFile, material_ix: impl Fn(&str) -> Option<usize>) -> Vec<Model<'_>> {
    let mut models: Vec<Model> = Vec::new();
    // For each point of the file the last model that has it, and its index there.
    let mut indices = vec![(u32::MAX, 0); file.n_points()];
    let (mut material, mut begins, mut is_off) = (None, true, false);
    for (chunk, part) in file.chunks.iter().flat_map(|chunk| chunk.parts.iter().map(move |part| (chunk, part))) {
        match part {
            faces::Part::Statement(_, statement) => match split_keyword(statement) {
                ("s", rest) => is_off = matches!(rest, "off" | "0"),
                ("usemtl", name) => {
                    let next = material_ix(name);
                    begins |= next != material;
                    material = next;
                }
                _ => {}
            },
            faces::Part::Faces(run) => {
                let has_normals = run.has(2);
                let kind = FaceKind { has_uvs: run.has(1), has_normals, is_flat: is_off && !has_normals };
                if begins || models.last().is_none_or(|model| model.kind != kind) {
                    models.push(Model::new(kind, material, &file.elements));
                    begins = false;
                }
                let model_ix = models.len() as u32 - 1;
                models[model_ix as usize].add(model_ix, (chunk, run), &mut indices);
            }
        }
    }
    models
}

impl<'a> Model<'a> {
    /// A model without faces.
    fn new(kind: FaceKind, material_ix: Option<usize>, elements: &'a Elements) -> Self {
        let (positions, colours, corners, arities) = Default::default();
        Self { kind, material_ix, elements, positions, colours, corners, arities }
    }

    /// Adds faces. `indices`: for each point of the file the last model that has it, and its index there.
    fn add(&mut self, model_ix: u32, (chunk, run): (&Faces, &Run), indices: &mut [(u32, u32)]) {
        self.arities.extend(&chunk.arities[run.arities.clone()]);
        let of_run = |kind: usize| &chunk.corners[kind][run.corners[kind].clone()];
        self.corners[1].extend(of_run(1));
        self.corners[2].extend(of_run(2));
        self.corners[0].extend(of_run(0).iter().map(|ix| {
            let known = &mut indices[*ix as usize];
            if known.0 != model_ix {
                *known = (model_ix, (self.positions.len() / 3) as u32);
                self.positions.extend_from_slice(self.elements.get(0, *ix as usize));
                self.colours.extend_from_slice(self.elements.colour(*ix as usize));
            }
            known.1
        }));
    }

    /// Returns its faces, as far as it matters whether some of them are there several times.
    fn faces(&self) -> FaceGroup<'_> {
        FaceGroup {
            points: &self.positions,
            corners: &self.corners[0],
            arities: &self.arities,
            looks: Looks::Material(self.material_ix),
        }
    }

    /// Cuts the faces into triangles.
    fn triangles(&self, triangulator: &mut Triangulator) -> Triangles {
        if self.arities.iter().all(|n| *n == 3) {
            return Triangles::All(self.corners[0].len() / 3);
        }
        let (mut triangles, mut first, mut polygon) = (Vec::with_capacity(self.corners[0].len() / 2), 0, Vec::new());
        for n_corners in self.arities.iter().map(|n| *n as usize) {
            let corners = &self.corners[0][first..first + n_corners];
            polygon.clear();
            polygon.extend(corners.iter().map(|ix| Vec3::from_slice(&self.positions[*ix as usize * 3..])));
            triangulator.cut(&polygon, |corners| triangles.push(corners.map(|corner| first + corner)));
            first += n_corners;
        }
        Triangles::Cut(triangles)
    }

    /// Makes the mesh of the model's triangles without its slots.
    fn part(&self, triangles: &Triangles, shading: Shading) -> Mesh {
        let [points, texcoords, normals] = &self.corners;
        let normal =
            |corner: usize| Vec3::from_slice(self.elements.get(2, normals[corner] as usize)).normalize_or_zero();
        let uv = |corner: usize| {
            let uv = self.elements.get(1, texcoords[corner] as usize);
            // The origin of OBJ's coordinates is the lower left corner of the image.
            Vec2::new(uv[0], 1.0 - uv[1])
        };
        let colour = |corner: usize| {
            let colour = Vec3::from_slice(&self.colours[points[corner] as usize * 3..]);
            let colour = colour / self.elements.colour_scale();
            Vec3::from_array(colour.to_array().map(linear_of_srgb)).extend(1.0)
        };
        let mut part = Mesh {
            positions: self.positions.as_chunks().0.iter().copied().map(Vec3::from_array).collect(),
            faces: triangles.each(|corner| points[corner]),
            ..Mesh::default()
        };
        part.normals = match shading.smooth && self.kind.has_normals {
            true => triangles.each(normal),
            false => vec![[Vec3::ZERO; 3]; part.faces.len()],
        };
        if self.kind.has_uvs {
            part.uvs[0] = triangles.each(uv);
        }
        if !self.colours.is_empty() {
            part.colours = triangles.each(colour);
        }
        part
    }
}

/// The triangles of a model, by the numbers of their corners in the model's lists.
enum Triangles {
    /// Each three corners are one of so many triangles.
    All(usize),
    Cut(Vec<[usize; 3]>),
}

impl Triangles {
    /// Returns a value for each corner of each triangle.
    fn each<T: Send>(&self, value: impl Fn(usize) -> T + Sync) -> Vec<[T; 3]> {
        match self {
            Self::All(n) => (0..*n).into_par_iter().map(|ix| [0, 1, 2].map(|corner| value(3 * ix + corner))).collect(),
            Self::Cut(triangles) => triangles.par_iter().map(|corners| corners.map(&value)).collect(),
        }
    }
}

/// Makes the mesh of a file. Also returns whether the crease angle counts. `material_ix` returns the index of a named
/// material. Faces without a material have the slot `no_material`.
pub fn mesh(
    file: &ObjFile,
    material_ix: impl Fn(&str) -> Option<usize>,
    no_material: u32,
    shading: Shading,
) -> (Mesh, bool) {
    let models = models(file, material_ix);
    let mut mesh = Mesh::default();
    let mut to_smooth = Vec::new();
    let mut triangulator = Triangulator::default();
    let faces: Vec<FaceGroup> = models.iter().map(Model::faces).collect();
    let mut coincident = CoincidentTriangles::new(Coincident::of(&faces));
    for (model_ix, model) in models.iter().enumerate() {
        let triangles = model.triangles(&mut triangulator);
        let part = model.part(&triangles, shading);
        let n_faces = part.faces.len();
        let is_smoothed = shading.smooth && !model.kind.has_normals && !model.kind.is_flat;
        to_smooth.resize(to_smooth.len() + n_faces, is_smoothed);
        let first_corners = || triangles.each(|corner| corner).iter().map(|[first, ..]| *first).collect();
        coincident.add((model_ix, &faces[model_ix]), mesh.faces.len(), first_corners);
        let slot = model.material_ix.map_or(no_material, |ix| ix as u32);
        mesh.append(Mesh { slots: vec![slot; n_faces], ..part });
    }
    let uses_crease = to_smooth.contains(&true);
    if uses_crease {
        let computed = crease_normals(&mesh.positions, &mesh.faces, &to_smooth, shading.crease);
        let replace = |((normals, computed), to_smooth): ((&mut [Vec3; 3], [Vec3; 3]), &bool)| {
            if *to_smooth {
                *normals = computed;
            }
        };
        mesh.normals.par_iter_mut().zip(computed).zip(&to_smooth).for_each(replace);
    }
    coincident.separate(&mut mesh);
    (mesh, uses_crease)
}
