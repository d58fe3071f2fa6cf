//! Meshes that morph targets and joints deform. Twin of `glsl/passes/deform_vertices.comp`, which computes the same in
//! the same order and has the same bits.

use std::{collections::BTreeMap, sync::Arc};

use glam::{DMat4, DVec3, Vec3, Vec4};
use rayon::prelude::*;

use super::Mesh;
use crate::layout::{
    FLAT_NORMAL, Triangle,
    normal::{decode_exactly, encode_exactly, scale_to_one},
};

/// What deforms the vertices of a mesh: first morph targets, then joints.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Deformation {
    /// Positions at rest.
    pub positions: Vec<Vec3>,
    /// Normals at rest, one for each vertex or none: unit length, or zero.
    pub normals: Vec<Vec3>,
    /// Tangents at rest, one for each vertex or none: as those of [`Mesh::tangents`], or zero.
    pub tangents: Vec<Vec4>,
    /// What morph targets add to vertices: those of a vertex after those of the one before, in ascending order of
    /// targets. A target that does not change a vertex is left out there.
    pub deltas: Vec<MorphDelta>,
    /// The index of the first delta of each vertex, and the number of deltas. Empty without deltas.
    pub first_deltas: Vec<u32>,
    /// The number of influences of each vertex. 0 if no joint moves the mesh.
    pub n_influences: usize,
    /// The influences of each vertex. Their weights add up to 1.
    pub influences: Vec<Influence>,
}

/// What a morph target of weight 1 adds to a vertex.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MorphDelta {
    /// The index of the target's weight in [`Pose::weights`].
    pub target: u32,
    /// Added to the position.
    pub position: Vec3,
    /// Added to the normal.
    pub normal: Vec3,
    /// Added to the direction of the tangent.
    pub tangent: Vec3,
}

/// A joint's share in the place of a vertex.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Influence {
    /// The index in [`Pose::joints`].
    pub joint: u32,
    /// The share. Negative shares are allowed.
    pub weight: f32,
}

/// A moment of a deformation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pose {
    /// Weights of the morph targets; missing ones are 0.
    pub weights: Vec<f32>,
    /// Transforms of the joints.
    pub joints: Vec<JointMatrix>,
}

/// A mesh in a pose. The host computes normals, tangents and triangles when they are needed; devices compute their own
/// from the pose.
#[derive(Clone, Debug)]
pub struct PosedMesh {
    deformation: Arc<Deformation>,
    faces: Arc<[[u32; 3]]>,
    pose: Pose,
    positions: Vec<Vec3>,
}

/// Meshes that are deformed, by index. With a pose, only positions, normals and tangents have changed: they are those
/// of the pose, and the mesh's arrays still hold the earlier ones. Without a pose, the arrays hold the new values.
pub type ChangedMeshes = BTreeMap<usize, Option<Arc<PosedMesh>>>;

impl PosedMesh {
    /// Computes the positions on the current rayon pool.
    ///
    /// # Panics
    /// The pose lacks a joint, or a vertex lacks influences.
    pub fn new(deformation: Arc<Deformation>, faces: Arc<[[u32; 3]]>, pose: Pose) -> Self {
        let positions = deformation.positions_at(&pose);
        Self { deformation, faces, pose, positions }
    }

    /// What deforms the mesh.
    pub fn deformation(&self) -> &Arc<Deformation> {
        &self.deformation
    }

    /// The vertices of each face.
    pub fn faces(&self) -> &Arc<[[u32; 3]]> {
        &self.faces
    }

    /// The moment.
    pub fn pose(&self) -> &Pose {
        &self.pose
    }

    /// The position of each vertex, object space.
    pub fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    /// Returns the positions of a face's corners.
    ///
    /// # Panics
    /// The face names a vertex that there is not.
    pub fn corners(&self, face_ix: usize) -> [Vec3; 3] {
        self.faces[face_ix].map(|ix| self.positions[ix as usize])
    }

    /// Returns all vertices.
    pub fn vertices(&self) -> Vec<Vertex> {
        self.deformation.vertices(&self.pose)
    }

    /// Returns the triangles of all faces, object space.
    ///
    /// # Panics
    /// A face names a vertex that there is not.
    pub fn triangles(&self) -> Vec<Triangle> {
        let vertices = self.vertices();
        self.faces.par_iter().map(|face| triangle_of(face, &vertices).0).collect()
    }

    /// Gives a mesh that has these faces the positions, normals and tangents of the pose.
    pub fn deform(&self, mesh: &mut Mesh) {
        self.deformation.deform(&self.pose, mesh);
    }
}

/// Returns the triangle of a face, and the codes of the tangents at its corners. Twin of
/// `glsl/passes/deform_triangles.comp`.
pub fn triangle_of(face: &[u32; 3], vertices: &[Vertex]) -> (Triangle, [u32; 3]) {
    let [a, b, c] = face.map(|ix| vertices[ix as usize]);
    let triangle =
        Triangle { v0: a.position, n0: a.normal, v1: b.position, n1: b.normal, v2: c.position, n2: c.normal };
    (triangle, [a.tangent, b.tangent, c.tangent])
}

impl Pose {
    fn weight(&self, target: u32) -> f32 {
        self.weights.get(target as usize).copied().unwrap_or(0.0)
    }
}

/// The transform from the mesh at rest to the space of the deformed mesh by a joint alone: an affine map, which may
/// flatten.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointMatrix {
    /// The images of the unit vectors x, y and z.
    pub axes: [Vec3; 3],
    /// The image of the origin.
    pub translation: Vec3,
}

/// A vertex of a deformed mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Vertex {
    /// Position.
    pub position: Vec3,
    /// The code of the normal ([`encode_exactly`]).
    pub normal: u32,
    /// The code of the tangent, whose lowest bit is 1 if the bitangent's side is positive; or `FLAT_NORMAL`.
    pub tangent: u32,
}

/// A vertex whose vectors have any length.
#[derive(Clone, Copy)]
struct Moved {
    position: Vec3,
    normal: Vec3,
    /// With the bitangent's side as w.
    tangent: Vec4,
}

impl JointMatrix {
    /// Rounds a transform, whose last row is ignored, to single precision. `origin`: the point that becomes the origin.
    pub fn new(matrix: DMat4, origin: DVec3) -> Self {
        let axes = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(|axis| axis.truncate().as_vec3());
        Self { axes, translation: (matrix.w_axis.truncate() - origin).as_vec3() }
    }

    /// Adds a share of another transform.
    fn add(self, weight: f32, other: &Self) -> Self {
        let [x, y, z] = self.axes;
        let axes = [x + weight * other.axes[0], y + weight * other.axes[1], z + weight * other.axes[2]];
        Self { axes, translation: self.translation + weight * other.translation }
    }

    fn linear(&self, v: Vec3) -> Vec3 {
        combined(self.axes, v)
    }

    /// Returns the cofactors of the linear map, which transform normals but for a positive factor, and whether it is a
    /// reflection. The map is scaled first, so that nothing overflows.
    fn cofactors(&self) -> ([Vec3; 3], bool) {
        let largest = self.axes.map(|axis| axis.abs().max_element());
        let scale = scale_to_one(largest[0].max(largest[1]).max(largest[2]));
        let [x, y, z] = self.axes.map(|axis| axis * scale);
        let cofactors = [y.cross(z), z.cross(x), x.cross(y)];
        let mirrors = x.dot(cofactors[0]) < 0.0;
        (if mirrors { cofactors.map(|axis| -axis) } else { cofactors }, mirrors)
    }

    fn apply(&self, vertex: Moved) -> Moved {
        let (normals, mirrors) = self.cofactors();
        let side = if mirrors { -vertex.tangent.w } else { vertex.tangent.w };
        Moved {
            position: self.linear(vertex.position) + self.translation,
            normal: combined(normals, vertex.normal),
            // The cross product of reflected vectors is the reverse of their reflected cross product.
            tangent: self.linear(vertex.tangent.truncate()).extend(side),
        }
    }
}

impl Deformation {
    /// Returns whether targets or joints move the mesh.
    pub fn is_deformed(&self) -> bool {
        !self.deltas.is_empty() || self.n_influences > 0
    }

    /// Returns a vertex in a pose.
    ///
    /// # Panics
    /// The pose lacks a joint, or there is no such vertex.
    pub fn vertex(&self, ix: usize, pose: &Pose) -> Vertex {
        let mut moved = self.morphed(ix, pose);
        if self.n_influences > 0 {
            moved = self.blended(ix, pose).apply(moved);
        }
        let tangent = match encode_exactly(moved.tangent.truncate()) {
            FLAT_NORMAL => FLAT_NORMAL,
            code => code & !1 | u32::from(moved.tangent.w > 0.0),
        };
        Vertex { position: moved.position, normal: encode_exactly(moved.normal), tangent }
    }

    /// Returns all vertices in a pose.
    ///
    /// # Panics
    /// The pose lacks a joint, or a vertex lacks influences.
    pub fn vertices(&self, pose: &Pose) -> Vec<Vertex> {
        (0..self.positions.len()).into_par_iter().map(|ix| self.vertex(ix, pose)).collect()
    }

    /// Returns the positions of all vertices in a pose, as [`Deformation::vertices`] does.
    ///
    /// # Panics
    /// Panics as [`Deformation::vertices`] does.
    pub fn positions_at(&self, pose: &Pose) -> Vec<Vec3> {
        (0..self.positions.len()).into_par_iter().map(|ix| self.position(ix, pose)).collect()
    }

    /// Returns the position of a vertex in a pose: that of [`Deformation::vertex`].
    ///
    /// # Panics
    /// The pose lacks a joint, or there is no such vertex.
    pub fn position(&self, ix: usize, pose: &Pose) -> Vec3 {
        let mut position = self.positions[ix];
        for delta in self.deltas_of(ix) {
            let weight = pose.weight(delta.target);
            if weight != 0.0 {
                position += weight * delta.position;
            }
        }
        if self.n_influences == 0 {
            return position;
        }
        let map = self.blended(ix, pose);
        map.linear(position) + map.translation
    }

    /// Returns the sum of the transforms of a vertex's joints, each times its weight.
    fn blended(&self, ix: usize, pose: &Pose) -> JointMatrix {
        let sum = |sum: JointMatrix, it: &Influence| sum.add(it.weight, &pose.joints[it.joint as usize]);
        self.influences_of(ix).iter().fold(JointMatrix::default(), sum)
    }

    /// Returns a vertex with the deltas of its targets.
    fn morphed(&self, ix: usize, pose: &Pose) -> Moved {
        let normal = self.normals.get(ix).copied().unwrap_or_default();
        let tangent = self.tangents.get(ix).copied().unwrap_or_default();
        let mut moved =
            Moved { position: self.positions[ix], normal, tangent: tangent.truncate().extend(side_of(tangent)) };
        for delta in self.deltas_of(ix) {
            let weight = pose.weight(delta.target);
            if weight != 0.0 {
                moved.position += weight * delta.position;
                // A mesh without normals is flat in all poses.
                if !self.normals.is_empty() {
                    moved.normal += weight * delta.normal;
                }
                moved.tangent += (weight * delta.tangent).extend(0.0);
            }
        }
        moved
    }

    /// Returns what morph targets add to a vertex.
    pub fn deltas_of(&self, ix: usize) -> &[MorphDelta] {
        match self.first_deltas.get(ix..ix + 2) {
            Some(ends) => &self.deltas[ends[0] as usize..ends[1] as usize],
            None => &[],
        }
    }

    /// Returns the influences of a vertex.
    pub fn influences_of(&self, ix: usize) -> &[Influence] {
        &self.influences[ix * self.n_influences..][..self.n_influences]
    }

    /// Adds the vertices of another deformation. Where one of them lacks normals or tangents that the other one has,
    /// these are zero.
    ///
    /// # Panics
    /// Joints move the vertices of one deformation alone.
    pub fn append(&mut self, other: Self) {
        if other.positions.is_empty() {
            return;
        }
        if self.positions.is_empty() {
            *self = other;
            return;
        }
        assert_eq!(self.n_influences > 0, other.n_influences > 0, "joints move both");
        let n = (self.positions.len(), self.positions.len() + other.positions.len());
        append(&mut self.normals, other.normals, n);
        append(&mut self.tangents, other.tangents, n);
        let n_influences = self.n_influences.max(other.n_influences);
        self.influences = widened(std::mem::take(&mut self.influences), self.n_influences, n_influences, n.0);
        self.influences.extend(widened(other.influences, other.n_influences, n_influences, n.1 - n.0));
        self.n_influences = n_influences;
        if !(self.deltas.is_empty() && other.deltas.is_empty()) {
            let n_deltas = self.deltas.len() as u32;
            self.first_deltas.resize(n.0, n_deltas);
            self.first_deltas.extend(other.first_deltas.iter().map(|first| n_deltas + first));
            self.deltas.extend(other.deltas);
            self.first_deltas.resize(n.1 + 1, self.deltas.len() as u32);
        }
        self.positions.extend(other.positions);
    }

    /// Gives a mesh, whose faces name the vertices, the positions, normals and tangents of a pose. Normals and tangents
    /// are those of codes, so that the triangles of a world have these codes.
    ///
    /// # Panics
    /// The pose lacks a joint, or a face names a vertex that there is not.
    pub fn deform(&self, pose: &Pose, mesh: &mut Mesh) {
        let vertices = self.vertices(pose);
        mesh.positions = vertices.par_iter().map(|vertex| vertex.position).collect();
        let faces = &mesh.faces;
        mesh.normals = match self.normals.is_empty() {
            true => vec![[Vec3::ZERO; 3]; faces.len()],
            false => corners(faces, |ix| decode_exactly(vertices[ix].normal)),
        };
        mesh.tangents = match self.tangents.is_empty() {
            true => Vec::new(),
            false => corners(faces, |ix| decoded_tangent(vertices[ix].tangent)),
        };
    }

    /// Gives a mesh, whose faces name the vertices, the positions, normals and tangents at rest.
    ///
    /// # Panics
    /// A face names a vertex that there is not.
    pub fn rest(self, mesh: &mut Mesh) {
        mesh.normals = match self.normals.is_empty() {
            true => vec![[Vec3::ZERO; 3]; mesh.faces.len()],
            false => corners(&mesh.faces, |ix| self.normals[ix]),
        };
        mesh.tangents = match self.tangents.is_empty() {
            true => Vec::new(),
            false => corners(&mesh.faces, |ix| self.tangents[ix]),
        };
        mesh.positions = self.positions;
    }
}

/// Returns the side of the bitangent, 1 or -1. A tangent that targets alone make has the side 1.
pub(crate) fn side_of(tangent: Vec4) -> f32 {
    if tangent.w < 0.0 { -1.0 } else { 1.0 }
}

/// Returns the sum of vectors times the coordinates of another one.
fn combined([x, y, z]: [Vec3; 3], v: Vec3) -> Vec3 {
    x * v.x + y * v.y + z * v.z
}

/// Returns the unit tangent of a code with the bitangent's side as w, or zero.
fn decoded_tangent(code: u32) -> Vec4 {
    match code {
        FLAT_NORMAL => Vec4::ZERO,
        code => decode_exactly(code & !1).extend(if code & 1 == 1 { 1.0 } else { -1.0 }),
    }
}

/// Joins two lists, each of which is empty or has an element for each vertex. `n`: vertices of the first list, of both.
fn append<T: Copy + Default>(list: &mut Vec<T>, others: Vec<T>, n: (usize, usize)) {
    if !(list.is_empty() && others.is_empty()) {
        list.resize(n.0, T::default());
        list.extend(others);
        list.resize(n.1, T::default());
    }
}

/// Returns influences with more of them for each of `n` vertices.
fn widened(influences: Vec<Influence>, from: usize, to: usize, n: usize) -> Vec<Influence> {
    if from == to {
        return influences;
    }
    let mut widened = vec![Influence::default(); n * to];
    let pairs = widened.chunks_exact_mut(to).zip(influences.chunks_exact(from));
    pairs.for_each(|(to, of_vertex)| to[..from].copy_from_slice(of_vertex));
    widened
}

/// Returns what belongs to the corners of faces.
fn corners<T: Copy + Send>(faces: &[[u32; 3]], of: impl Fn(usize) -> T + Sync) -> Vec<[T; 3]> {
    faces.par_iter().map(|face| face.map(|ix| of(ix as usize))).collect()
}
