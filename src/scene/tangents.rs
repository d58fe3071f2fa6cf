//! Tangents of meshes for normal maps, by MikkTSpace (Mikkelsen 2008), the convention of most programs that bake such
//! maps.

use std::collections::HashMap;

use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};
use glam::{Vec2, Vec3, Vec4};

use super::mesh::Mesh;

/// Largest number of faces around a point that MikkTSpace sees: it recurs once for each of them. Where more faces
/// meet, each of them gets the tangent of its own plane.
const MAX_FACES_AROUND: u32 = 512;

/// Computes tangents for the faces for which `needs` returns the set of texture coordinates of their normal map. All
/// other faces get none, zero. A face without shading normals has the normal of its plane. A mesh without such faces,
/// or without the texture coordinates, is left as it is.
pub(super) fn add_tangents(mesh: &mut Mesh, needs: impl Fn(usize) -> Option<usize>) {
    for set in 0..mesh.uvs.len() {
        if mesh.uvs[set].len() != mesh.faces.len() {
            continue;
        }
        let faces: Vec<usize> = (0..mesh.faces.len()).filter(|face| needs(*face) == Some(set)).collect();
        if faces.is_empty() {
            continue;
        }
        if mesh.tangents.is_empty() {
            mesh.tangents = vec![[Vec4::ZERO; 3]; mesh.faces.len()];
        }
        let (paired, alone) = split(mesh, faces);
        for face in alone {
            mesh.tangents[face] = own_tangents(mesh, face, set);
        }
        let mut surface = Surface { found: vec![[Vec4::ZERO; 3]; paired.len()], mesh, faces: &paired, set };
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
    let corners = |face: usize| mesh.faces[face].map(|ix| mesh.positions[ix as usize]);
    let place = |p: Vec3| (p + Vec3::ZERO).to_array().map(f32::to_bits);
    let has_area = |face: &usize| plane_normal(corners(*face)) != Vec3::ZERO;
    let faces: Vec<usize> = faces.into_iter().filter(has_area).collect();
    let mut n_around: HashMap<[u32; 3], u32> = HashMap::new();
    for p in faces.iter().flat_map(|face| corners(*face)) {
        *n_around.entry(place(p)).or_default() += 1;
    }
    faces.into_iter().partition(|face| corners(*face).iter().all(|p| n_around[&place(*p)] <= MAX_FACES_AROUND))
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
        true => [plane_normal(mesh.faces[face].map(|ix| mesh.positions[ix as usize])); 3],
        false => normals,
    }
}

/// Returns texture coordinates whose v grows upwards in the image, as MikkTSpace expects.
fn upward(uv: Vec2) -> Vec2 {
    Vec2::new(uv.x, 1.0 - uv.y)
}

/// Returns the tangents of a face that has no neighbours.
fn own_tangents(mesh: &Mesh, face: usize, set: usize) -> [Vec4; 3] {
    let [a, b, c] = mesh.faces[face].map(|ix| mesh.positions[ix as usize].as_dvec3());
    let [s, t, u] = mesh.uvs[set][face].map(|uv| upward(uv).as_dvec2());
    let area = (t - s).perp_dot(u - s);
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
    /// The set of texture coordinates.
    set: usize,
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
        self.mesh.positions[self.mesh.faces[self.faces[face]][corner] as usize].to_array()
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        normals(self.mesh, self.faces[face])[corner].to_array()
    }

    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        upward(self.mesh.uvs[self.set][self.faces[face]][corner]).to_array()
    }

    fn set_tangent(&mut self, tangent: Option<TangentSpace>, face: usize, corner: usize) {
        let tangent = tangent.map_or(Vec4::ZERO, |space| Vec4::from_array(space.tangent_encoded()));
        self.found[face][corner] = checked(tangent);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a square in the plane z = 0 that shows the image upright, and its mirror image beside it.
    fn squares() -> Mesh {
        let mut mesh = Mesh::default();
        for (x, mirrored) in [(0.0, false), (2.0, true)] {
            let corner = |u: f32, v: f32| (Vec3::new(x + u, 1.0 - v, 0.0), Vec2::new(if mirrored { -u } else { u }, v));
            let corners = [corner(0.0, 1.0), corner(1.0, 1.0), corner(1.0, 0.0), corner(0.0, 0.0)];
            let ix = corners.map(|(p, _)| mesh.push_position(p));
            for face in [[0, 1, 2], [0, 2, 3]] {
                mesh.push_flat(face.map(|k: usize| ix[k]), 0);
                mesh.uvs[0].push(face.map(|k| corners[k].1));
            }
        }
        mesh
    }

    #[test]
    fn tangents_are_along_u() {
        let (along, against) = (Vec4::new(1.0, 0.0, 0.0, 1.0), Vec4::new(-1.0, 0.0, 0.0, -1.0));
        let mut mesh = squares();
        add_tangents(&mut mesh, |_| Some(0));
        assert_eq!(mesh.tangents, [[along; 3], [along; 3], [against; 3], [against; 3]]);
        // The bitangent, w times the cross product of normal and tangent, is along decreasing v: +y on both squares.
        for tangent in mesh.tangents.as_flattened() {
            assert_eq!(tangent.w * Vec3::Z.cross(tangent.truncate()), Vec3::Y);
        }
        for face in 0..4 {
            assert_eq!(own_tangents(&mesh, face, 0), mesh.tangents[face]);
        }
    }

    #[test]
    fn only_faces_that_need_them_have_tangents() {
        let mut mesh = squares();
        add_tangents(&mut mesh, |face| (face == 1).then_some(0));
        assert_eq!(mesh.tangents[0], [Vec4::ZERO; 3]);
        assert_eq!(mesh.tangents[1][0].w, 1.0);
        let mut mesh = squares();
        add_tangents(&mut mesh, |_| None);
        assert!(mesh.tangents.is_empty());
        add_tangents(&mut mesh, |_| Some(1));
        assert!(mesh.tangents.is_empty(), "the mesh has no second set of texture coordinates");
    }

    #[test]
    fn tangents_follow_shading_normals() {
        let mut mesh = squares();
        let normal = Vec3::new(0.6, 0.0, 0.8);
        mesh.normals.fill([normal; 3]);
        add_tangents(&mut mesh, |_| Some(0));
        for tangent in mesh.tangents.as_flattened() {
            assert!(tangent.truncate().dot(normal).abs() < 1e-6 && tangent.truncate().is_normalized());
        }
    }

    #[test]
    fn hubs_and_faces_without_area_are_no_trouble() {
        let mut mesh = Mesh::default();
        let hub = mesh.push_position(Vec3::ZERO);
        let n = 200_000;
        for ix in 0..n {
            let (sin, cos) = (ix as f32 / n as f32 * std::f32::consts::TAU).sin_cos();
            let at = mesh.push_position(Vec3::new(cos, sin, 0.0));
            let next = if ix + 1 == n { 1 } else { at + 1 };
            mesh.push_flat([hub, at, next], 0);
            mesh.uvs[0].push([Vec2::ZERO, Vec2::new(cos, -sin), Vec2::new(cos, -sin) + Vec2::new(-sin, -cos)]);
        }
        for _ in 0..100_000 {
            mesh.push_flat([hub; 3], 0);
            mesh.uvs[0].push([Vec2::ZERO, Vec2::X, Vec2::Y]);
        }
        mesh.push_flat([hub, 1, 2], 0);
        mesh.uvs[0].push([Vec2::ZERO; 3]);
        add_tangents(&mut mesh, |_| Some(0));
        assert!((mesh.tangents[0][0] - Vec4::new(1.0, 0.0, 0.0, 1.0)).length() < 0.01, "{:?}", mesh.tangents[0]);
        assert_eq!(mesh.tangents[250_000], [Vec4::ZERO; 3]);
    }
    #[test]
    fn nasty_numbers_are_no_trouble() {
        const NASTY: [f32; 10] = [0.0, -0.0, 1.0, -1.0, 0.5, 1e-30, 1e30, 3e38, f32::INFINITY, f32::NAN];
        let mut state = 1_u64;
        let mut next = move || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 33) as usize
        };
        for n_numbers in [5, 8, 10].repeat(100) {
            let mut mesh = Mesh::default();
            let mut number = || NASTY[next() % n_numbers];
            for _ in 0..8 {
                mesh.push_position(Vec3::new(number(), number(), number()));
            }
            for _ in 0..30 {
                let uvs = [(); 3].map(|()| Vec2::new(number(), number()));
                let face = [number(), number(), number()].map(|x| (x.to_bits() >> 7) % 8);
                mesh.push_flat(face, 0);
                mesh.uvs[0].push(uvs);
            }
            add_tangents(&mut mesh, |_| Some(0));
            let is_tangent = |t: &Vec4| *t == Vec4::ZERO || (t.truncate().length() - 1.0).abs() < 0.01;
            assert!(mesh.tangents.as_flattened().iter().all(is_tangent));
        }
    }
}
