//! Instances that do not fit together are refused, and transforms that no geometry can be placed by.

use glam::{DMat4, DQuat, DVec3, DVec4, Vec3};
use kdray::{
    accel::{Query, kdtree::BuildOptions, kdtree::Traversal},
    cast::{NO_TRIANGLE, Ray, cast_on_cpu},
    layout::Instance,
    scene::Transform,
    world::{FlatScene, World},
};

use super::{ball, kept, scene_of, transforms};

type Change = (&'static str, fn(&mut FlatScene));

fn instance(scene: &mut FlatScene, ix: usize) -> &mut Instance {
    &mut scene.instances.as_mut().expect("instances").list[ix]
}

const CHANGES: &[Change] = &[
    ("instance 1 has no geometry", |it| instance(it, 1).geometry_ix = 7),
    ("instance 2 is not of its geometry", |it| instance(it, 2).n_triangles += 1),
    ("instance 2 is not of its geometry", |it| instance(it, 2).first_row = 1),
    ("instance 1 does not follow the one before", |it| instance(it, 1).first_triangle -= 1),
    ("instance 0 lacks materials", |it| instance(it, 0).first_material = 9),
    ("instance 1 has a number that is not finite", |it| instance(it, 1).axis_y.z = f32::NAN),
    ("instance 1 has a number that is not finite", |it| instance(it, 1).condition = f32::NAN),
    ("instance 1 lies beyond 1e9", |it| instance(it, 1).translation.x = 2e9),
    ("instance 1 lies beyond 1e9", |it| instance(it, 1).axis_x.y = 1e38),
    ("geometry 0 does not follow the one before", |it| {
        it.instances.as_mut().expect("instances").ranges[0].first_row = 1;
    }),
    ("n_slots: geometry 0 has 1 slots, not 2", |it| it.instances.as_mut().expect("instances").n_slots[0] = 2),
    ("triangles has", |it| it.instances.as_mut().expect("instances").ranges[0].n_triangles -= 1),
    ("has material 3, but there are", |it| it.instances.as_mut().expect("instances").materials[0] = 3),
];

#[test]
fn instances_that_do_not_fit_together_are_refused() {
    let flat = FlatScene::with_instances(&scene_of(&ball(), &transforms(4.0)[..3])).expect("a scene");
    World::of_flat(flat.clone(), &BuildOptions::default()).expect("a world");
    for (expected, change) in CHANGES {
        let mut changed = flat.clone();
        change(&mut changed);
        let error = World::of_flat(changed, &BuildOptions::default()).expect_err("a refusal").to_string();
        assert!(error.contains(expected), "{error}, not {expected}");
    }
}

#[test]
fn a_transform_that_magnifies_rounding_is_applied_to_the_triangles() {
    // A shear by which the inverse map loses four digits.
    let columns = [[1.0, 0.0, 0.0], [8000.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|column| DVec3::from(column).extend(0.0));
    let shear = DMat4::from_cols(columns[0], columns[1], columns[2], DVec4::W);
    let all = [Transform::of_affine(shear).expect("a transform"), Transform::IDENTITY];
    let world = kept(&scene_of(&ball(), &all));
    let instances = world.scene().instances.as_ref().expect("instances");
    assert_eq!((instances.ranges.len(), instances.list[0].axis_x), (2, Vec3::X), "a geometry of its own");
    let down = Ray { origin: Vec3::new(4000.0, 9.0, 0.0), t_min: 0.0, direction: Vec3::NEG_Y, t_max: f32::INFINITY };
    let hits = cast_on_cpu(world.geometry(), Traversal::Stack, &[down], Query::Closest);
    assert_ne!(hits[0].triangle_ix, NO_TRIANGLE);
}

#[test]
fn a_million_instances_of_nothing_are_nothing() {
    let mut scene = scene_of(&ball(), &[Transform::IDENTITY]);
    scene.meshes.push(kdray::scene::Mesh::default());
    let at = |i: u32| Transform::new(DVec3::ONE, DQuat::IDENTITY, DVec3::splat(f64::from(i))).expect("a transform");
    let of_nothing =
        |i| kdray::scene::Instance { mesh_ix: 1, transform: at(i), materials: vec![0], ..Default::default() };
    scene.instances.extend((0..1_000_000).map(of_nothing));
    let world = kept(&scene);
    assert_eq!(world.geometry().n_triangles(), ball().len());
    let ray = Ray { origin: Vec3::ZERO, t_min: 0.0, direction: Vec3::X, t_max: f32::INFINITY };
    assert_ne!(cast_on_cpu(world.geometry(), Traversal::Stack, &[ray], Query::Closest)[0].triangle_ix, NO_TRIANGLE);
    scene.instances.remove(0);
    let flat = FlatScene::with_instances(&scene).expect("a scene");
    assert!(flat.instances.is_none() && flat.triangles.is_empty());
}
