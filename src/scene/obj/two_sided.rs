//! Faces that are there several times. All of them lie in one plane, so that chance would decide which one a ray hits.
//!
//! SketchUp writes a wall twice, once for each side, if both sides have a material. Each is moved to its own side, by a
//! distance that no picture shows. Of faces with the same side, the first one in the file counts: the others become
//! copies of it.

use std::{
    collections::{HashMap, HashSet},
    ops::Range,
};

use glam::Vec3;
use rayon::prelude::*;

use super::model::Model;
use crate::scene::{mesh::Mesh, mesh_file::bounds_of};

/// Distance by which a face is moved, as a share of the largest coordinate or of the diagonal of the mesh. It is 16
/// steps of single precision.
const SHARE: f32 = 2e-6;

/// The faces of models that are there several times.
#[derive(Debug, Default)]
pub struct Coincident {
    /// The faces that have an opposite one with another material.
    pub two_sided: HashSet<FacePlace>,
    /// Faces that are there again with the same side, each with the first of its kind.
    pub repeated: Vec<(FacePlace, FacePlace)>,
}

/// The place of a face: the index of its model, and its first corner there.
pub type FacePlace = (usize, usize);

impl Coincident {
    /// Finds the faces that are there several times with different materials.
    pub fn of(models: &[Model]) -> Self {
        let mut found = Self::default();
        if models.iter().all(|model| model.material_ix == models[0].material_ix) {
            return found;
        }
        let mut all: Vec<Face> = models.par_iter().enumerate().flat_map_iter(faces_of).collect();
        all.par_sort_unstable();
        for alike in all.chunk_by(|a, b| a.key == b.key).filter(|alike| alike.len() > 1) {
            found.add(models, alike);
        }
        found
    }

    /// Adds those of a few faces, ordered by their places, that have the points of the first one.
    fn add(&mut self, models: &[Model], alike: &[Face]) {
        let material = |face: &Face| models[face.model_ix].material_ix;
        let first = alike[0].polygon(models);
        let (mut same, mut opposite) = (Vec::new(), Vec::new());
        for face in alike {
            match is_turned(&first, &face.polygon(models)) {
                Some(false) => same.push(face),
                Some(true) => opposite.push(face),
                None => {}
            }
        }
        if opposite.iter().any(|face| material(face) != material(&alike[0])) {
            self.two_sided.extend(same.iter().chain(&opposite).map(|face| face.place()));
        }
        for side in [same, opposite] {
            self.repeated.extend(side.iter().skip(1).map(|face| (face.place(), side[0].place())));
        }
    }
}

/// A face of a model.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Face {
    /// Sum over its corners, which does not depend on their order.
    key: u64,
    model_ix: usize,
    first_corner: usize,
    n_corners: usize,
}

impl Face {
    /// Returns its points.
    fn polygon(&self, models: &[Model]) -> Vec<Vec3> {
        self.corners().map(|corner| point(&models[self.model_ix], corner)).collect()
    }

    fn place(&self) -> FacePlace {
        (self.model_ix, self.first_corner)
    }

    fn corners(&self) -> Range<usize> {
        self.first_corner..self.first_corner + self.n_corners
    }
}

fn faces_of((model_ix, model): (usize, &Model)) -> Vec<Face> {
    let face = |(first_corner, n_corners): (usize, usize)| {
        let corners = (first_corner..first_corner + n_corners).map(|corner| hash(point(model, corner)));
        Face { key: corners.fold(n_corners as u64, u64::wrapping_add), model_ix, first_corner, n_corners }
    };
    faces(model).map(face).collect()
}

/// Returns the first corner of each face, and the number of its corners.
fn faces<'a>(model: &'a Model) -> Box<dyn Iterator<Item = (usize, usize)> + 'a> {
    if model.arities.is_empty() {
        return Box::new((0..model.corners[0].len() / 3).map(|ix| (3 * ix, 3)));
    }
    Box::new(model.arities.iter().scan(0, |first, n| {
        let face = (*first, *n as usize);
        *first += face.1;
        Some(face)
    }))
}

fn point(model: &Model, corner: usize) -> Vec3 {
    Vec3::from_slice(&model.positions[model.corners[0][corner] as usize * 3..])
}

/// Returns a number that differs for nearly all points.
fn hash(point: Vec3) -> u64 {
    // 0 and -0 are one place.
    let bits = point.to_array().map(|x| u64::from((x + 0.0).to_bits()));
    let mix = |sum: u64, bits: u64| (sum ^ bits).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(31);
    mix(bits.into_iter().fold(1, mix), 7)
}

/// Returns whether `b` has the points of `a` in the opposite order, or `None` if its points are not those of `a`.
fn is_turned(a: &[Vec3], b: &[Vec3]) -> Option<bool> {
    let n = a.len();
    let start = (b.len() == n).then(|| b.iter().position(|point| *point == a[0])).flatten()?;
    let same = |ix: usize| b[(start + ix) % n] == a[ix];
    let opposite = |ix: usize| b[(start + n - ix) % n] == a[ix];
    match ((0..n).all(same), (0..n).all(opposite)) {
        (true, _) => Some(false),
        (_, true) => Some(true),
        _ => None,
    }
}

/// Returns the first corner of the face to which each corner of a model belongs.
fn first_corners(model: &Model) -> Vec<usize> {
    faces(model).flat_map(|(first, n)| std::iter::repeat_n(first, n)).collect()
}

/// The triangles of a mesh that come from faces which are there several times.
pub struct CoincidentTriangles {
    faces: Coincident,
    /// Indices of triangles by their faces.
    triangles: HashMap<FacePlace, Vec<usize>>,
}

impl CoincidentTriangles {
    /// Returns no triangles of these faces.
    pub fn new(faces: Coincident) -> Self {
        let places = faces.repeated.iter().flat_map(|(again, first)| [*again, *first]);
        let triangles = places.chain(faces.two_sided.iter().copied()).map(|place| (place, Vec::new())).collect();
        Self { faces, triangles }
    }

    /// Adds the triangles of a model. `first_triangle`: the index of the first one in the mesh. `corners`: the first
    /// corner of each triangle in the model.
    pub fn add(&mut self, (model_ix, model): (usize, &Model), first_triangle: usize, corners: impl Fn() -> Vec<usize>) {
        if self.triangles.is_empty() {
            return;
        }
        let first_corners = first_corners(model);
        for (ix, corner) in corners().into_iter().enumerate() {
            if let Some(triangles) = self.triangles.get_mut(&(model_ix, first_corners[corner])) {
                triangles.push(first_triangle + ix);
            }
        }
    }

    /// Makes copies of the first faces of their kinds, and moves opposite faces apart.
    pub fn separate(&self, mesh: &mut Mesh) {
        for (again, first) in &self.faces.repeated {
            self.triangles[again].iter().zip(&self.triangles[first]).for_each(|(to, from)| copy(mesh, *from, *to));
        }
        let mut to_move: Vec<usize> =
            self.faces.two_sided.iter().flat_map(|place| &self.triangles[place]).copied().collect();
        to_move.sort_unstable();
        move_apart(mesh, &to_move);
    }
}

/// Makes a triangle of a mesh a copy of another one.
fn copy(mesh: &mut Mesh, from: usize, to: usize) {
    mesh.faces[to] = mesh.faces[from];
    mesh.normals[to] = mesh.normals[from];
    mesh.slots[to] = mesh.slots[from];
    for uvs in mesh.uvs.iter_mut().filter(|uvs| !uvs.is_empty()) {
        uvs[to] = uvs[from];
    }
    if !mesh.colours.is_empty() {
        mesh.colours[to] = mesh.colours[from];
    }
}

/// Moves faces along their normals. They get points of their own.
fn move_apart(mesh: &mut Mesh, faces: &[usize]) {
    if faces.is_empty() {
        return;
    }
    let (min, max) = bounds_of(mesh.positions.par_iter().copied());
    let largest = min.abs().max(max.abs()).max_element().max((max - min).length());
    let mut moved: HashMap<(u32, [u32; 3]), u32> = HashMap::new();
    for face_ix in faces.iter().copied() {
        let face = mesh.faces[face_ix];
        let [a, b, c] = face.map(|ix| mesh.positions[ix as usize]);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        mesh.faces[face_ix] = face.map(|ix| {
            let moved_ix = moved.entry((ix, normal.to_array().map(f32::to_bits))).or_insert_with(|| {
                mesh.positions.push(mesh.positions[ix as usize] + SHARE * largest * normal);
                mesh.positions.len() as u32 - 1
            });
            *moved_ix
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turned_faces_are_told_by_their_points() {
        let [a, b, c, d] = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];
        assert_eq!(is_turned(&[a, b, c, d], &[c, d, a, b]), Some(false));
        assert_eq!(is_turned(&[a, b, c, d], &[b, a, d, c]), Some(true));
        assert_eq!(is_turned(&[a, b, c, d], &[a, c, b, d]), None);
        assert_eq!(is_turned(&[a, b, c], &[a, b, c, d]), None);
        assert_eq!(is_turned(&[a, b, c], &[d, b, c]), None);
    }
}
