//! Deformation of meshes. Twin of the kernels `deform_vertices` and `deform_triangles`, with the same bits.

use rayon::prelude::*;

use crate::{
    layout::{DeformedVertex, Triangle},
    scene::deformation::{Deformation, Pose, Vertex},
};

/// Returns the vertices of a pose, and the codes of their tangents.
///
/// # Panics
/// The pose lacks a joint.
pub fn deform_vertices(deformation: &Deformation, pose: &Pose) -> Vec<(DeformedVertex, u32)> {
    let deformed = |ix| {
        let Vertex { position, normal, tangent } = deformation.vertex(ix, pose);
        (DeformedVertex { position, normal }, tangent)
    };
    (0..deformation.positions.len()).into_par_iter().map(deformed).collect()
}

/// Returns the triangles of deformed vertices, and the tangents of their corners.
///
/// # Panics
/// A face names a vertex that there is not.
pub fn deform_triangles(faces: &[[u32; 3]], vertices: &[(DeformedVertex, u32)]) -> Vec<(Triangle, [u32; 3])> {
    let triangle = |face: &[u32; 3]| {
        let [(a, _), (b, _), (c, _)] = face.map(|ix| vertices[ix as usize]);
        let tangents = face.map(|ix| vertices[ix as usize].1);
        let triangle =
            Triangle { v0: a.position, n0: a.normal, v1: b.position, n1: b.normal, v2: c.position, n2: c.normal };
        (triangle, tangents)
    };
    faces.par_iter().map(triangle).collect()
}
