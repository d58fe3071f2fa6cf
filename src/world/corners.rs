//! Texture coordinates, tangents and colours at the corners of stored triangles.

use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;

use super::flat::corners_of;
use crate::{
    layout::{CornerSurface, FLAT_NORMAL, normal::encode_octahedral},
    scene::{Mesh, Transform},
};

/// A mesh, and the transform to the space in which its triangles are stored.
pub type Placed<'a> = (&'a Mesh, &'a Transform);

/// Returns the number of triangles of all meshes.
pub fn n_triangles_of(placed: &[Placed]) -> usize {
    placed.iter().map(|(mesh, _)| mesh.faces.len()).sum()
}

/// Returns the texture coordinates of all triangles' corners, in the order of the triangles: those of the first set,
/// and after them, if `n_sets` is 2, those of the second set. A mesh without coordinates has zeros.
pub fn uvs(placed: &[Placed], n_sets: usize) -> Vec<[Vec2; 3]> {
    let mut uvs = Vec::with_capacity(n_sets * n_triangles_of(placed));
    for set in 0..n_sets {
        for (mesh, transform) in placed {
            let order = corners_of(transform);
            match mesh.uvs[set].is_empty() {
                true => uvs.resize(uvs.len() + mesh.faces.len(), [Vec2::ZERO; 3]),
                false => uvs.par_extend(mesh.uvs[set].par_iter().map(|corners| order.map(|ix| corners[ix]))),
            }
        }
    }
    uvs
}

/// Returns the tangents and colours of all triangles' corners, in the order of the triangles. A mesh without tangents
/// has none, and a mesh without colours is white.
pub fn corner_surfaces(placed: &[Placed]) -> Vec<[CornerSurface; 3]> {
    let mut corners = Vec::with_capacity(n_triangles_of(placed));
    for (mesh, transform) in placed {
        let of_face = |face| corners_of(transform).map(|ix| corner_surface(mesh, transform, face, ix));
        corners.par_extend((0..mesh.faces.len()).into_par_iter().map(of_face));
    }
    corners
}

fn corner_surface(mesh: &Mesh, transform: &Transform, face: usize, corner: usize) -> CornerSurface {
    let tangent = mesh.tangents.get(face).map_or(Vec4::ZERO, |corners| corners[corner]);
    let colour = mesh.colours.get(face).map_or(Vec4::ONE, |corners| corners[corner]);
    CornerSurface { tangent: encode_tangent(transform, tangent), colour: encode_colour(colour) }
}

/// Encodes a tangent of object space. The cross product of two reflected vectors is the reverse of their reflected
/// cross product, so a reflection changes the side of the bitangent.
fn encode_tangent(transform: &Transform, tangent: Vec4) -> u32 {
    match transform.tangent(tangent.truncate()) {
        Vec3::ZERO => FLAT_NORMAL,
        direction => {
            let is_right = (tangent.w > 0.0) != transform.mirrors();
            encode_octahedral(direction) & !1 | u32::from(is_right)
        }
    }
}

/// Encodes a linear colour with opacity: 8 bits a channel, colours in sRGB (IEC 61966-2-1).
fn encode_colour(colour: Vec4) -> u32 {
    let encoded = |linear: f32| match linear.clamp(0.0, 1.0) {
        low if low <= 0.003_130_8 => low * 12.92,
        high => 1.055 * high.powf(1.0 / 2.4) - 0.055,
    };
    let byte = |value: f32| (value.clamp(0.0, 1.0) * 255.0).round() as u8;
    let [x, y, z, w] = colour.to_array();
    u32::from_le_bytes([byte(encoded(x)), byte(encoded(y)), byte(encoded(z)), byte(w)])
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;
    use crate::reference::surface::decode_normal;

    #[test]
    fn colours_are_srgb_bytes_with_linear_opacity() {
        assert_eq!(encode_colour(Vec4::new(0.0, 1.0, 0.212_230_76, 0.5)), u32::from_le_bytes([0, 255, 127, 128]));
        assert_eq!(encode_colour(Vec4::new(-1.0, 2.0, f32::NAN, 1.0)), u32::from_le_bytes([0, 255, 0, 255]));
    }

    #[test]
    fn a_reflection_keeps_the_bitangent_where_it_is() {
        let plain = Transform::IDENTITY;
        let mirrored = Transform::new(DVec3::new(-2.0, 1.0, 1.0), DQuat::IDENTITY, DVec3::ZERO).unwrap();
        let tangent = Vec4::new(1.0, 0.0, 0.0, 1.0);
        for (transform, normal, expected) in [(plain, Vec3::Z, Vec3::Y), (mirrored, Vec3::Z, Vec3::Y)] {
            let code = encode_tangent(&transform, tangent);
            let side = if code & 1 == 1 { 1.0 } else { -1.0 };
            let bitangent = side * normal.cross(decode_normal(code & !1));
            assert!((bitangent - expected).length() < 1e-3, "{bitangent}");
        }
        assert_eq!(encode_tangent(&Transform::IDENTITY, Vec4::ZERO), FLAT_NORMAL);
    }
}
