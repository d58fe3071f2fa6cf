//! Tests the search for closest points: the twin against brute force in double precision, and the kernel against both.

use std::sync::Arc;

use crate::{
    stage::RAY_COUNTS,
    support::{
        MeshWithTree, assert_silent,
        closest::{MISS, agree, check},
        device, meshes,
        packets::simd_levels,
        pretended,
        random::Random,
    },
};
use fearless_simd::Level;
use glam::{Vec3, vec3};
use kdray::{
    accel::{
        Accel, AccelOptions,
        grid::GridOptions,
        kdtree::{BuildOptions, KdTree, Traversal},
        wide_bvh::WideBvh,
    },
    cast::{CpuCaster, GpuCaster, Hit, NO_TRIANGLE, QueryPoint},
    cpu::closest_points::WidePointSearch,
    gpu::{Context, DeviceOverrides},
    layout::Triangle,
    reference::closest_point::{closest_point, closest_point_by},
    world::Geometry,
};

const N_POINTS: usize = 420;

/// Long triangles of widths down to 1e-7 of their length.
fn needles(n: usize) -> Vec<Triangle> {
    let mut random = Random(11);
    let needle = |i: usize| {
        let from = random.in_box(Vec3::splat(-1.0), Vec3::ONE);
        let along = random.direction();
        let across = along.cross(random.direction()) * 10f32.powi(-((i % 8) as i32));
        meshes::triangle(from, from + along, from + random.unit() * along + across)
    };
    (0..n).map(needle).collect()
}

/// Meshes of all shapes, sizes and places.
fn worlds() -> Vec<MeshWithTree> {
    let torus = || meshes::torus(24, 12);
    let worlds = [
        vec![meshes::triangle(Vec3::ZERO, Vec3::X, Vec3::Y)],
        torus(),
        meshes::cube(6, 0.0),
        meshes::cube(6, 1.0),
        meshes::soup(500, 3),
        needles(400),
        meshes::threefold(meshes::cube(3, 0.5)),
        meshes::placed(torus(), 1e-6, Vec3::ZERO),
        meshes::placed(torus(), 1e6, Vec3::splat(2e6)),
        meshes::placed(meshes::soup(300, 5), 1.0, vec3(1e3, -1e3, 10.0)),
        meshes::placed(torus(), 1e-15, Vec3::ZERO),
        meshes::placed(torus(), 1e15, Vec3::ZERO),
    ];
    worlds.into_iter().map(MeshWithTree::new).collect()
}

/// Points in the box and around it, on faces, edges and corners, near faces and far away. Every fifth has a greatest
/// distance.
fn points_of(world: &MeshWithTree, n: usize) -> Vec<QueryPoint> {
    let (centre, radius) = (world.centre(), world.radius());
    let mut random = Random(7);
    let mut point = |i: usize| {
        let triangle = random.of(&world.triangles);
        let (u, v) = (random.unit(), random.unit());
        let on_edge = triangle.v0.lerp(triangle.v1, u);
        let on_face = on_edge.lerp(triangle.v2, v);
        let aside = random.direction();
        let position = match i % 7 {
            0 => centre + 1.5 * radius * random.in_box(Vec3::NEG_ONE, Vec3::ONE),
            1 => on_face,
            2 => on_edge,
            3 => *random.of(&[triangle.v0, triangle.v1, triangle.v2]),
            4 => centre + 1e5 * radius * aside,
            5 => on_face + 1e-4 * radius * aside,
            _ => centre + 0.01 * radius * aside,
        };
        let t_max = if i % 5 == 4 { 0.3 * radius * random.unit() } else { f32::INFINITY };
        QueryPoint { position, t_max }
    };
    (0..n).map(&mut point).collect()
}

fn by_twin(world: &MeshWithTree, points: &[QueryPoint]) -> Vec<Hit> {
    let mut hits = vec![MISS; points.len()];
    closest_point(&world.inputs(), points, &mut hits);
    hits
}

/// Through the wide hierarchy, with the instructions of a SIMD level.
fn by_hierarchy(world: &MeshWithTree, simd_level: Level, points: &[QueryPoint]) -> Vec<Hit> {
    let bvh = WideBvh::new(world.tree(), &world.triangles);
    let mut hits = vec![MISS; points.len()];
    closest_point_by(&world.inputs(), || WidePointSearch::new(&bvh, simd_level), points, &mut hits);
    hits
}

/// By a caster, which makes the hierarchy for many points.
fn on_cpu(world: &MeshWithTree, points: &[QueryPoint]) -> Vec<Hit> {
    CpuCaster::new(world.geometry(), Traversal::Stack).closest_points(points).expect("a kd-tree")
}

fn caster(context: &Arc<Context>, world: &MeshWithTree) -> GpuCaster {
    GpuCaster::new(context, world.geometry(), Traversal::Stack).expect("a caster")
}

fn on_device(context: &Arc<Context>, world: &MeshWithTree, points: &[QueryPoint]) -> Vec<Hit> {
    caster(context, world).closest_points(points, 1).expect("hits").hits
}

#[test]
fn twin_finds_what_brute_force_finds() {
    for (i, world) in worlds().iter().enumerate() {
        let points = points_of(world, N_POINTS);
        let hits = by_twin(world, &points);
        check(&world.triangles, &[], &points, &hits).unwrap_or_else(|what| panic!("world {i}: {what}"));
        let n_hits = hits.iter().filter(|hit| hit.triangle_ix != NO_TRIANGLE).count();
        assert!(n_hits * 10 > 8 * N_POINTS && n_hits < N_POINTS, "world {i}: {n_hits} hits");
    }
}

/// The hierarchy finds the bits of the twin, unless the twin leaves out a cell whose triangles are as close up to the
/// rounding of distances.
#[test]
fn the_hierarchy_finds_what_the_twin_finds() {
    for (i, world) in worlds().iter().enumerate() {
        let points = points_of(world, N_POINTS);
        let twin = by_twin(world, &points);
        let hits = by_hierarchy(world, Level::new(), &points);
        agree(&world.triangles, &points, &twin, &hits).unwrap_or_else(|what| panic!("world {i}: {what}"));
        check(&world.triangles, &[], &points, &hits).unwrap_or_else(|what| panic!("world {i}: {what}"));
        let n_same = hits.iter().zip(&twin).filter(|(a, b)| a == b).count();
        assert!(n_same * 100 >= 99 * N_POINTS, "world {i}: {n_same} of {N_POINTS}");
        for simd_level in simd_levels() {
            assert!(by_hierarchy(world, simd_level, &points) == hits, "world {i}, {simd_level:?}");
        }
    }
}

/// A corner of a triangle that the hierarchy lacks is at a distance.
#[test]
fn a_block_without_a_triangle_is_noticed() {
    let mut world = MeshWithTree::new(meshes::torus(24, 12));
    let points = points_of(&world, N_POINTS);
    let twin = by_twin(&world, &points);
    // A tree leaves out triangles that are not finite.
    let mut without = world.triangles.clone();
    without.iter_mut().step_by(9).for_each(|triangle| triangle.v0 = Vec3::NAN);
    world = MeshWithTree::with_tree(world.triangles, KdTree::build(&without, &BuildOptions::default()));
    let hits = by_hierarchy(&world, Level::new(), &points);
    agree(&world.triangles, &points, &twin, &hits).expect_err("a missing triangle");
}

#[test]
fn kernel_finds_what_its_twin_finds() {
    let context = device();
    for (i, world) in worlds().iter().enumerate() {
        let points = points_of(world, N_POINTS);
        let hits = on_device(&context, world, &points);
        let twin = by_twin(world, &points);
        agree(&world.triangles, &points, &twin, &hits).unwrap_or_else(|what| panic!("world {i}: {what}"));
        check(&world.triangles, &[], &points, &hits).unwrap_or_else(|what| panic!("world {i}: {what}"));
    }
    assert_silent(&context);
}

/// One caster gets more and more points, in one batch and in batches of 50.
#[test]
fn any_number_of_points_is_searched_for() {
    let context = device();
    let world = MeshWithTree::new(meshes::torus(24, 12));
    let points = points_of(&world, 2000);
    let twin = by_twin(&world, &points);
    let mut casters = [caster(&context, &world), caster(&context, &world).with_batches_of(50)];
    for n in RAY_COUNTS.map(|n| n as usize) {
        for caster in &mut casters {
            let found = caster.closest_points(&points[..n], 2).expect("hits");
            agree(&world.triangles, &points[..n], &twin[..n], &found.hits).unwrap();
            assert_eq!(found.gpu_ms.expect("timestamps").len(), 2);
        }
    }
    assert_silent(&context);
}

/// The distance is exactly 0 there, and of the triangles that share a corner, the one of the lowest index counts.
#[test]
fn corners_are_at_no_distance() {
    let context = device();
    for world in worlds() {
        let of_corner = |corner: Vec3| {
            let has_it = |triangle: &Triangle| [triangle.v0, triangle.v1, triangle.v2].contains(&corner);
            let first = world.triangles.iter().position(has_it).expect("its triangle");
            (QueryPoint { position: corner, t_max: 0.0 }, first as u32)
        };
        let triangles = world.triangles.iter().step_by(5);
        let (points, first): (Vec<_>, Vec<_>) =
            triangles.flat_map(|triangle| [triangle.v0, triangle.v1, triangle.v2]).map(of_corner).unzip();
        for hits in [by_twin(&world, &points), on_cpu(&world, &points), on_device(&context, &world, &points)] {
            for (hit, first) in hits.iter().zip(&first) {
                // In the soup, another triangle may go through the corner.
                assert!(hit.t == 0.0 && hit.triangle_ix <= *first, "{hit:?}, not {first}");
            }
        }
    }
    assert_silent(&context);
}

/// A corner is found up to a greatest distance that is exactly its distance, and not up to the next lower number.
#[test]
fn the_greatest_distance_counts() {
    let world = MeshWithTree::new(meshes::cube(6, 0.0));
    let context = device();
    let at = |t_max: f32| QueryPoint { position: vec3(2.0, 3.0, 3.0), t_max };
    let points = [at(3.0), at(3f32.next_down()), at(0.0), at(1e30), at(f32::INFINITY)];
    for hits in [by_twin(&world, &points), on_cpu(&world, &points), on_device(&context, &world, &points)] {
        assert_eq!([0, 3, 4].map(|i| hits[i].t), [3.0; 3]);
        assert_eq!([1, 2].map(|i| hits[i]), [MISS; 2]);
    }
}

#[test]
fn points_that_are_none_miss() {
    let context = device();
    let world = MeshWithTree::new(meshes::torus(24, 12));
    let at = |position, t_max| QueryPoint { position, t_max };
    let (nan, inf) = (f32::NAN, f32::INFINITY);
    let points = [
        at(vec3(nan, 0.0, 0.0), inf),
        at(vec3(0.0, inf, 0.0), inf),
        at(vec3(0.0, 0.0, -inf), 1.0),
        at(Vec3::ZERO, nan),
        at(Vec3::ZERO, -1.0),
        at(Vec3::ZERO, -inf),
        at(Vec3::splat(f32::MAX), inf),
        at(Vec3::ZERO, inf),
    ];
    let found = caster(&context, &world).closest_points(&points, 1).expect("hits");
    assert_eq!(found.n_invalid, 6);
    for hits in [found.hits, on_cpu(&world, &points)] {
        assert_eq!(hits[..6], [MISS; 6]);
        assert!(hits[6..].iter().all(|hit| hit.triangle_ix != NO_TRIANGLE), "{hits:?}");
    }
    let nothing = MeshWithTree::new(Vec::new());
    for hits in [by_twin(&nothing, &points), on_cpu(&nothing, &points), on_device(&context, &nothing, &points)] {
        assert_eq!(hits, [MISS; 8]);
    }
    assert_silent(&context);
}

#[test]
fn hidden_triangles_are_not_there() {
    let context = device();
    let world = MeshWithTree::new(meshes::torus(24, 12));
    let hidden: Vec<u32> = (0..world.triangles.len() as u32).filter(|ix| ix % 3 != 0).collect();
    let points = points_of(&world, N_POINTS);
    let mut on_device = caster(&context, &world).hiding(&hidden).expect("triangles");
    let hits = on_device.closest_points(&points, 1).expect("hits").hits;
    check(&world.triangles, &hidden, &points, &hits).unwrap();
    let on_cpu = CpuCaster::new(world.geometry(), Traversal::Stack).hiding(&hidden).expect("triangles");
    check(&world.triangles, &hidden, &points, &on_cpu.closest_points(&points).expect("hits")).unwrap();
    assert!(check(&world.triangles, &[], &points, &hits).is_err(), "hiding makes a difference");
    assert_silent(&context);
}

/// From the middle of a sphere, all triangles are equally close, so that the search spends its iterations many times.
#[test]
fn suspended_searches_end_as_others_do() {
    let world = MeshWithTree::new(meshes::cube(12, 1.0));
    let mut points = points_of(&world, 300);
    points.extend((0..100).map(|_| QueryPoint { position: Vec3::ZERO, t_max: f32::INFINITY }));
    let twin = by_twin(&world, &points);
    for n_suspension_slots in [None, Some(10)] {
        let context =
            pretended(DeviceOverrides { loop_limit: Some(2000), n_suspension_slots, ..DeviceOverrides::default() });
        let hits = on_device(&context, &world, &points);
        agree(&world.triangles, &points, &twin, &hits).unwrap();
        check(&world.triangles, &[], &points, &hits).unwrap();
        assert_silent(&context);
    }
}

#[test]
fn grids_are_refused() {
    let triangles = meshes::torus(24, 12);
    let grid = Accel::new(&triangles, &AccelOptions::Grid(GridOptions::uniform()));
    let geometry = Geometry::new(&triangles, &grid).expect("a grid of these triangles");
    let refusal = "closest points are found in kd-trees (--accel kdtree)";
    let of_cpu = CpuCaster::new(geometry, Traversal::Stack).closest_points(&[]).expect_err("a grid");
    assert_eq!(of_cpu.to_string(), refusal);
    let mut caster = GpuCaster::new(device(), geometry, Traversal::Stack).expect("a caster");
    assert!(caster.closest_points(&[], 1).expect_err("a grid").to_string().contains(refusal));
}

#[test]
fn wrong_hits_are_noticed() {
    let world = MeshWithTree::new(meshes::torus(24, 12));
    let points = points_of(&world, 70);
    let hits = on_cpu(&world, &points);
    let (right, _) = (0..70).zip(&hits).find(|(i, hit)| i % 7 == 6 && hit.triangle_ix != NO_TRIANGLE).expect("a hit");
    type Plant = fn(&mut Hit);
    let errors: [(&str, Plant); 5] = [
        ("a miss", |hit| *hit = MISS),
        ("too far", |hit| hit.triangle_ix = (hit.triangle_ix + 200) % 576),
        ("t", |hit| hit.t *= 1.0 + 1e-4),
        ("weights", |hit| hit.u = -0.01),
        ("point", |hit| (hit.u, hit.v) = (0.4 - 0.4 * hit.u, 0.4 - 0.4 * hit.v)),
    ];
    for (what, plant) in errors {
        let mut wrong = hits.clone();
        plant(&mut wrong[right]);
        let found = check(&world.triangles, &[], &points, &wrong).expect_err(what);
        assert!(found.starts_with(what), "{found}, not {what}");
    }
    let mut wrong = hits.clone();
    wrong[right].t *= 1.0 + 1e-4;
    agree(&world.triangles, &points, &hits, &wrong).expect_err("another distance");
}
