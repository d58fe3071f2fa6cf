//! All hits of rays in kept instances: those of the flattened scene, and those of double precision.

use glam::{DQuat, DVec3, Vec3};
use kdray::{
    accel::kdtree::Traversal,
    cast::{AllHits, CpuCaster, GpuCaster, Ray},
    gpu::DeviceOverrides,
    scene::{Scene, Transform},
    world::{InstanceUpdate, World},
};

use super::{ball, casts::rays_at, flattened, grids, kept, scene_of, transforms};
use crate::support::{
    assert_silent, device,
    lists::{self, agree, counts_of},
    meshes, n_outliers, pretended,
    random::Random,
    rays::met_in_double_precision,
};

fn on_cpu(world: &World, traversal: Traversal, rays: &[Ray]) -> AllHits {
    CpuCaster::new(world.geometry(), traversal).all_hits(rays, None)
}

fn list(all: &AllHits, ray_ix: usize) -> impl Iterator<Item = (u32, f32)> {
    lists::list(all, ray_ix).iter().map(|hit| (hit.triangle_ix, hit.t))
}

/// Cubes whose corners are multiples of small powers of two wherever they stand: one twice, mirrored ones, large and
/// small ones.
fn cubes() -> Scene {
    let at = |scale: [f64; 3], at: [f64; 3]| {
        Transform::new(DVec3::from(scale), DQuat::IDENTITY, DVec3::from(at)).expect("a transform")
    };
    let all = [
        Transform::IDENTITY,
        Transform::IDENTITY,
        at([-1.0, 1.0, 1.0], [0.5, 0.25, 0.0]),
        at([2.0, 2.0, 2.0], [-1.0, 0.0, 0.5]),
        at([0.5, 0.5, 0.5], [1.0, 1.0, 1.0]),
        at([0.25, -0.5, 4.0], [0.0, -1.0, 0.25]),
    ];
    scene_of(&meshes::cube(4, 0.0), &all)
}

/// Rays from a grid of 2^-6, so that no origin is rounded on its way into an instance.
fn rays_at_cubes(n: usize) -> Vec<Ray> {
    let mut random = Random(19);
    let some_ray = |_| {
        let origin = (64.0 * random.in_box(Vec3::splat(-1.9), Vec3::splat(1.9))).round() / 64.0;
        // Some origins are in the plane of a face, at a t of about 0.
        Ray { origin, t_min: 1e-3, direction: random.direction(), t_max: f32::INFINITY }
    };
    (0..n).map(some_ray).collect()
}

#[test]
fn lists_are_those_of_the_flattened_scene() {
    let (scene, rays) = (cubes(), rays_at_cubes(2000));
    let [of_flat, of_kept] = [flattened(&scene), kept(&scene)].map(|it| on_cpu(&it, Traversal::Stack, &rays));
    assert!(of_flat.hits.len() > rays.len());
    // Of two triangles in one plane, either may have the lesser t.
    let by_index = |all: &AllHits, i| {
        let mut hits: Vec<_> = list(all, i).collect();
        hits.sort_by_key(|hit| hit.0);
        hits
    };
    for i in 0..rays.len() {
        let (flat, kept) = (by_index(&of_flat, i), by_index(&of_kept, i));
        let is_same = |(a, b): (&(u32, f32), &(u32, f32))| a.0 == b.0 && (a.1 - b.1).abs() <= 1e-5 * a.1.max(1.0);
        assert!(flat.len() == kept.len() && flat.iter().zip(&kept).all(is_same), "{flat:?}, not {kept:?}");
    }
    let is_sorted = |i| list(&of_kept, i).collect::<Vec<_>>().is_sorted_by(|a, b| (a.1, a.0) < (b.1, b.0));
    assert!((0..rays.len()).all(is_sorted));
}

#[test]
fn lists_are_those_of_double_precision() {
    let transforms = &transforms(0.7)[..5];
    let world = kept(&scene_of(&ball(), transforms));
    let rays = rays_at(transforms, 800);
    let found = on_cpu(&world, Traversal::Mask, &rays);
    let triangles: Vec<_> = (0..world.scene().n_triangles()).map(|ix| world.scene().triangle(ix)).collect();
    let mut n_compared = 0;
    for (i, ray) in rays.iter().enumerate() {
        let direction = ray.direction.normalize();
        let Some(expected) = met_in_double_precision(&triangles, &Ray { direction, ..*ray }) else { continue };
        assert_eq!(list(&found, i).map(|hit| hit.0).collect::<Vec<_>>(), expected, "{ray:?}");
        n_compared += usize::from(expected.len() > 2);
    }
    assert!(n_compared > 100, "{n_compared}");
}

#[test]
fn kernels_find_what_their_twin_finds() {
    let rays = grids::rays();
    let scene = grids::scene();
    let [grid, _] = grids::worlds_of_grids(&scene);
    let world = kept(&scene);
    let limits = DeviceOverrides { loop_limit: Some(3000), n_suspension_slots: Some(100), ..Default::default() };
    let searches = [(&world, Traversal::OF_GPUS), (&world, Traversal::Ropes), (&grid, Traversal::OF_GPUS)];
    for (context, rays) in [(device(), &rays[..]), (pretended(limits), &rays[2900..])] {
        for (world, traversal) in searches {
            let expected = on_cpu(world, traversal, rays);
            let mut caster = GpuCaster::new(&context, world.geometry(), traversal).expect("a caster");
            let found = caster.all_hits(rays, None).expect("lists");
            agree(context.is_software(), n_outliers(&context, rays.len()).max(3), &expected, &found)
                .unwrap_or_else(|what| panic!("{traversal} in {}: {what}", world.accel().kind()));
            assert_eq!(caster.count_hits(rays).expect("counts"), counts_of(&found));
            let nearest = caster.all_hits(rays, Some(2)).expect("lists");
            for i in 0..rays.len() {
                assert!(list(&found, i).take(2).eq(list(&nearest, i)), "ray {i}");
            }
        }
        assert_silent(&context);
    }
    let traversals = [Traversal::Stack, Traversal::Restart, Traversal::Brute];
    let of_each = traversals.map(|traversal| on_cpu(&world, traversal, &rays[..500]));
    assert!(of_each.iter().all(|it| it == &of_each[0]));
    let nearest = CpuCaster::new(world.geometry(), Traversal::Stack).all_hits(&rays[..500], Some(2));
    assert!((0..500).all(|i| list(&of_each[0], i).take(2).eq(list(&nearest, i))));
}

/// A missing instance, or one where it was before, shows in the lists.
#[test]
fn moved_and_hidden_instances_change_the_lists() {
    let scene = cubes();
    let world = kept(&scene);
    let rays = rays_at_cubes(300);
    let context = device();
    let mut caster = GpuCaster::new(&context, world.geometry(), Traversal::OF_GPUS).expect("a caster");
    let before = caster.all_hits(&rays, None).expect("lists");
    let transform = Transform::new(DVec3::ONE, DQuat::IDENTITY, DVec3::new(0.0, 3.0, 0.0)).expect("a transform");
    let update = InstanceUpdate { instance_ix: 3, transform: Some(transform), ..Default::default() };
    let moved = world.with_instances_changed(&[update]).expect("a world");
    caster.set_world(&moved).expect("the caster's world");
    let after = caster.all_hits(&rays, None).expect("lists");
    assert!(agree(false, 200, &before, &after).is_err());
    let n_outliers = n_outliers(&context, rays.len()).max(1);
    agree(context.is_software(), n_outliers, &on_cpu(&moved, Traversal::Stack, &rays), &after).unwrap();
    let of_second: Vec<u32> = (192..2 * 192).collect();
    let hiding = CpuCaster::new(world.geometry(), Traversal::Stack).hiding(&of_second).expect("indices");
    let expected = on_cpu(&world, Traversal::Stack, &rays);
    let is_second = |hit: &u32| of_second.contains(hit);
    let n_of_second = expected.hits.iter().filter(|hit| is_second(&hit.triangle_ix)).count();
    let n_left: u32 = hiding.count_hits(&rays).iter().sum();
    assert!(n_of_second > 50 && n_left as usize == expected.hits.len() - n_of_second);
}
