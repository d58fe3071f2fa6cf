//! Deformation of meshes. Twin of the kernels `deform_vertices` and `deform_triangles`, with the same bits.

use rayon::prelude::*;

use crate::{
    layout::Triangle,
    scene::deformation::{Deformation, Pose, Vertex, triangle_of},
};

/// Returns the vertices of a pose, and the codes of their tangents.
///
/// # Panics
/// The pose lacks a joint.
pub fn deform_vertices(deformation: &Deformation, pose: &Pose) -> Vec<Vertex> {
    deformation.vertices(pose)
}

/// Returns the triangles of deformed vertices, and the tangents of their corners.
///
/// # Panics
/// A face names a vertex that there is not.
pub fn deform_triangles(faces: &[[u32; 3]], vertices: &[Vertex]) -> Vec<(Triangle, [u32; 3])> {
    faces.par_iter().map(|face| triangle_of(face, vertices)).collect()
}
