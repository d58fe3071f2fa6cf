//! Closest points of kept instances: those of all triangles in the world, in double precision.

use std::sync::Arc;

use glam::{DQuat, DVec3, Vec3};
use kdray::{
    accel::{AccelOptions, grid::GridOptions, kdtree::Traversal},
    cast::{CpuCaster, GpuCaster, Hit, NO_TRIANGLE, QueryPoint},
    gpu::{Context, DeviceOverrides},
    layout::Triangle,
    scene::{RayKinds, Scene, Transform},
    world::{FlatScene, InstanceUpdate, World},
};

use super::{ball, flattened, kept, mesh_of, scene_of, transform, transforms};
use crate::support::{
    assert_silent,
    closest::{agree, check},
    device, meshes, pretended,
    random::Random,
};

/// Two meshes, placed by all kinds of transforms: also a thin slab that lies in the way of others, a mirrored ball in
/// another one, and one ball twice.
fn scene() -> Scene {
    let mut all = transforms(2.0);
    all.push(transform(DVec3::new(20.0, 0.01, 20.0), 0.3, DVec3::new(2.0, 1.5, 0.0)));
    all.push(transform(DVec3::new(0.1, -0.5, 0.5), 0.9, DVec3::new(2.0, -0.6, 1.4)));
    all.push(all[1].clone());
    let mut scene = scene_of(&ball(), &all);
    scene.meshes.push(mesh_of(&meshes::placed(meshes::soup(200, 5), 0.7, Vec3::ZERO)));
    scene.instances[2].mesh_ix = 1;
    scene.instances[4].mesh_ix = 1;
    scene
}

fn triangles_of(world: &World) -> Vec<Triangle> {
    (0..world.scene().n_triangles()).map(|ix| world.scene().triangle(ix)).collect()
}

/// Points around and in the instances, on their triangles, and far away. Every fifth has a greatest distance.
fn points(world: &World, n: usize) -> Vec<QueryPoint> {
    let (mut random, triangles, places) = (Random(23), triangles_of(world), transforms(2.0));
    let mut point = |i: usize| {
        let t = random.of(&triangles);
        let position = match i % 4 {
            0 => random.of(&places).point(1.5 * random.in_box(Vec3::NEG_ONE, Vec3::ONE)),
            1 => t.v0.lerp(t.v1, random.unit()).lerp(t.v2, random.unit()),
            2 => 8.0 * random.in_box(Vec3::NEG_ONE, Vec3::ONE),
            _ => t.v0 + 10f32.powf(random.between(-3.0, 5.0)) * random.direction(),
        };
        QueryPoint { position, t_max: if i % 5 == 4 { random.between(0.0, 0.5) } else { f32::INFINITY } }
    };
    (0..n).map(&mut point).collect()
}

fn on_cpu(world: &World, points: &[QueryPoint]) -> Vec<Hit> {
    CpuCaster::new(world.geometry(), Traversal::Stack).closest_points(points).expect("kd-trees")
}

fn on_device(context: &Arc<Context>, world: &World, points: &[QueryPoint]) -> Vec<Hit> {
    let mut caster = GpuCaster::new(context, world.geometry(), Traversal::Stack).expect("a caster");
    caster.closest_points(points, 1).expect("hits").hits
}

#[test]
fn hits_are_those_of_all_triangles() {
    let world = kept(&scene());
    let (triangles, points) = (triangles_of(&world), points(&world, 2000));
    let twin = on_cpu(&world, &points);
    check(&triangles, &[], &points, &twin).unwrap();
    let n_hits = twin.iter().filter(|hit| hit.triangle_ix != NO_TRIANGLE).count();
    assert!(n_hits > 1600 && n_hits < points.len(), "{n_hits}");
    let limits = DeviceOverrides { loop_limit: Some(2000), n_suspension_slots: Some(100), ..Default::default() };
    for context in [device(), pretended(limits)] {
        let points = &points[..700];
        let hits = on_device(&context, &world, points);
        agree(&triangles, points, &twin[..points.len()], &hits).unwrap();
        check(&triangles, &[], points, &hits).unwrap();
        assert_silent(&context);
    }
}

/// Transforms by which no corner is rounded.
#[test]
fn hits_are_those_of_the_flattened_scene() {
    let at = |scale: [f64; 3], at: [f64; 3]| {
        Transform::new(DVec3::from(scale), DQuat::IDENTITY, DVec3::from(at)).expect("a transform")
    };
    let all = [
        at([1.0, 1.0, 1.0], [0.0; 3]),
        at([-1.0, 1.0, 1.0], [3.0, 0.25, 0.0]),
        at([2.0, 0.25, 0.5], [-1.0, 2.0, 0.5]),
        at([0.25, -8.0, 4.0], [5.0, -1.0, 0.25]),
    ];
    let scene = scene_of(&meshes::cube(4, 0.0), &all);
    let [kept, flat] = [kept(&scene), flattened(&scene)];
    assert_eq!(triangles_of(&kept), triangles_of(&flat));
    let points = points(&kept, 3000);
    let [of_kept, of_flat] = [&kept, &flat].map(|world| on_cpu(world, &points));
    // Triangles that share a corner are equally close.
    assert!(of_kept.iter().zip(&of_flat).all(|(a, b)| a.t == b.t || (a.t - b.t).abs() <= 1e-6 * b.t));
    let n_same = of_kept.iter().zip(&of_flat).filter(|(a, b)| a == b).count();
    assert!(n_same > 2950, "{n_same}");
}

/// What is hidden from casts or has moved is not found where it was.
#[test]
fn hidden_and_moved_instances_are_left_out() {
    let world = kept(&scene());
    let points = points(&world, 400);
    let n = ball().len() as u32;
    let hidden: Vec<u32> = (n..2 * n).collect();
    let hiding = CpuCaster::new(world.geometry(), Traversal::Stack).hiding(&hidden).expect("indices");
    check(&triangles_of(&world), &hidden, &points, &hiding.closest_points(&points).expect("hits")).unwrap();
    let mut caster = GpuCaster::new(device(), world.geometry(), Traversal::Stack).expect("a caster");
    caster.closest_points(&points, 1).expect("hits");
    let away = Transform::new(DVec3::ONE, DQuat::IDENTITY, DVec3::new(0.5, 0.5, 3.0)).expect("a transform");
    let none = RayKinds { camera: true, shadow: true, other: false };
    let update = |instance_ix| InstanceUpdate { instance_ix, ..InstanceUpdate::default() };
    let updates =
        [InstanceUpdate { transform: Some(away), ..update(3) }, InstanceUpdate { rays: Some(none), ..update(0) }];
    let moved = world.with_instances_changed(&updates).expect("a world");
    caster.set_world(&moved).expect("the caster's world");
    let unseen: Vec<u32> = (0..n).collect();
    for hits in [on_cpu(&moved, &points), caster.closest_points(&points, 1).expect("hits").hits] {
        check(&triangles_of(&moved), &unseen, &points, &hits).unwrap();
        check(&triangles_of(&world), &[], &points, &hits).expect_err("the world before");
    }
}

#[test]
fn grids_are_refused() {
    let flat = FlatScene::with_instances(&scene()).expect("a scene");
    let world = World::with_accel(flat, &AccelOptions::Grid(GridOptions::uniform())).expect("a world");
    let refused = CpuCaster::new(world.geometry(), Traversal::Stack).closest_points(&[]).expect_err("grids");
    assert_eq!(refused.to_string(), "closest points are found in kd-trees (--accel kdtree)");
}
