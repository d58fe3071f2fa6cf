//! Tangents of meshes for normal maps, by MikkTSpace (Mikkelsen 2008), the convention of most programs that bake such
//! maps. The tangents of a mesh's file, which only glTF files have, are kept.

#[cfg(test)]
mod tests;

use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};
use glam::{Mat2, Vec2, Vec3, Vec4};
use hashbrown::HashMap;
use rayon::prelude::*;

use super::needs::require_for_tangents;
use crate::scene::model::{Material, Mesh, Scene, error::Checked};

/// Largest number of faces around a point that MikkTSpace sees: it recurs once for each of them. Where more faces
/// meet, each of them gets the tangent of its own plane.
const MAX_FACES_AROUND: u32 = 512;

/// How a normal map uses texture coordinates, as far as tangents depend on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct NormalMap {
    /// Set of texture coordinates.
    uv_set: usize,
    /// Bits of the columns of the linear part of the transform of texture coordinates.
    linear: [u32; 4],
}

impl NormalMap {
    /// Returns how the normal map of a material uses texture coordinates, if it has one.
    fn of(material: &Material) -> Option<Self> {
        let texture = material.maps.normal.as_ref()?;
        let linear = texture.transform.matrix2;
        let (x_axis, y_axis) = (linear.x_axis, linear.y_axis);
        // Positive factors of u and v change no direction.
        let is_upright = x_axis.y == 0.0 && y_axis.x == 0.0 && x_axis.x > 0.0 && y_axis.y > 0.0;
        let linear = if is_upright { Mat2::IDENTITY } else { linear };
        Some(Self { uv_set: texture.uv_set as usize, linear: linear.to_cols_array().map(f32::to_bits) })
    }

    /// Returns the map's texture coordinates at the corners of a face, up to a shift. v grows upwards in the image, as
    /// MikkTSpace expects.
    fn uvs(&self, mesh: &Mesh, face: usize) -> [Vec2; 3] {
        let linear = Mat2::from_cols_array(&self.linear.map(f32::from_bits));
        mesh.uvs[self.uv_set][face].map(|uv| {
            let Vec2 { x, y } = linear * uv;
            Vec2::new(0.0 + x, 0.0 - y)
        })
    }
}

impl Scene {
    /// Gives the meshes the tangents that the normal maps of their instances' materials need. If instances of one mesh
    /// need different tangents, further instances get copies of the mesh.
    ///
    /// # Errors
    /// There is not enough memory. The error is a message for people.
    pub(crate) fn add_tangents(&mut self) -> Checked<()> {
        let of_materials: Vec<Option<NormalMap>> = self.materials.iter().map(NormalMap::of).collect();
        let n_meshes = self.meshes.len();
        // For each mesh, for each of an instance's materials, the normal map.
        let mut needs: Vec<Option<Vec<Option<NormalMap>>>> = vec![None; n_meshes];
        let mut copied_from = Vec::new();
        let mut known = HashMap::new();
        for instance in &mut self.instances {
            let maps: Vec<_> = instance.materials.iter().map(|ix| of_materials[*ix as usize]).collect();
            if maps.iter().all(Option::is_none) {
                continue;
            }
            let mesh_ix = instance.mesh_ix;
            instance.mesh_ix = *known.entry((mesh_ix, maps)).or_insert_with_key(|(_, maps)| {
                let first = &mut needs[mesh_ix];
                if first.is_none() {
                    *first = Some(maps.clone());
                    return mesh_ix;
                }
                needs.push(Some(maps.clone()));
                copied_from.push(mesh_ix);
                n_meshes + copied_from.len() - 1
            });
        }
        let n_faces = |mesh_ix: &usize| self.meshes[*mesh_ix].faces.len() as u64;
        let in_need = (0..n_meshes).filter(|ix| needs[*ix].is_some()).chain(copied_from.iter().copied());
        require_for_tangents(in_need.map(|ix| n_faces(&ix)).collect(), copied_from.iter().map(n_faces).sum())?;
        for mesh_ix in copied_from {
            self.meshes.push(self.meshes[mesh_ix].clone());
        }
        self.meshes.par_iter_mut().zip(needs).for_each(|(mesh, needs)| {
            if let Some(maps) = needs {
                add_tangents(mesh, &maps);
            }
        });
        Ok(())
    }
}

/// Computes tangents for the faces that need them and have none. `maps`: the normal maps of the materials, which the
/// slots select. All other faces without tangents get zero. A mesh whose faces need no tangents, or without the texture
/// coordinates, is left as it is.
fn add_tangents(mesh: &mut Mesh, maps: &[Option<NormalMap>]) {
    // Faces with different maps do not share tangents.
    let mut by_map: Vec<(NormalMap, Vec<usize>)> = Vec::new();
    let mut list_of: HashMap<NormalMap, usize> = HashMap::new();
    for (face, slot) in mesh.slots.iter().enumerate() {
        let has_own = mesh.tangents.get(face).is_some_and(|corners| *corners != [Vec4::ZERO; 3]);
        let Some(map) = maps[*slot as usize % maps.len()].filter(|_| !has_own) else { continue };
        if mesh.uvs[map.uv_set].len() != mesh.faces.len() {
            continue;
        }
        let list = *list_of.entry(map).or_insert_with(|| {
            by_map.push((map, Vec::new()));
            by_map.len() - 1
        });
        by_map[list].1.push(face);
    }
    if !by_map.is_empty() && mesh.tangents.is_empty() {
        mesh.tangents = vec![[Vec4::ZERO; 3]; mesh.faces.len()];
    }
    for (map, faces) in by_map {
        let (paired, alone) = split(mesh, faces);
        for face in alone {
            mesh.tangents[face] = own_tangents(mesh, face, &map);
        }
        let mut surface = Surface { found: vec![[Vec4::ZERO; 3]; paired.len()], mesh, faces: &paired, map };
        // The function's error has no variants.
        let Ok(()) = generate_tangents(&mut surface) else { return };
        let found = surface.found;
        for (face, tangents) in paired.into_iter().zip(found) {
            mesh.tangents[face] = tangents;
        }
    }
}

/// Splits faces into those that MikkTSpace sees, and those at points where too many faces meet. Faces without area
/// are left out: MikkTSpace would search all others for each of them.
fn split(mesh: &Mesh, faces: Vec<usize>) -> (Vec<usize>, Vec<usize>) {
    let place = |p: Vec3| p.to_array().map(f32::to_bits);
    let has_area = |face: &usize| plane_normal(corners(mesh, *face)) != Vec3::ZERO;
    let faces: Vec<usize> = faces.into_iter().filter(has_area).collect();
    let mut n_around: HashMap<[u32; 3], u32> = HashMap::new();
    for p in faces.iter().flat_map(|face| corners(mesh, *face)) {
        *n_around.entry(place(p)).or_default() += 1;
    }
    faces.into_iter().partition(|face| corners(mesh, *face).iter().all(|p| n_around[&place(*p)] <= MAX_FACES_AROUND))
}

/// Returns the corners of a face, without negative zeros, which MikkTSpace distinguishes from positive ones.
fn corners(mesh: &Mesh, face: usize) -> [Vec3; 3] {
    mesh.faces[face].map(|ix| mesh.positions[ix as usize] + Vec3::ZERO)
}

/// Returns the unit normal of a triangle's plane, or zero if it has no area. It is computed in f64, in which the cross
/// product of edges of 1e-20 is not zero.
fn plane_normal(corners: [Vec3; 3]) -> Vec3 {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    (b - a).cross(c - a).normalize_or_zero().as_vec3()
}

/// Returns the normals at the corners of a face: the shading normals, or three times the normal of its plane.
fn normals(mesh: &Mesh, face: usize) -> [Vec3; 3] {
    let normals = mesh.normals[face];
    match normals.contains(&Vec3::ZERO) {
        true => [plane_normal(corners(mesh, face)) + Vec3::ZERO; 3],
        false => normals.map(|normal| normal + Vec3::ZERO),
    }
}

/// Returns the tangents of a face that has no neighbours, or zero if its texture coordinates have no area.
fn own_tangents(mesh: &Mesh, face: usize, map: &NormalMap) -> [Vec4; 3] {
    let [a, b, c] = corners(mesh, face).map(Vec3::as_dvec3);
    let [s, t, u] = map.uvs(mesh, face).map(Vec2::as_dvec2);
    let area = (t - s).perp_dot(u - s);
    if area == 0.0 {
        return [Vec4::ZERO; 3];
    }
    let along_u = ((b - a) * (u - s).y - (c - a) * (t - s).y) * area.signum();
    let tangent = |normal: Vec3| {
        let normal = normal.as_dvec3();
        let tangent = (along_u - normal * normal.dot(along_u)).normalize_or_zero().as_vec3();
        tangent.extend(if area > 0.0 { 1.0 } else { -1.0 })
    };
    normals(mesh, face).map(|normal| checked(tangent(normal)))
}

/// Returns a tangent, or zero in place of one that is no unit vector.
fn checked(tangent: Vec4) -> Vec4 {
    if (tangent.truncate().length_squared() - 1.0).abs() < 0.01 { tangent } else { Vec4::ZERO }
}

/// Some faces of a mesh, as MikkTSpace sees them.
struct Surface<'a> {
    mesh: &'a Mesh,
    faces: &'a [usize],
    map: NormalMap,
    found: Vec<[Vec4; 3]>,
}

impl Geometry for Surface<'_> {
    fn num_faces(&self) -> usize {
        self.faces.len()
    }

    fn num_vertices_of_face(&self, _: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        corners(self.mesh, self.faces[face])[corner].to_array()
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        normals(self.mesh, self.faces[face])[corner].to_array()
    }

    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        self.map.uvs(self.mesh, self.faces[face])[corner].to_array()
    }

    fn set_tangent(&mut self, tangent: Option<TangentSpace>, face: usize, corner: usize) {
        let tangent = tangent.map_or(Vec4::ZERO, |space| Vec4::from_array(space.tangent_encoded()));
        self.found[face][corner] = checked(tangent);
    }
}
