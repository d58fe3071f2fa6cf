//! Tests of worlds whose meshes are stored once and placed many times, against flattened copies, the CPU and geometry.

#[path = "../support/mod.rs"]
mod support;

mod all_hits;
mod casts;
mod closest_points;
mod costs;
mod deformed;
mod device_grids;
mod films;
mod grids;
mod margins;
mod masks;
mod memory;
mod moved;
mod pictures;
mod refused;
mod suspended;

use glam::{DMat4, DQuat, DVec3, DVec4};
use kdray::{
    accel::kdtree::BuildOptions,
    layout::Triangle,
    scene::{Instance, Material, Mesh, Scene, Transform},
    world::{FlatScene, World},
};
use support::{meshes, textured};

/// Returns a mesh in which corners at the same place are one point.
fn mesh_of(triangles: &[Triangle]) -> Mesh {
    let mut mesh = Mesh::default();
    let mut known = std::collections::HashMap::new();
    for t in triangles {
        let face = [t.v0, t.v1, t.v2].map(|p| {
            *known.entry(p.to_array().map(f32::to_bits)).or_insert_with(|| {
                mesh.positions.push(p);
                mesh.positions.len() as u32 - 1
            })
        });
        mesh.faces.push(face);
        mesh.normals.push([glam::Vec3::ZERO; 3]);
        mesh.slots.push(0);
    }
    mesh
}

fn transform(scale: DVec3, angle: f64, at: DVec3) -> Transform {
    let axis = DVec3::new(1.0, 2.0, -0.5).normalize();
    Transform::new(scale, DQuat::from_axis_angle(axis, angle), at).expect("a transform")
}

/// Transforms of every kind, at places `apart` from one another: none, rotated, long and thin, mirrored, sheared, tiny
/// and huge ones. The last two are at places of their own.
fn transforms(apart: f64) -> Vec<Transform> {
    let at = |i: f64| DVec3::new(apart * i, -0.3 * apart * i, 0.7 * apart);
    let shear = DMat4::from_cols(
        DVec4::new(1.0, 0.2, 0.0, 0.0),
        DVec4::new(0.8, 1.0, -0.3, 0.0),
        DVec4::new(0.0, 0.4, 1.2, 0.0),
        at(4.0).extend(1.0),
    );
    vec![
        Transform::IDENTITY,
        transform(DVec3::ONE, 0.7, at(1.0)),
        transform(DVec3::new(0.2, 3.0, 0.7), 2.1, at(2.0)),
        transform(DVec3::new(-1.0, 1.3, 0.8), -1.2, at(3.0)),
        Transform::of_affine(shear).expect("a transform"),
        transform(DVec3::splat(1e-6), 0.4, DVec3::new(0.0, 0.0, -2e-4)),
        transform(DVec3::splat(1e6), 1.4, DVec3::new(3e7, 0.0, 0.0)),
        transform(DVec3::ONE, 2.9, DVec3::new(1e5, -1e5, 1e5)),
    ]
}

/// A closed mesh, placed by each of the transforms.
fn scene_of(mesh: &[Triangle], transforms: &[Transform]) -> Scene {
    let instance =
        |transform: &Transform| Instance { transform: transform.clone(), materials: vec![0], ..Instance::default() };
    Scene {
        meshes: vec![mesh_of(mesh)],
        instances: transforms.iter().map(instance).collect(),
        materials: vec![Material::default()],
        ..textured::empty()
    }
}

fn kept(scene: &Scene) -> World {
    let flat = FlatScene::with_instances(scene).expect("a scene that fits together");
    assert_eq!(flat.n_triangles(), scene.n_triangles());
    World::of_flat(flat, &BuildOptions::default()).expect("a world")
}

fn flattened(scene: &Scene) -> World {
    let flat = FlatScene::new(scene).expect("a scene that fits together");
    World::of_flat(flat, &BuildOptions::default()).expect("a world")
}

/// A closed mesh whose middle, 0, sees all of it.
fn ball() -> Vec<Triangle> {
    meshes::cube(6, 0.9)
}
