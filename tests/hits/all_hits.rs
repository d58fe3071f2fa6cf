//! Tests that all hits of rays are counted and listed: each triangle once, in order, on the device and on the CPU.

use std::sync::Arc;

use crate::support::{
    MeshWithTree, assert_silent, device, kept,
    lists::{agree, counts_of, list},
    meshes, n_outliers, pretended,
    random::Random,
    rays::{met_in_double_precision, nasty_ray},
};
use glam::{Vec3, vec3};
use kdray::{
    accel::{Accel, AccelOptions, Query, grid::GridOptions, kdtree::Traversal},
    cast::{AllHits, CpuCaster, GpuCaster, Hit, NO_TRIANGLE, Ray},
    gpu::{Context, DeviceOverrides},
    layout::Triangle,
    reference::{search_ray::SearchRay, traversal_ray::near_scene, triangle::Shear},
    world::Geometry,
};

fn ray(origin: Vec3, direction: Vec3) -> Ray {
    Ray { origin, t_min: 0.0, direction, t_max: f32::INFINITY }
}

/// A mesh of triangles in each others' way, one in which each triangle is there three times, one whose edges are in
/// split planes, and one of long triangles, which are in many leaves.
fn worlds() -> [MeshWithTree; 4] {
    let long = meshes::soup(200, 7).into_iter().map(|t| meshes::triangle(t.v0, t.v1 + (t.v1 - t.v0) * 50.0, t.v2));
    let crowd = meshes::placed(meshes::soup(300, 8), 0.3, Vec3::ZERO);
    [meshes::soup(600, 3), meshes::threefold(meshes::torus(20, 10)), meshes::cube(6, 0.0), long.chain(crowd).collect()]
        .map(MeshWithTree::new)
}

/// Returns nasty rays, some of which begin behind their origins or before them, and some far away.
fn nasty_rays(world: &MeshWithTree, n: usize) -> Vec<Ray> {
    let some_ray = |i: usize| {
        let mut random = Random(i as u64);
        let ray = nasty_ray(&mut random, world, i);
        let t_min = if i % 4 == 1 { random.between(-2.0, 2.0) } else { 0.0 };
        let back = if i % 16 == 2 { 1e5 * ray.direction } else { Vec3::ZERO };
        Ray { origin: ray.origin - back, t_min, direction: ray.direction, t_max: ray.t_max }
    };
    (0..n).map(some_ray).collect()
}

/// Returns the hits of a ray by a test of every triangle.
fn by_every_triangle(world: &MeshWithTree, ray: &Ray) -> Vec<Hit> {
    let &Ray { origin, t_min, direction, t_max } = ray;
    let search_ray = SearchRay { origin, t_min, direction, t_max, source_triangle: NO_TRIANGLE, alpha_seed: 0 };
    let (near, t_start) = near_scene(&world.inputs(), &search_ray);
    let shear = Shear::of(near.origin.to_array(), near.direction.to_array());
    let of_triangle = |(triangle_ix, triangle)| {
        let hit = shear.intersect_triangle(triangle, triangle_ix)?;
        let is_hit = hit.t > near.t_min && hit.t <= near.t_max;
        is_hit.then(|| Hit { t: (hit.t + t_start).min(t_max), ..hit })
    };
    let mut hits: Vec<Hit> = (0..).zip(&world.triangles).filter_map(of_triangle).collect();
    hits.sort_by(|a, b| a.t.total_cmp(&b.t).then(a.triangle_ix.cmp(&b.triangle_ix)));
    hits
}

/// Puts lists together.
fn all_hits(lists: impl IntoIterator<Item = Vec<Hit>>) -> AllHits {
    let mut all = AllHits { ray_splits: vec![0], hits: Vec::new() };
    for list in lists {
        all.hits.extend(list);
        all.ray_splits.push(all.hits.len() as u64);
    }
    all
}

/// Returns a grid of each kind.
fn grids(triangles: &[Triangle]) -> [Accel; 2] {
    let options = [GridOptions::uniform(), GridOptions::two_level()].map(AccelOptions::Grid);
    options.map(|options| Accel::new(triangles, &options))
}

#[test]
fn the_cpu_lists_each_triangle_once() {
    for world in worlds() {
        let rays = nasty_rays(&world, 1500);
        let expected = all_hits(rays.iter().map(|ray| by_every_triangle(&world, ray)));
        assert!(counts_of(&expected).iter().filter(|n| **n > 2).count() > 50);
        let check = |geometry: Geometry, traversal, name: &str| {
            let caster = CpuCaster::new(geometry, traversal);
            let found = caster.all_hits(&rays, None);
            agree(true, 0, &expected, &found).unwrap_or_else(|e| panic!("{name}: {e}"));
            assert_eq!(caster.count_hits(&rays), counts_of(&expected), "{name}");
        };
        Traversal::ALL.iter().for_each(|it| check(world.geometry(), *it, &it.to_string()));
        for accel in grids(&world.triangles) {
            let geometry = Geometry::new(&world.triangles, &accel).expect("a grid of these triangles");
            check(geometry, Traversal::OF_CPU, &accel.kind().to_string());
        }
    }
}

/// Compares what a device finds with its twin.
fn check_device(context: &Arc<Context>, world: &MeshWithTree, rays: &[Ray], accel: &Accel, traversal: Traversal) {
    let geometry = Geometry::new(&world.triangles, accel).expect("a structure of these triangles");
    let expected = CpuCaster::new(geometry, traversal).all_hits(rays, None);
    let mut caster = GpuCaster::new(context, geometry, traversal).expect("a caster");
    let found = caster.all_hits(rays, None).expect("lists");
    agree(context.is_software(), n_outliers(context, rays.len()), &expected, &found)
        .unwrap_or_else(|e| panic!("{traversal} {}: {e}", accel.kind()));
    assert_eq!(caster.count_hits(rays).expect("counts"), counts_of(&found));
    // A batch of 7 rays lists 14 hits at a time, or those of one ray.
    let few = &rays[..50];
    let by_batches = caster.with_batches_of(7).all_hits(few, Some(3)).expect("lists");
    assert_eq!(by_batches, nearest(&found, few.len(), 3));
}

/// Returns the nearest hits of the first rays.
fn nearest(all: &AllHits, n_rays: usize, most: usize) -> AllHits {
    all_hits((0..n_rays).map(|i| list(all, i).iter().take(most).copied().collect()))
}

#[test]
fn kernels_find_what_their_twin_finds() {
    let context = device();
    for world in worlds() {
        let rays = nasty_rays(&world, 300);
        for traversal in [Traversal::OF_GPUS, Traversal::Ropes, Traversal::Restart, Traversal::Brute] {
            check_device(&context, &world, &rays, &world.accel, traversal);
        }
        let grids = grids(&world.triangles);
        grids.iter().for_each(|accel| check_device(&context, &world, &rays, accel, Traversal::OF_GPUS));
    }
    assert_silent(&context);
}

/// On devices that end shaders by their iterations, each search can be suspended, also if no slot is left.
#[test]
fn interrupted_searches_find_the_same() {
    let world = MeshWithTree::new([meshes::soup(500, 1), meshes::torus(20, 10)].concat());
    let rays = nasty_rays(&world, 300);
    for n_suspension_slots in [None, Some(20)] {
        let limits = DeviceOverrides { loop_limit: Some(1000), n_suspension_slots, ..DeviceOverrides::default() };
        let context = pretended(limits);
        check_device(&context, &world, &rays, &world.accel, Traversal::OF_GPUS);
        check_device(&context, &world, &rays, &grids(&world.triangles)[0], Traversal::OF_GPUS);
        assert_silent(&context);
    }
}

#[test]
fn lists_are_those_of_double_precision() {
    let mut random = Random(11);
    let side = |random: &mut Random| random.in_box(Vec3::NEG_ONE, Vec3::ONE);
    let triangles = (0..60).map(|_| meshes::triangle(side(&mut random), side(&mut random), side(&mut random)));
    let world = MeshWithTree::new(triangles.collect());
    let rays: Vec<_> = (0..2000).map(|_| ray(side(&mut random), random.direction())).collect();
    let found = CpuCaster::new(world.geometry(), Traversal::Mask).all_hits(&rays, None);
    let mut n_compared = 0;
    for (i, ray) in rays.iter().enumerate() {
        let Some(expected) = met_in_double_precision(&world.triangles, ray) else { continue };
        assert_eq!(list(&found, i).iter().map(|hit| hit.triangle_ix).collect::<Vec<_>>(), expected, "{ray:?}");
        n_compared += usize::from(expected.len() > 2);
    }
    assert!(n_compared > 300, "{n_compared}");
}

/// From inside a closed mesh, a ray in a general direction leaves once more often than it enters.
#[test]
fn counts_from_inside_are_odd() {
    let world = MeshWithTree::new(meshes::torus(40, 20));
    let mut random = Random(5);
    let inside = |random: &mut Random| {
        let around = random.between(0.0, std::f32::consts::TAU);
        ray(vec3(around.cos(), 0.0, around.sin()) + 0.1 * random.direction(), random.direction())
    };
    let rays: Vec<_> = (0..3000).map(|_| inside(&mut random)).collect();
    let counts = CpuCaster::new(world.geometry(), Traversal::Mask).count_hits(&rays);
    assert!(counts.iter().all(|count| count % 2 == 1));
    assert!(counts.iter().filter(|count| **count == 3).count() > 50);
}

/// The test of triangles includes edges, so a ray through an edge meets both triangles, and one through a corner all
/// that have the corner.
#[test]
fn edges_and_corners_count_for_all_their_triangles() {
    let world = MeshWithTree::new(meshes::cube(2, 0.0));
    let down = |x: f32, y: f32| ray(vec3(x, y, 5.0), -Vec3::Z);
    let caster = CpuCaster::new(world.geometry(), Traversal::Mask);
    let rays = [down(0.25, 0.5), down(0.5, 0.5), down(0.0, 0.0)];
    assert_eq!(caster.count_hits(&rays), [2, 4, 12]);
}

/// Of rays from afar, different t can be rounded to the same. Between these, the limit chooses by the t before, as the
/// search for the closest hit does.
#[test]
fn limits_keep_the_nearest_hits() {
    let world = MeshWithTree::new(meshes::threefold(meshes::torus(20, 10)));
    let rays = nasty_rays(&world, 300);
    let context = device();
    let mut on_device = GpuCaster::new(&context, world.geometry(), Traversal::OF_GPUS).expect("a caster");
    let caster = CpuCaster::new(world.geometry(), Traversal::OF_GPUS);
    let all = caster.all_hits(&rays, None);
    let t_of = |lists: &AllHits| lists.hits.iter().map(|hit| hit.t).collect::<Vec<_>>();
    for most in [0, 1, 2, 5, u32::MAX] {
        let (found, expected) = (caster.all_hits(&rays, Some(most)), nearest(&all, rays.len(), most as usize));
        assert_eq!(found.ray_splits, expected.ray_splits, "{most}");
        assert_eq!(t_of(&found), t_of(&expected), "{most}");
        let from_device = on_device.all_hits(&rays, Some(most)).expect("lists");
        agree(context.is_software(), n_outliers(&context, rays.len()), &found, &from_device)
            .unwrap_or_else(|e| panic!("{most}: {e}"));
    }
    if kept::leaves_out("lists that are limited before t are rounded") {
        return;
    }
    let mut closest = caster.cast(&rays, Query::Closest);
    closest.retain(|hit| hit.triangle_ix != NO_TRIANGLE);
    assert_eq!(caster.all_hits(&rays, Some(1)).hits, closest);
}

#[test]
fn nothing_is_met_by_invalid_rays_and_in_empty_scenes() {
    let world = MeshWithTree::new(meshes::cube(2, 0.0));
    let down = ray(vec3(0.2, 0.3, 5.0), -Vec3::Z);
    let invalid = [
        Ray { direction: Vec3::ZERO, ..down },
        Ray { t_min: f32::NAN, ..down },
        Ray { origin: Vec3::INFINITY, ..down },
        Ray { t_min: 9.0, ..down },
        down,
    ];
    let empty = MeshWithTree::new(Vec::new());
    for (world, counts) in [(&world, [0, 0, 0, 0, 2]), (&empty, [0; 5])] {
        let mut on_device = GpuCaster::new(device(), world.geometry(), Traversal::OF_GPUS).expect("a caster");
        let on_cpu = CpuCaster::new(world.geometry(), Traversal::OF_CPU);
        assert_eq!(on_device.count_hits(&invalid).expect("counts"), counts);
        assert_eq!(on_cpu.count_hits(&invalid), counts);
        assert_eq!(counts_of(&on_device.all_hits(&invalid, None).expect("lists")), counts);
        assert_eq!(on_cpu.all_hits(&[], None), all_hits([]));
        assert_eq!(on_device.all_hits(&[], None).expect("lists"), all_hits([]));
    }
}

/// Hidden triangles are in no list.
#[test]
fn hidden_triangles_do_not_count() {
    let world = MeshWithTree::new(meshes::cube(2, 0.0));
    let down = [ray(vec3(0.2, 0.3, 5.0), -Vec3::Z)];
    let caster = CpuCaster::new(world.geometry(), Traversal::OF_CPU);
    let first = caster.all_hits(&down, Some(1)).hits[0].triangle_ix;
    let caster = caster.hiding(&[first]).expect("a triangle");
    let on_device = GpuCaster::new(device(), world.geometry(), Traversal::OF_GPUS).expect("a caster");
    let mut on_device = on_device.hiding(&[first]).expect("a triangle");
    assert_eq!(caster.count_hits(&down), [1]);
    assert_eq!(on_device.count_hits(&down).expect("counts"), [1]);
}

/// Without the rule for hits at the same t, triangles that coincide would be lost.
#[test]
fn casts_from_the_last_t_are_noticed() {
    let world = MeshWithTree::new(meshes::threefold(meshes::torus(20, 10)));
    let rays = nasty_rays(&world, 300);
    let caster = CpuCaster::new(world.geometry(), Traversal::Mask);
    let recast = |ray: &Ray| {
        let (mut ray, mut hits) = (*ray, Vec::new());
        loop {
            let hit = caster.cast(&[ray], Query::Closest)[0];
            if hit.triangle_ix == NO_TRIANGLE {
                return hits;
            }
            hits.push(hit);
            ray.t_min = hit.t;
        }
    };
    let expected = all_hits(rays.iter().map(|ray| by_every_triangle(&world, ray)));
    assert!(agree(false, 50, &expected, &all_hits(rays.iter().map(recast))).is_err());
}
