//! Closed forms of tangents, and meshes that are difficult.

use std::path::Path;

use glam::Affine2;

use super::*;
use crate::scene::model::{Instance, Texture, Transform};

/// The map that shows texture coordinates as they are.
const PLAIN: NormalMap = NormalMap { uv_set: 0, linear: [0x3f80_0000, 0, 0, 0x3f80_0000] };

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
    add_tangents(&mut mesh, &[Some(PLAIN)]);
    assert_eq!(mesh.tangents, [[along; 3], [along; 3], [against; 3], [against; 3]]);
    // The bitangent, w times the cross product of normal and tangent, is along decreasing v: +y on both squares.
    for tangent in mesh.tangents.as_flattened() {
        assert_eq!(tangent.w * Vec3::Z.cross(tangent.truncate()), Vec3::Y);
    }
    for face in 0..4 {
        assert_eq!(own_tangents(&mesh, face, &PLAIN), mesh.tangents[face]);
    }
}

#[test]
fn only_faces_that_need_them_have_tangents() {
    let mut mesh = squares();
    mesh.slots[1] = 1;
    add_tangents(&mut mesh, &[None, Some(PLAIN)]);
    assert_eq!(mesh.tangents[0], [Vec4::ZERO; 3]);
    assert_eq!(mesh.tangents[1][0].w, 1.0);
    let mut mesh = squares();
    add_tangents(&mut mesh, &[None]);
    assert!(mesh.tangents.is_empty());
    add_tangents(&mut mesh, &[Some(NormalMap { uv_set: 1, ..PLAIN })]);
    assert!(mesh.tangents.is_empty(), "the mesh has no second set of texture coordinates");
}

#[test]
fn tangents_follow_shading_normals() {
    let mut mesh = squares();
    let normal = Vec3::new(0.6, 0.0, 0.8);
    mesh.normals.fill([normal; 3]);
    add_tangents(&mut mesh, &[Some(PLAIN)]);
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
    add_tangents(&mut mesh, &[Some(PLAIN)]);
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
        add_tangents(&mut mesh, &[Some(PLAIN)]);
        let is_tangent = |t: &Vec4| *t == Vec4::ZERO || (t.truncate().length() - 1.0).abs() < 0.01;
        assert!(mesh.tangents.as_flattened().iter().all(is_tangent));
    }
}

/// Returns a material whose normal map has a transform of texture coordinates.
fn with_normal_map(transform: Affine2) -> Material {
    let mut material = Material::default();
    material.maps.normal = Some(Texture { transform, ..Texture::of_image(0) });
    material
}

#[test]
fn tangents_follow_the_transform_of_the_normal_map() {
    let quarter_turn = Affine2::from_mat2(Mat2::from_cols(Vec2::Y, Vec2::NEG_X));
    let mirrored = Affine2::from_scale(Vec2::new(-1.0, 1.0));
    let stretched = Affine2::from_scale(Vec2::new(2.0, 0.5)) * Affine2::from_translation(Vec2::splat(7.0));
    let plain = Material::default();
    let materials = [quarter_turn, mirrored, stretched].map(with_normal_map).into_iter().chain([plain]).collect();
    let instance = |materials: &[u32]| Instance {
        mesh_ix: 0,
        transform: Transform::IDENTITY,
        materials: materials.to_vec(),
        ..Instance::default()
    };
    let instances = vec![instance(&[0]), instance(&[3]), instance(&[1]), instance(&[0]), instance(&[2])];
    let mut scene = Scene { meshes: vec![squares()], materials, instances, ..Scene::empty(Path::new("x")) };
    scene.add_tangents().unwrap();
    let mesh_ixs: Vec<_> = scene.instances.iter().map(|instance| instance.mesh_ix).collect();
    assert_eq!(mesh_ixs, [0, 0, 1, 0, 2]);
    // On the first square, u is along x and v along -y. The turn makes -v of u, so u grows along y.
    let first_tangents: Vec<_> = scene.meshes.iter().map(|mesh| mesh.tangents[0][0]).collect();
    assert_eq!(
        first_tangents,
        [Vec4::new(0.0, 1.0, 0.0, 1.0), Vec4::new(-1.0, 0.0, 0.0, -1.0), Vec4::new(1.0, 0.0, 0.0, 1.0)]
    );
}

#[test]
fn tangents_of_a_file_are_kept() {
    let mut mesh = squares();
    let own = Vec4::new(0.6, 0.8, 0.0, -1.0);
    mesh.tangents = vec![[Vec4::ZERO; 3]; 4];
    mesh.tangents[1] = [own; 3];
    add_tangents(&mut mesh, &[Some(PLAIN)]);
    assert_eq!((mesh.tangents[0][0], mesh.tangents[1]), (Vec4::new(1.0, 0.0, 0.0, 1.0), [own; 3]));
}
