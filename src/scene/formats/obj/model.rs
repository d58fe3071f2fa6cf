//! Parts of an OBJ file whose faces have one kind and one material, and the mesh that they make.

use std::borrow::Cow;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::clean::{FaceKind, FaceShading};
use crate::scene::{
    meshes::{
        coincident::{Coincident, CoincidentTriangles, Looks, Part},
        polygon::Triangulator,
        smooth::{Shading, crease_normals},
    },
    model::{Mesh, texture::linear_of_srgb},
};

/// Faces of one kind and one material.
#[derive(Clone, Debug)]
pub struct Model<'a> {
    pub kind: FaceKind,
    pub material_ix: Option<usize>,
    /// Three numbers a position, all of them used.
    pub positions: Cow<'a, [f32]>,
    /// Two numbers each.
    pub texcoords: Cow<'a, [f32]>,
    /// Three numbers a normal.
    pub normals: Cow<'a, [f32]>,
    /// Three numbers a position, or empty.
    pub colours: Cow<'a, [f32]>,
    /// Indices of positions, texture coordinates and normals, one each per corner. The latter two count only if `kind`
    /// says that the faces have them.
    pub corners: [Cow<'a, [u32]>; 3],
    /// Numbers of the faces' corners. Empty if all faces are triangles.
    pub arities: Cow<'a, [u32]>,
}

impl<'a> Model<'a> {
    /// Returns a model that tobj has read from a cleaned file.
    pub fn of_tobj(tobj::Model { mesh, name }: &'a tobj::Model) -> Self {
        Self {
            kind: FaceKind::of_group(name).unwrap_or(FaceKind { shading: FaceShading::Smooth, has_uvs: false }),
            material_ix: mesh.material_id,
            positions: (&mesh.positions).into(),
            texcoords: (&mesh.texcoords).into(),
            normals: (&mesh.normals).into(),
            colours: (&mesh.vertex_color).into(),
            corners: [&mesh.indices, &mesh.texcoord_indices, &mesh.normal_indices].map(Cow::from),
            arities: (&mesh.face_arities).into(),
        }
    }

    /// Returns whether all numbers that faces name are finite.
    pub fn is_finite(&self) -> bool {
        let [_, texcoords, normals] = &self.corners;
        let are_finite = |numbers: &[f32], corners: &[u32], n: usize| {
            corners.iter().all(|ix| numbers[*ix as usize * n..][..n].iter().all(|number| number.is_finite()))
        };
        self.positions.iter().all(|number| number.is_finite())
            && are_finite(&self.texcoords, texcoords, 2)
            && are_finite(&self.normals, normals, 3)
    }

    /// Returns its faces, as far as it matters whether some of them are there several times.
    fn faces(&self) -> Part<'_> {
        Part {
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

    /// Makes the mesh of the model's triangles without its slots. `colour_scale`: the number that stands for 1 in
    /// colours.
    fn part(&self, triangles: &Triangles, (shading, colour_scale): (Shading, f32)) -> Mesh {
        let [points, texcoords, normals] = &self.corners;
        let normal =
            |corner: usize| Vec3::from_slice(&self.normals[normals[corner] as usize * 3..]).normalize_or_zero();
        let uv = |corner: usize| {
            let ix = texcoords[corner] as usize;
            // The origin of OBJ's coordinates is the lower left corner of the image.
            Vec2::new(self.texcoords[ix * 2], 1.0 - self.texcoords[ix * 2 + 1])
        };
        let colour = |corner: usize| {
            let colour = Vec3::from_slice(&self.colours[points[corner] as usize * 3..]) / colour_scale;
            Vec3::from_array(colour.to_array().map(linear_of_srgb)).extend(1.0)
        };
        let mut part = Mesh {
            positions: self.positions.as_chunks().0.iter().copied().map(Vec3::from_array).collect(),
            faces: triangles.each(|corner| points[corner]),
            ..Mesh::default()
        };
        part.normals = match shading.smooth && self.kind.shading == FaceShading::Normals {
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

/// Joins all models into one mesh. Also returns whether the crease angle counts. `colour_scale`: the number that
/// stands for 1 in colours.
pub fn mesh(models: &[Model], no_material: u32, (shading, colour_scale): (Shading, f32)) -> (Mesh, bool) {
    let mut mesh = Mesh::default();
    let mut to_smooth = Vec::new();
    let mut triangulator = Triangulator::default();
    let faces: Vec<Part> = models.iter().map(Model::faces).collect();
    let mut coincident = CoincidentTriangles::new(Coincident::of(&faces));
    for (model_ix, model) in models.iter().enumerate() {
        let triangles = model.triangles(&mut triangulator);
        let part = model.part(&triangles, (shading, colour_scale));
        let n_faces = part.faces.len();
        let is_smoothed = shading.smooth && model.kind.shading == FaceShading::Smooth;
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
