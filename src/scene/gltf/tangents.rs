//! Tangents of meshes that have a normal map but no tangents, by MikkTSpace.

use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};
use glam::{Affine2, Vec3, Vec4};
use hashbrown::HashMap;

use crate::scene::mesh::Mesh;

/// Largest number of triangles at one point. The algorithm visits them by recursion, so that a large fan would exhaust
/// the stack. Those beyond get no tangents.
const MAX_TRIANGLES_AT_POINT: u32 = 1000;

/// How a primitive's normal map uses texture coordinates.
#[derive(Clone, Copy)]
pub(super) struct NormalMap {
    /// Set of texture coordinates.
    pub uv_set: usize,
    /// Transform of the texture coordinates.
    pub transform: Affine2,
}

/// Adds tangents to a mesh if it has the texture coordinates.
pub(super) fn add_tangents(mesh: &mut Mesh, map: &NormalMap) {
    if mesh.uvs[map.uv_set].is_empty() {
        return;
    }
    let mut n_at_point = HashMap::new();
    for ix in mesh.faces.as_flattened() {
        *n_at_point.entry(key(mesh.positions[*ix as usize])).or_insert(0) += 1;
    }
    let is_light = |face: &[u32; 3]| {
        face.iter().all(|ix| n_at_point[&key(mesh.positions[*ix as usize])] <= MAX_TRIANGLES_AT_POINT)
    };
    let faces: Vec<usize> = (0..mesh.faces.len()).filter(|ix| is_light(&mesh.faces[*ix])).collect();
    let tangents = vec![[Vec4::ZERO; 3]; mesh.faces.len()];
    let mut surface = Surface { mesh, map, faces: &faces, tangents };
    if generate_tangents(&mut surface).is_ok() {
        mesh.tangents = surface.tangents;
    }
}

/// Returns the bits of a position. Both zeros are the same.
fn key(position: Vec3) -> [u32; 3] {
    (position + 0.0).to_array().map(f32::to_bits)
}

/// The faces of a mesh as the algorithm reads them.
struct Surface<'a> {
    mesh: &'a Mesh,
    map: &'a NormalMap,
    faces: &'a [usize],
    tangents: Vec<[Vec4; 3]>,
}

impl Surface<'_> {
    fn point(&self, face: usize, corner: usize) -> Vec3 {
        self.mesh.positions[self.mesh.faces[self.faces[face]][corner] as usize]
    }
}

impl Geometry for Surface<'_> {
    fn num_faces(&self) -> usize {
        self.faces.len()
    }

    fn num_vertices_of_face(&self, _: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        self.point(face, corner).to_array()
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        let normals = self.mesh.normals[self.faces[face]];
        if normals.contains(&Vec3::ZERO) {
            let [a, b, c] = [0, 1, 2].map(|corner| self.point(face, corner));
            (b - a).cross(c - a).normalize_or_zero().to_array()
        } else {
            normals[corner].to_array()
        }
    }

    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        let uv = self.mesh.uvs[self.map.uv_set][self.faces[face]][corner];
        self.map.transform.transform_point2(uv).to_array()
    }

    fn set_tangent(&mut self, space: Option<TangentSpace>, face: usize, corner: usize) {
        let Some(space) = space else { return };
        // The algorithm's bitangent points along increasing v, and that of a mesh along decreasing v.
        let [x, y, z, sign] = space.tangent_encoded();
        if let Some(along) = Vec3::new(x, y, z).try_normalize() {
            self.tangents[self.faces[face]][corner] = along.extend(-sign);
        }
    }
}
