//! Indexed meshes in object space.

use glam::{BVec3, Vec2, Vec3, Vec4};
use rayon::prelude::*;

use super::{Transform, error::Checked};

/// Largest absolute value of a world coordinate; a mesh that reaches beyond it is refused. The squared length of a
/// triangle's unnormalized normal, at most (2 sqrt(3) * 1e9)^4 = 1.5e38, must not overflow an f32 (3.4e38).
pub const MAX_COORDINATE: f32 = 1e9;

/// An indexed triangle mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// The name in its file; empty if it has none.
    pub name: String,
    /// Points in object space.
    pub positions: Vec<Vec3>,
    /// Indices into `positions`, counter-clockwise seen from outside.
    pub faces: Vec<[u32; 3]>,
    /// One entry per face: unit shading normals at its three corners. If any of the three is zero, the whole face is
    /// shaded with the normal of its plane.
    pub normals: Vec<[Vec3; 3]>,
    /// One entry per face: its slot, which selects one of the instance's materials.
    pub slots: Vec<u32>,
    /// Two sets of texture coordinates. A set is empty, or has one entry per face: the coordinates at its three
    /// corners. (0, 0) is the upper left corner of an image.
    pub uvs: [Vec<[Vec2; 3]>; 2],
    /// Empty, or one entry per face: colours at its three corners, linear RGB and opacity, by which the material's base
    /// colour and opacity are multiplied.
    pub colours: Vec<[Vec4; 3]>,
    /// Empty, or one entry per face: unit tangents at its three corners, along increasing u, in object space. w is 1 or
    /// -1: the bitangent, along decreasing v, is w times the cross product of normal and tangent.
    pub tangents: Vec<[Vec4; 3]>,
    /// Whether a skin or morph targets of an animated file place its points, so that they may be elsewhere at another
    /// moment.
    pub deforms: bool,
}

impl Mesh {
    /// A mesh of points and triangles, shaded with the normals of their planes.
    pub fn of_triangles(positions: Vec<Vec3>, faces: Vec<[u32; 3]>) -> Self {
        let (normals, slots) = (vec![[Vec3::ZERO; 3]; faces.len()], vec![0; faces.len()]);
        Self { positions, faces, normals, slots, ..Self::default() }
    }

    /// Checks that the arrays belong together, and that the indices of positions are in range. The error follows a
    /// subject: `has ...`.
    pub(crate) fn check(&self) -> Checked<()> {
        let Self { positions, faces, normals, slots, uvs, colours, tangents, name: _, deforms: _ } = self;
        if (normals.len(), slots.len()) != (faces.len(), faces.len()) {
            return Err(format!("has {} faces, {} normals, {} slots", faces.len(), normals.len(), slots.len()));
        }
        let lens = [uvs[0].len(), uvs[1].len(), colours.len(), tangents.len()];
        if let Some(len) = lens.into_iter().find(|&len| len != 0 && len != faces.len()) {
            return Err(format!("has {} faces, and corners of {len}", faces.len()));
        }
        match faces.as_flattened().par_iter().find_first(|ix| **ix as usize >= positions.len()) {
            Some(ix) => Err(format!("has a face with vertex {ix} of {}", positions.len())),
            None => Ok(()),
        }
    }

    /// Adds a face that is shaded with its plane's normal.
    pub fn push_flat(&mut self, face: [u32; 3], slot: u32) {
        self.faces.push(face);
        self.normals.push([Vec3::ZERO; 3]);
        self.slots.push(slot);
    }

    /// Adds a point and returns its index.
    pub fn push_position(&mut self, position: Vec3) -> u32 {
        self.positions.push(position);
        (self.positions.len() - 1) as u32
    }

    /// Adds another mesh. Points at the same place are not merged. Where one of the meshes lacks texture coordinates,
    /// colours or tangents that the other one has, its corners get the coordinates 0, white, and no tangent.
    pub fn append(&mut self, other: Mesh) {
        if self.positions.is_empty() && self.faces.is_empty() {
            *self = Mesh { name: std::mem::take(&mut self.name), ..other };
            return;
        }
        let first = self.positions.len() as u32;
        let n_faces = (self.faces.len(), other.faces.len());
        self.deforms |= other.deforms;
        self.positions.extend(other.positions);
        self.faces.extend(other.faces.iter().map(|face| face.map(|ix| first + ix)));
        self.normals.extend(other.normals);
        self.slots.extend(other.slots);
        for (uvs, others) in self.uvs.iter_mut().zip(other.uvs) {
            append_corners(uvs, others, n_faces, [Vec2::ZERO; 3]);
        }
        append_corners(&mut self.colours, other.colours, n_faces, [Vec4::ONE; 3]);
        append_corners(&mut self.tangents, other.tangents, n_faces, [Vec4::ZERO; 3]);
    }

    /// Leaves out the faces with a corner that is not finite, as programs write for what they could not compute. Such
    /// positions are then at a place where another one is, since no face names them. Returns the number of faces that
    /// are left out.
    pub(crate) fn leave_out_broken_faces(&mut self) -> usize {
        if self.positions.par_iter().all(|p| p.is_finite()) {
            return 0;
        }
        let n_faces = self.faces.len();
        let is_whole: Vec<bool> =
            self.faces.iter().map(|face| face.iter().all(|ix| self.positions[*ix as usize].is_finite())).collect();
        keep(&mut self.faces, &is_whole);
        keep(&mut self.normals, &is_whole);
        keep(&mut self.slots, &is_whole);
        self.uvs.iter_mut().for_each(|uvs| keep(uvs, &is_whole));
        keep(&mut self.colours, &is_whole);
        keep(&mut self.tangents, &is_whole);
        let place = self.positions.iter().copied().find(|p| p.is_finite()).unwrap_or_default();
        self.positions.iter_mut().filter(|p| !p.is_finite()).for_each(|p| *p = place);
        n_faces - self.faces.len()
    }

    /// Returns the least and the greatest coordinates of all positions, object space.
    pub(crate) fn bounds(&self) -> (Vec3, Vec3) {
        bounds_of(self.positions.par_iter().copied())
    }

    /// Checks that the mesh can be placed by a transform, by its bounds alone if these lie within [`MAX_COORDINATE`].
    ///
    /// # Errors
    /// Fails as [`Mesh::placed`] does.
    pub(crate) fn check_place(&self, transform: &Transform, bounds: (Vec3, Vec3)) -> Checked<()> {
        check_place(&self.positions, transform, bounds)
    }

    /// Returns the positions in world space.
    ///
    /// # Errors
    /// A position is not finite or lies beyond [`MAX_COORDINATE`]. The error is a message for people.
    pub fn placed(&self, transform: &Transform) -> Checked<Vec<Vec3>> {
        placed(&self.positions, transform)
    }
}

/// Does what [`Mesh::check_place`] does, for positions.
pub(crate) fn check_place(positions: &[Vec3], transform: &Transform, (min, max): (Vec3, Vec3)) -> Checked<()> {
    // Rounding may move a position by less than the difference.
    let is_inside = |p: Vec3| p.is_finite() && p.abs().max_element() <= 0.999 * MAX_COORDINATE;
    if positions.is_empty() || box_corners(min, max).into_iter().all(|p| is_inside(transform.point(p))) {
        return Ok(());
    }
    placed(positions, transform).map(drop)
}

fn placed(positions: &[Vec3], transform: &Transform) -> Checked<Vec<Vec3>> {
    let world: Vec<Vec3> = positions.par_iter().map(|p| transform.point(*p)).collect();
    let is_inside = |p: &Vec3| p.is_finite() && p.abs().max_element() <= MAX_COORDINATE;
    match world.par_iter().find_first(|p| !is_inside(p)) {
        Some(p) => Err(format!("a vertex lies at {:?} in world space: beyond {MAX_COORDINATE:e}", p.to_array())),
        None => Ok(world),
    }
}

/// Returns the positions at which faces have corners, each once.
///
/// # Panics
/// An index is out of range.
pub(crate) fn corners_of(faces: &[[u32; 3]], positions: &[Vec3]) -> Vec<Vec3> {
    let mut is_corner = vec![false; positions.len()];
    faces.as_flattened().iter().for_each(|ix| is_corner[*ix as usize] = true);
    positions.iter().zip(is_corner).filter(|(_, is_corner)| *is_corner).map(|(p, _)| *p).collect()
}

/// Keeps the items of a list that is empty or has one for each face.
fn keep<T>(list: &mut Vec<T>, is_kept: &[bool]) {
    let mut is_kept = is_kept.iter();
    list.retain(|_| *is_kept.next().expect("there is one for each face"));
}

/// Joins two lists of corners, each of which may be empty. `n_faces`: the faces of their meshes.
fn append_corners<T: Copy>(corners: &mut Vec<T>, others: Vec<T>, n_faces: (usize, usize), missing: T) {
    if corners.is_empty() && others.is_empty() {
        return;
    }
    corners.resize(n_faces.0, missing);
    corners.extend(others);
    corners.resize(n_faces.0 + n_faces.1, missing);
}

/// Returns the corners of a box.
pub(crate) fn box_corners(min: Vec3, max: Vec3) -> [Vec3; 8] {
    [0, 1, 2, 3, 4, 5, 6, 7].map(|ix| Vec3::select(BVec3::new(ix & 1 > 0, ix & 2 > 0, ix & 4 > 0), min, max))
}

/// Returns the least and the greatest coordinates of points.
pub(crate) fn bounds_of(points: impl ParallelIterator<Item = Vec3>) -> (Vec3, Vec3) {
    let none = || (Vec3::INFINITY, Vec3::NEG_INFINITY);
    points.map(|p| (p, p)).reduce(none, |a, b| (a.0.min(b.0), a.1.max(b.1)))
}
