//! Worlds whose instances change: other places, materials, and rays that meet them.

use glam::{DMat4, DQuat, DVec3, DVec4, Vec3};
use kdray::{
    accel::{
        Query,
        kdtree::{BuildOptions, Traversal},
    },
    cast::{CpuCaster, GpuCaster, Hit, NO_TRIANGLE, Ray, cast_on_cpu},
    engine::Engine,
    frame::{Denoise, Goal, Integrator, Primary, RenderOptions},
    gpu::MemoryUse,
    scene::{Instance, Light, Material, RayKinds, Scene, Transform},
    world::{FlatScene, InstanceUpdate, World},
};

use super::{ball, flattened, kept, scene_of, transforms};
use crate::support::{assert_silent, compare, device, random::Random, rays::streamed};

/// A place within a few units of the origin.
fn some_transform(random: &mut Random) -> Transform {
    let turn = DQuat::from_axis_angle(random.direction().as_dvec3(), f64::from(random.between(0.0, 6.0)));
    let mut size = || f64::from(random.between(0.3, 1.5));
    let size = DVec3::new(size(), size(), size());
    let mirror = if random.below(3) == 0 { -1.0 } else { 1.0 };
    let at = 4.0 * random.in_box(Vec3::NEG_ONE, Vec3::ONE);
    Transform::new(size * DVec3::new(mirror, 1.0, 1.0), turn, at.as_dvec3()).expect("a transform")
}

/// Balls of two meshes with four materials, two of which shine.
fn balls() -> Scene {
    let mut scene = scene_of(&ball(), &transforms(2.5)[..5]);
    scene.meshes.push(scene.meshes[0].clone());
    (0..scene.meshes[1].slots.len()).for_each(|ix| scene.meshes[1].slots[ix] = ix as u32 % 3);
    scene.instances[3].mesh_ix = 1;
    scene.instances[4].mesh_ix = 1;
    for ke in [0.0, 3.0, 5.0] {
        let name = format!("shining {ke}");
        scene.materials.push(Material { name, ke: Vec3::splat(ke), kd: Vec3::splat(0.5), ..Material::default() });
    }
    scene.lights = vec![Light::Point { position: Vec3::new(1.0, 9.0, 4.0), intensity: Vec3::splat(50.0) }];
    scene.camera.eye = Vec3::new(3.0, 4.0, 14.0);
    scene.camera.target = Vec3::ZERO;
    scene
}

/// Changes some of the instances of a scene, and returns the updates that do the same to its world.
fn change(scene: &mut Scene, random: &mut Random) -> Vec<InstanceUpdate> {
    let n_materials = scene.materials.len();
    let updates = (0..scene.instances.len()).filter_map(|instance_ix| {
        if random.below(3) == 0 {
            return None;
        }
        let transform = (random.below(4) > 0).then(|| some_transform(random));
        let list = |random: &mut Random| (0..1 + random.below(2)).map(|_| random.below(n_materials) as u32).collect();
        let materials: Option<Vec<u32>> = (random.below(2) == 0).then(|| list(random));
        let kinds = RayKinds { camera: random.below(4) > 0, shadow: random.below(4) > 0, other: random.below(4) > 0 };
        let rays = (random.below(3) == 0).then_some(kinds);
        Some(InstanceUpdate { instance_ix, transform, materials, rays, mask: None })
    });
    let updates: Vec<InstanceUpdate> = updates.collect();
    for InstanceUpdate { instance_ix, transform, materials, rays, .. } in updates.clone() {
        let instance = &mut scene.instances[instance_ix];
        instance.transform = transform.unwrap_or(instance.transform.clone());
        instance.materials = materials.unwrap_or(instance.materials.clone());
        instance.rays = rays.unwrap_or(instance.rays);
    }
    updates
}

fn rays() -> Vec<Ray> {
    let mut random = Random(11);
    let ray = |_| {
        let origin = 6.0 * random.direction();
        let direction = 3.0 * random.in_box(Vec3::NEG_ONE, Vec3::ONE) - origin;
        Ray { origin, t_min: 0.0, direction, t_max: f32::INFINITY }
    };
    (0..2000).map(ray).collect()
}

#[test]
fn hits_after_each_update_are_those_in_a_new_world() {
    let (mut scene, mut random, rays) = (balls(), Random(3), rays());
    let context = device();
    for traversal in [Traversal::Mask, Traversal::Ropes, Traversal::Stack] {
        let mut world = kept(&scene);
        let first = world.clone();
        let mut on_device = GpuCaster::new(&context, world.geometry(), traversal).expect("a caster");
        let mut on_cpu = CpuCaster::new(first.geometry(), traversal);
        let mut before = Vec::new();
        for _ in 0..3 {
            let updates = change(&mut scene, &mut random);
            world = world.with_instances_changed(&updates).expect("a world");
            on_device.set_world(&world).expect("a change");
            on_cpu.set_world(&world).expect("a change");
            let new = kept(&scene);
            let mut of_new = GpuCaster::new(&context, new.geometry(), traversal).expect("a caster");
            let expected = of_new.cast(&rays, Query::Closest, 1).expect("hits").hits;
            assert_eq!(on_device.cast(&rays, Query::Closest, 1).expect("hits").hits, expected, "{traversal}");
            assert_eq!(streamed::<_, Hit>(&mut on_device, &rays, Query::Closest), expected, "{traversal}");
            assert!(expected != before && expected.iter().filter(|hit| hit.triangle_ix != NO_TRIANGLE).count() > 100);
            let expected_on_cpu = cast_on_cpu(new.geometry(), traversal, &rays, Query::Closest);
            assert_eq!(on_cpu.cast(&rays, Query::Closest), expected_on_cpu, "{traversal} on the CPU");
            compare::hits(3, &expected_on_cpu, &expected).unwrap_or_else(|what| panic!("{traversal}: {what}"));
            before = expected;
        }
        // What was there before is as it was.
        assert_ne!(first.scene().instances, world.scene().instances);
    }
    assert_silent(&context);
}

#[test]
fn pictures_after_each_update_are_those_of_a_new_world() {
    let context = device();
    for (engine, n_updates) in [(Engine::on_device(&context), 4), (Engine::on_cpu(), 2)] {
        for integrator in [Integrator::Whitted, Integrator::Path] {
            let (mut scene, mut random) = (balls(), Random(8));
            // What an instance is not seen by depends on how primary rays are found.
            let (primary, denoise) = (Primary::Trace, Denoise::Off);
            let size = RenderOptions { width: 80, height: 60, max_depth: 3, ..RenderOptions::default() };
            let options = RenderOptions { integrator, primary, denoise, approximates_ambient: true, ..size };
            let mut world = kept(&scene);
            let mut renderer = engine.renderer(&world, &options).expect("a renderer");
            for ix in 0..n_updates {
                // In the first update no light moves, and later ones bring other kinds of light.
                let updates = match ix {
                    0 => {
                        scene.instances[0].transform = some_transform(&mut random);
                        let transform = Some(scene.instances[0].transform.clone());
                        vec![InstanceUpdate { transform, ..InstanceUpdate::default() }]
                    }
                    _ => change(&mut scene, &mut random),
                };
                world = world.with_instances_changed(&updates).expect("a world");
                renderer.set_world(&world).expect("a change");
                let mut drawn = || {
                    renderer.draw(&scene.camera, Goal::Samples(2), || ()).expect("a picture");
                    renderer.picture().expect("a picture").into_owned()
                };
                let picture = drawn();
                let mut of_new = engine.renderer(&kept(&scene), &options).expect("a renderer");
                of_new.draw(&scene.camera, Goal::Samples(2), || ()).expect("a picture");
                let expected = of_new.picture().expect("a picture").into_owned();
                let is_same = picture.radiance == expected.radiance;
                assert!(is_same, "{integrator}, update {ix} on {}", engine.device_name());
                let shown = |pixel: &&[f32; 4]| pixel[0] > 0.01;
                assert!(picture.radiance.iter().filter(shown).count() > 200, "update {ix} shows something");
            }
        }
    }
    assert_silent(&context);
}

#[test]
fn a_renderer_goes_over_to_any_other_world() {
    let context = device();
    let scene = balls();
    let options = RenderOptions { width: 64, height: 48, ..RenderOptions::default() };
    for engine in [Engine::on_device(&context), Engine::on_cpu()] {
        let mut renderer = engine.renderer(&kept(&transforms_only()), &options).expect("a renderer");
        let world = flattened(&scene);
        renderer.set_world(&world).expect("a change");
        renderer.draw(&scene.camera, Goal::Samples(1), || ()).expect("a picture");
        let mut other = engine.renderer(&world, &options).expect("a renderer");
        other.draw(&scene.camera, Goal::Samples(1), || ()).expect("a picture");
        assert_eq!(renderer.picture().expect("a picture").display, other.picture().expect("a picture").display);
    }
}

fn transforms_only() -> Scene {
    scene_of(&ball(), &transforms(4.0)[..2])
}

#[test]
fn ten_thousand_updates_take_no_memory() {
    let context = device();
    let mut world = kept(&balls());
    let mut caster = GpuCaster::new(&context, world.geometry(), Traversal::OF_GPUS).expect("a caster");
    let mut random = Random(5);
    let mut update = |caster: &mut GpuCaster| {
        let moved = InstanceUpdate {
            instance_ix: random.below(5),
            transform: Some(some_transform(&mut random)),
            materials: Some(vec![random.below(4) as u32]),
            ..InstanceUpdate::default()
        };
        world = world.with_instances_changed(&[moved]).expect("a world");
        caster.set_world(&world).expect("a change");
        world.scene().instances.as_ref().expect("instances").materials.len()
    };
    // By then each instance has a list of materials of its own.
    let n_words = (0..100).map(|_| update(&mut caster)).max().expect("a length");
    let bytes = |uses: &[MemoryUse]| uses.iter().map(|memory| memory.bytes).sum::<u64>();
    let before = bytes(&context.memory());
    (0..10_000).for_each(|_| assert!(update(&mut caster) <= n_words));
    assert_eq!(bytes(&context.memory()), before);
    assert_silent(&context);
}

#[test]
fn rays_pass_through_instances_of_a_scene_that_are_hidden_from_their_kind() {
    let mut scene = scene_of(&ball(), &[Transform::IDENTITY]);
    scene.instances[0].rays = RayKinds { other: false, ..RayKinds::ALL };
    let ray = Ray { origin: Vec3::new(0.1, 0.1, 5.0), t_min: 0.0, direction: Vec3::NEG_Z, t_max: f32::INFINITY };
    let hit = |scene: &Scene| cast_on_cpu(kept(scene).geometry(), Traversal::Mask, &[ray], Query::Closest)[0];
    let is_miss = |hit: Hit| hit.triangle_ix == NO_TRIANGLE;
    assert!(is_miss(hit(&scene)));
    let error = FlatScene::new(&scene).expect_err("a refusal").to_string();
    assert!(error.contains("instance 0") && error.contains("--instances keep"), "{error}");
    scene.instances[0].rays = RayKinds { camera: false, shadow: false, other: true };
    assert!(!is_miss(hit(&scene)));
}

#[test]
fn updates_that_are_wrong_change_nothing() {
    let scene = balls();
    let world = kept(&scene);
    let of = |instance_ix| InstanceUpdate { instance_ix, ..InstanceUpdate::default() };
    let far = Transform::new(DVec3::ONE, DQuat::IDENTITY, DVec3::new(0.0, 2e9, 0.0)).expect("a transform");
    let columns = [[1.0, 0.0, 0.0], [8000.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|column| DVec3::from(column).extend(0.0));
    let shear = DMat4::from_cols(columns[0], columns[1], columns[2], DVec4::W);
    let thin = Transform::of_affine(shear).expect("a transform");
    let wrong = [
        (vec![of(5)], "instance 5 of the scene: there are 5 instances"),
        (vec![of(1), of(2), of(1)], "instance 1 of the scene: it has two updates"),
        (vec![InstanceUpdate { transform: Some(far), ..of(1) }], "instance 1 of the scene: its new place is beyond"),
        (vec![InstanceUpdate { materials: Some(vec![0, 9]), ..of(3) }], "it has material 9, but there are 4 materials"),
        (vec![InstanceUpdate { materials: Some(Vec::new()), ..of(3) }], "it has no material"),
        (vec![InstanceUpdate { transform: Some(thin), ..of(0) }], "instance 0 of the scene: its"),
    ];
    for (updates, expected) in wrong {
        let error = world.with_instances_changed(&updates).expect_err("a refusal").to_string();
        assert!(error.contains(expected), "{error}, not {expected}");
    }
    let error = flattened(&scene).with_instances_changed(&[]).expect_err("a refusal").to_string();
    assert!(error.contains("flattened"), "{error}");
    // A caster's arrays are those of its own geometries.
    let same = World::of_flat(world.scene().clone(), &BuildOptions::default()).expect("a world");
    let context = device();
    let mut caster = GpuCaster::new(&context, world.geometry(), Traversal::Mask).expect("a caster");
    assert!(caster.set_world(&same).is_err() && caster.set_world(&flattened(&scene)).is_err());
    assert!(caster.set_world(&world).is_ok());
    assert!(CpuCaster::new(world.geometry(), Traversal::Mask).set_world(&same).is_err());
}

#[test]
fn instances_whose_triangles_are_in_the_world_stay_there() {
    let mut scene = balls();
    let columns = [[1.0, 0.0, 0.0], [8000.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|column| DVec3::from(column).extend(0.0));
    let shear = DMat4::from_cols(columns[0], columns[1], columns[2], DVec4::W);
    scene.instances[2] =
        Instance { transform: Transform::of_affine(shear).expect("a transform"), ..scene.instances[2].clone() };
    let world = kept(&scene);
    let moved =
        |instance_ix| InstanceUpdate { instance_ix, transform: Some(Transform::IDENTITY), ..InstanceUpdate::default() };
    let error = world.with_instances_changed(&[moved(2)]).expect_err("a refusal").to_string();
    assert!(error.contains("instance 2") && error.contains("cannot move"), "{error}");
    world.with_instances_changed(&[moved(1), moved(3)]).expect("the others move");
}
