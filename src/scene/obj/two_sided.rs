//! Faces that are there twice, once for each side, with a material for each: SketchUp writes walls like this.
//! Both lie in one plane, so that chance would decide which of the two a ray hits. Each is therefore moved to its own
//! side, by a distance that no picture shows.

use std::{collections::HashMap, ops::Range};

use glam::Vec3;
use rayon::prelude::*;

use super::model::Model;
use crate::scene::{mesh::Mesh, mesh_file::bounds_of};

/// Distance by which a face is moved, as a share of the largest coordinate or of the diagonal of the mesh. It is 16
/// steps of single precision.
const SHARE: f32 = 2e-6;

/// Returns the corners of the faces which are there twice with opposite sides and other materials, as ranges for each
/// model.
pub fn two_sided_faces(models: &[Model]) -> Vec<Vec<Range<usize>>> {
    let mut found = vec![Vec::new(); models.len()];
    if models.iter().all(|model| model.material_ix == models[0].material_ix) {
        return found;
    }
    let mut all: Vec<Face> = models.par_iter().enumerate().flat_map_iter(faces_of).collect();
    all.par_sort_unstable();
    for alike in all.chunk_by(|a, b| a.key == b.key).filter(|alike| alike.len() > 1) {
        let material = |face: &Face| models[face.model_ix].material_ix;
        let first = alike[0].polygon(models);
        let sides: Vec<_> = alike.iter().map(|face| is_turned(&first, &face.polygon(models))).collect();
        let is_other =
            |(face, side): (&Face, &Option<bool>)| *side == Some(true) && material(face) != material(&alike[0]);
        if !alike.iter().zip(&sides).any(is_other) {
            continue;
        }
        let of_pair = alike.iter().zip(sides).filter(|(_, side)| side.is_some());
        of_pair.for_each(|(face, _)| found[face.model_ix].push(face.corners()));
    }
    found
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

/// Moves faces along their normals. They get points of their own.
pub fn move_apart(mesh: &mut Mesh, faces: &[usize]) {
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
