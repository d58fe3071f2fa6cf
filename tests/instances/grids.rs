//! Grids in place of kd-trees: each geometry has its own.

use glam::{DQuat, DVec3, Vec3};
use kdray::{
    accel::{AccelOptions, Query, Statistics, grid::GridOptions, kdtree::Traversal},
    cast::{CpuCaster, GpuCaster, Hit, NO_TRIANGLE, Ray, cast_on_cpu},
    cpu,
    frame::{Integrator, Primary, RenderOptions},
    gpu::Context,
    scene::{Scene, Transform},
    world::{FlatScene, InstanceUpdate, World},
};

use super::{
    ball,
    casts::{n_hits, rays_at},
    kept, mesh_of,
    pictures::{on_device, options, scene_of_lamps},
    scene_of, transforms,
};
use crate::support::{assert_silent, compare, device, meshes, n_outliers, random::Random};

/// A world with a grid for each mesh.
fn kept_in_grids(scene: &Scene, options: GridOptions) -> World {
    let flat = FlatScene::with_instances(scene).expect("a scene that fits together");
    World::with_accel(flat, &AccelOptions::Grid(options)).expect("a world")
}

pub fn worlds_of_grids(scene: &Scene) -> [World; 2] {
    [GridOptions::uniform(), GridOptions::two_level()].map(|options| kept_in_grids(scene, options))
}

/// Instances of meshes that differ in their sizes and in their grids.
pub fn scene() -> Scene {
    let mut scene = scene_of(&ball(), &transforms(4.0));
    let soup = meshes::placed(meshes::soup(300, 5), 0.3, Vec3::ZERO);
    for mesh in [meshes::torus(40, 12), soup, meshes::cube(2, 0.0)] {
        scene.meshes.push(mesh_of(&mesh));
    }
    (0..scene.instances.len()).for_each(|ix| scene.instances[ix].mesh_ix = [3, 0, 1, 2][ix % 4]);
    scene
}

pub fn rays() -> Vec<Ray> {
    let mut rays = rays_at(&transforms(4.0), 3000);
    let mut random = Random(4);
    let far = |_| {
        let origin = 1e6 * random.direction();
        Ray { origin, t_min: 0.0, direction: transforms(4.0)[1].point(Vec3::ZERO) - origin, t_max: f32::INFINITY }
    };
    rays.extend((0..100).map(far));
    rays
}

/// The triangles that are hidden in some casts: every third one.
fn hidden(scene: &Scene) -> Vec<u32> {
    (0..scene.n_triangles() as u32).step_by(3).collect()
}

fn are_hit(hits: &[Hit]) -> Vec<bool> {
    hits.iter().map(|hit| hit.triangle_ix != NO_TRIANGLE).collect()
}

/// The closest hits on the CPU, those with hidden triangles, and which rays have any hit.
fn on_cpu(world: &World, traversal: Traversal, hidden: &[u32]) -> (Vec<Hit>, Vec<Hit>, Vec<bool>) {
    let caster = CpuCaster::new(world.geometry(), traversal);
    let (closest, any) = (caster.cast(&rays(), Query::Closest), caster.cast(&rays(), Query::Any));
    let hiding = caster.hiding(hidden).expect("indices of triangles");
    (closest, hiding.cast(&rays(), Query::Closest), are_hit(&any))
}

/// What [`on_cpu`] returns, of a device.
fn cast_on(
    context: &std::sync::Arc<Context>,
    world: &World,
    traversal: Traversal,
    hidden: &[u32],
) -> (Vec<Hit>, Vec<Hit>, Vec<bool>) {
    let mut caster = GpuCaster::new(context.clone(), world.geometry(), traversal).expect("a caster");
    let mut cast = |query| caster.cast(&rays(), query, 1).expect("hits").hits;
    let (closest, any) = (cast(Query::Closest), cast(Query::Any));
    let mut hiding = caster.hiding(hidden).expect("indices of triangles");
    (closest, hiding.cast(&rays(), Query::Closest, 1).expect("hits").hits, are_hit(&any))
}

#[test]
fn hits_in_grids_are_those_in_trees_and_of_brute_force() {
    let scene = scene();
    let (trees, hidden) = (kept(&scene), hidden(&scene));
    let context = device();
    let expected = on_cpu(&trees, Traversal::Brute, &hidden);
    let expected_on_device = cast_on(&context, &trees, Traversal::Brute, &hidden);
    assert!(n_hits(&expected.0) > 1500 && n_hits(&expected.0) > n_hits(&expected.1) + 50);
    assert!(on_cpu(&trees, Traversal::Stack, &hidden) == expected);
    assert!(cast_on(&context, &trees, Traversal::Mask, &hidden) == expected_on_device);
    for world in worlds_of_grids(&scene) {
        let kind = world.accel().kind();
        let found = on_cpu(&world, Traversal::OF_CPU, &hidden);
        compare::exact(&expected.0, &found.0).unwrap_or_else(|what| panic!("{kind} on the CPU: {what}"));
        assert!(found == expected, "{kind} on the CPU");
        let found = cast_on(&context, &world, Traversal::OF_GPUS, &hidden);
        compare::exact(&expected_on_device.0, &found.0).unwrap_or_else(|what| panic!("{kind}: {what}"));
        assert!(found == expected_on_device, "{kind}");
    }
    assert_silent(&context);
}

#[test]
fn pictures_of_grids_are_those_of_trees() {
    let scene = scene_of_lamps();
    let context = device();
    for integrator in [Integrator::Whitted, Integrator::Path] {
        let options = RenderOptions { integrator, primary: Primary::Trace, ..options() };
        let trees = kept(&scene);
        let expected = [on_device(&context, &trees, &options), cpu::render(&trees, &options).0];
        for world in worlds_of_grids(&scene) {
            let found = [on_device(&context, &world, &options), cpu::render(&world, &options).0];
            for (place, expected, found) in [("device", &expected[0], &found[0]), ("CPU", &expected[1], &found[1])] {
                let is_same = found.radiance == expected.radiance;
                assert!(is_same, "{} on the {place}, {integrator}", world.accel().kind());
            }
        }
    }
    assert_silent(&context);
}

#[test]
fn instances_of_grids_move() {
    let mut scene = scene();
    let turn = DQuat::from_rotation_z(0.8);
    let transform = Transform::new(DVec3::new(0.7, -1.2, 1.0), turn, DVec3::new(2.0, 1.0, -3.0)).expect("a transform");
    let first = worlds_of_grids(&scene);
    scene.instances[2].transform = transform.clone();
    let moved = InstanceUpdate { instance_ix: 2, transform: Some(transform), ..InstanceUpdate::default() };
    let context = device();
    let mut of_trees = GpuCaster::new(&context, kept(&scene).geometry(), Traversal::Mask).expect("a caster");
    let expected = of_trees.cast(&rays(), Query::Closest, 1).expect("hits").hits;
    for before in first {
        let world = before.with_instances_changed(std::slice::from_ref(&moved)).expect("a world");
        assert!(world.shares_geometries(&before));
        let mut caster = GpuCaster::new(&context, before.geometry(), Traversal::OF_GPUS).expect("a caster");
        assert_ne!(caster.cast(&rays(), Query::Closest, 1).expect("hits").hits, expected);
        caster.set_world(&world).expect("a change");
        assert_eq!(caster.cast(&rays(), Query::Closest, 1).expect("hits").hits, expected);
        let on_cpu = cast_on_cpu(world.geometry(), Traversal::OF_CPU, &rays(), Query::Closest);
        compare::hits(n_outliers(&context, expected.len()).max(3), &expected, &on_cpu).unwrap();
    }
    assert_silent(&context);
}

#[test]
fn statistics_are_those_of_all_grids() {
    let meshes = [ball(), meshes::torus(40, 12)];
    let of = |scene: &Scene, options: GridOptions| match kept_in_grids(scene, options).statistics() {
        Statistics::Grid(grid) => grid,
        Statistics::KdTree(_) => panic!("a grid's statistics"),
    };
    for options in [GridOptions::uniform(), GridOptions::two_level()] {
        let apart = meshes.each_ref().map(|mesh| of(&scene_of(mesh, &transforms(4.0)[..2]), options.clone()));
        let mut scene = scene_of(&meshes[0], &transforms(4.0)[..4]);
        scene.meshes.push(mesh_of(&meshes[1]));
        scene.instances[3].mesh_ix = 1;
        let all = of(&scene, options);
        assert_eq!(all.n_levels, apart[0].n_levels);
        assert_eq!(all.n_cells, apart[0].n_cells + apart[1].n_cells);
        assert_eq!(all.n_references, apart[0].n_references + apart[1].n_references);
        let greatest = [0, 1, 2].map(|axis| apart[0].resolution[axis].max(apart[1].resolution[axis]));
        assert_eq!(all.resolution, greatest);
    }
}
