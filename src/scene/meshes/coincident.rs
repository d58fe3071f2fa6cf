//! Faces that are there several times. All of them lie in one plane, so that chance would decide which one a ray hits.
//!
//! SketchUp writes a wall twice, once for each side, if both sides have a material. Each is moved to its own side, by a
//! distance that no picture shows. Of faces with the same side, the first one in the file counts: the others become
//! triangles without area, which no ray hits and which emit no light.

use std::{
    collections::{HashMap, HashSet},
    ops::Range,
};

use glam::Vec3;
use rayon::prelude::*;

use crate::scene::model::{Mesh, mesh::bounds_of};

/// Distance by which a face is moved, as a share of the largest coordinate or of the diagonal of the mesh. It is at
/// least 16 units in the last place of the coordinate.
const SHARE: f32 = 2e-6;

/// Faces of a file, in the order of the file.
pub(crate) struct FaceGroup<'a> {
    /// Three numbers a point.
    pub points: &'a [f32],
    /// Index of the point of each corner.
    pub corners: &'a [u32],
    /// Numbers of the faces' corners. Empty if all faces are triangles.
    pub arities: &'a [u32],
    pub looks: Looks<'a>,
}

/// What tells faces apart that look different.
pub(crate) enum Looks<'a> {
    /// All faces of the group have this material.
    Material(Option<usize>),
    /// The faces are those of a mesh, with their slots and colours.
    Mesh(&'a Mesh),
}

impl FaceGroup<'_> {
    /// Returns a number that differs for nearly all faces which look different.
    fn look(&self, face_ix: usize) -> u64 {
        match &self.looks {
            Looks::Material(ix) => ix.map_or(0, |ix| ix as u64 + 1),
            Looks::Mesh(mesh) => {
                let colours = mesh.colours.get(face_ix).into_iter().flatten();
                colours.fold(u64::from(mesh.slots[face_ix]), |sum, colour| mix(sum, hash(colour.truncate())))
            }
        }
    }

    fn point(&self, corner: usize) -> Vec3 {
        Vec3::from_slice(&self.points[self.corners[corner] as usize * 3..])
    }

    /// Returns the first corner of each face, and the number of its corners.
    fn faces<'b>(&'b self) -> Box<dyn Iterator<Item = (usize, usize)> + 'b> {
        if self.arities.is_empty() {
            return Box::new((0..self.corners.len() / 3).map(|ix| (3 * ix, 3)));
        }
        Box::new(self.arities.iter().scan(0, |first, n| {
            let face = (*first, *n as usize);
            *first += face.1;
            Some(face)
        }))
    }
}

/// The faces of groups that are there several times.
#[derive(Debug, Default)]
pub(crate) struct Coincident {
    /// The faces that have an opposite one which looks different.
    two_sided: HashSet<FacePlace>,
    /// Repeated faces with the same side: all except the first one of each group.
    repeated: Vec<FacePlace>,
}

/// The place of a face: the index of its group, and its first corner there.
type FacePlace = (usize, usize);

impl Coincident {
    /// Finds the faces that are there several times and look different.
    pub fn of(groups: &[FaceGroup]) -> Self {
        let mut found = Self::default();
        let can_differ = |group: &FaceGroup| match &group.looks {
            Looks::Material(_) => group.look(0) != groups[0].look(0),
            Looks::Mesh(mesh) => have_looks(mesh) && have_repeated_keys(group),
        };
        if !groups.iter().any(can_differ) {
            return found;
        }
        let mut all: Vec<Face> = groups.par_iter().enumerate().flat_map_iter(faces_of).collect();
        all.par_sort_unstable();
        for alike in all.chunk_by(|a, b| a.key == b.key).filter(|alike| alike.len() > 1) {
            found.add(groups, alike);
        }
        found
    }

    /// Adds those of a few faces, ordered by their places, that have the points of the first one.
    fn add(&mut self, groups: &[FaceGroup], alike: &[Face]) {
        let look = |face: &Face| groups[face.group_ix].look(face.face_ix);
        let first = alike[0].polygon(groups);
        let (mut same, mut opposite) = (Vec::new(), Vec::new());
        for face in alike {
            match is_turned(&first, &face.polygon(groups)) {
                Some(false) => same.push(face),
                Some(true) => opposite.push(face),
                None => {}
            }
        }
        if opposite.iter().any(|face| look(face) != look(&alike[0])) {
            self.two_sided.extend(same.iter().chain(&opposite).map(|face| face.place()));
        }
        for side in [same, opposite] {
            self.repeated.extend(side.iter().skip(1).map(|face| face.place()));
        }
    }
}

/// A face of a group.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Face {
    /// Sum over its corners, which does not depend on their order.
    key: u64,
    group_ix: usize,
    first_corner: usize,
    n_corners: usize,
    /// Its index among the faces of the group.
    face_ix: usize,
}

impl Face {
    /// Returns its points.
    fn polygon(&self, groups: &[FaceGroup]) -> Vec<Vec3> {
        self.corners().map(|corner| groups[self.group_ix].point(corner)).collect()
    }

    fn place(&self) -> FacePlace {
        (self.group_ix, self.first_corner)
    }

    fn corners(&self) -> Range<usize> {
        self.first_corner..self.first_corner + self.n_corners
    }
}

/// Returns whether some faces of a mesh look different from others.
fn have_looks(mesh: &Mesh) -> bool {
    !mesh.colours.is_empty() || mesh.slots.iter().any(|slot| *slot != mesh.slots[0])
}

/// Returns whether some triangles of a group have the same key. Most meshes end here, after less memory and time than
/// their faces with all places would take.
fn have_repeated_keys(group: &FaceGroup) -> bool {
    let triangles: &[[u32; 3]] = group.corners.as_chunks().0;
    let of_corner = |ix: u32| hash(Vec3::from_slice(&group.points[ix as usize * 3..]));
    let key = |triangle: &[u32; 3]| triangle.iter().fold(0_u64, |sum, ix| sum.wrapping_add(of_corner(*ix)));
    let mut keys: Vec<u64> = triangles.par_iter().map(key).collect();
    keys.par_sort_unstable();
    keys.par_windows(2).any(|pair| pair[0] == pair[1])
}

fn faces_of<'a>((group_ix, group): (usize, &'a FaceGroup)) -> impl Iterator<Item = Face> + use<'a> {
    group.faces().enumerate().map(move |(face_ix, (first_corner, n_corners))| {
        let corners = (first_corner..first_corner + n_corners).map(|corner| hash(group.point(corner)));
        let key = corners.fold(n_corners as u64, u64::wrapping_add);
        Face { key, group_ix, first_corner, n_corners, face_ix }
    })
}

/// Returns a number that differs for nearly all points.
fn hash(point: Vec3) -> u64 {
    // 0 and -0 are one place.
    let bits = point.to_array().map(|x| u64::from((x + 0.0).to_bits()));
    mix(bits.into_iter().fold(1, mix), 7)
}

fn mix(sum: u64, bits: u64) -> u64 {
    (sum ^ bits).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(31)
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

/// The triangles of a mesh that come from faces which are there several times.
pub(crate) struct CoincidentTriangles {
    faces: Coincident,
    /// Indices of triangles by their faces.
    triangles: HashMap<FacePlace, Vec<usize>>,
}

impl CoincidentTriangles {
    /// Returns no triangles of these faces.
    pub fn new(faces: Coincident) -> Self {
        let places = faces.repeated.iter().chain(&faces.two_sided);
        let triangles = places.map(|place| (*place, Vec::new())).collect();
        Self { faces, triangles }
    }

    /// Adds the triangles of a group. `first_triangle`: the index of the first one in the mesh. `corners`: the first
    /// corner of each triangle in the group.
    pub fn add(
        &mut self,
        (group_ix, group): (usize, &FaceGroup),
        first_triangle: usize,
        corners: impl Fn() -> Vec<usize>,
    ) {
        if self.triangles.is_empty() {
            return;
        }
        // The first corner of the face to which each corner belongs.
        let first_corners: Vec<usize> = group.faces().flat_map(|(first, n)| std::iter::repeat_n(first, n)).collect();
        for (ix, corner) in corners().into_iter().enumerate() {
            if let Some(triangles) = self.triangles.get_mut(&(group_ix, first_corners[corner])) {
                triangles.push(first_triangle + ix);
            }
        }
    }

    /// Makes repeated faces triangles without area, and moves opposite faces apart.
    pub fn separate(&self, mesh: &mut Mesh) {
        for ix in self.faces.repeated.iter().flat_map(|place| &self.triangles[place]) {
            mesh.faces[*ix] = [mesh.faces[*ix][0]; 3];
        }
        let mut to_move: Vec<usize> =
            self.faces.two_sided.iter().flat_map(|place| &self.triangles[place]).copied().collect();
        to_move.sort_unstable();
        move_apart(mesh, &to_move);
    }
}

fn group_of<'a>(mesh: &'a Mesh, positions: &'a [Vec3]) -> FaceGroup<'a> {
    let (points, corners) = (bytemuck::cast_slice(positions), mesh.faces.as_flattened());
    FaceGroup { points, corners, arities: &[], looks: Looks::Mesh(mesh) }
}

/// Whether triangles of a mesh are there several times and look different. `positions`: in place of the mesh's.
pub(crate) fn has_several(mesh: &Mesh, positions: &[Vec3]) -> bool {
    let found = Coincident::of(&[group_of(mesh, positions)]);
    !(found.two_sided.is_empty() && found.repeated.is_empty())
}

/// Separates the triangles of a mesh that are there several times and look different.
pub(crate) fn separate(mesh: &mut Mesh) {
    let group = group_of(mesh, &mesh.positions);
    let mut found = CoincidentTriangles::new(Coincident::of(std::slice::from_ref(&group)));
    found.add((0, &group), 0, || (0..mesh.faces.len()).map(|ix| 3 * ix).collect());
    found.separate(mesh);
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
