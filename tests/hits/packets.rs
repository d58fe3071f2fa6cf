//! Compares sixteen rays at once, and one ray with sixteen boxes or triangles at once, with the reference, which does
//! one test after the other. This is done with each instruction set of the machine. The hits are the same, bit for bit.

use std::array::from_fn;

use crate::support::{
    MeshWithTree, meshes,
    packets::{check_one_by_one, simd_levels, traced},
    random::Random,
    rays::nasty_ray,
};
use fearless_simd::{Level, dispatch, f32x16, prelude::*};
use glam::{Vec3, Vec3Swizzles};
use kdray::{
    accel::kdtree::Traversal,
    cpu::{direction_bins::DirectionBins, lanes::LANES, packet_triangle::Shears},
    layout::{Hit, NO_TRIANGLE, PathRay, Triangle},
    reference::{
        search_ray::SearchRay,
        traversal_ray::{TraversalRay, signs_of},
        traverser::{Tracer, Traverser},
        triangle::{Shear, longest_axis},
    },
};

#[test]
#[cfg(target_arch = "x86_64")]
fn the_machines_instructions_are_tested() {
    let has = |is: fn(&Level) -> bool| simd_levels().iter().any(is);
    assert!(has(|simd_level| matches!(simd_level, Level::Sse2(_))));
    assert_eq!(has(|simd_level| matches!(simd_level, Level::Avx2(_))), is_x86_feature_detected!("avx2"));
}

/// Returns the hit's four words, with floats as their bits.
fn bits(hit: &Hit) -> [u32; 4] {
    bytemuck::cast(*hit)
}

fn together(simd_level: Level, rays: &[PathRay; LANES], triangle: &Triangle, triangle_ix: u32) -> [Option<Hit>; LANES] {
    dispatch!(simd_level, simd => {
        let columns = |of: fn(&PathRay) -> Vec3| -> [_; 3] {
            from_fn(|axis| f32x16::load_array(simd, from_fn(|lane| of(&rays[lane])[axis])))
        };
        let shears = Shears::of(&columns(|ray| ray.origin), &columns(|ray| ray.direction));
        let mut hits = [None; LANES];
        for axis in 0..3 {
            let lanes = shears.lanes_of_axis[axis] & ((1 << LANES) - 1);
            let hit = shears.intersect_triangle(triangle, triangle_ix, axis, lanes);
            let Some((found, is_hit, is_back)) = hit else { continue };
            for lane in (0..LANES).filter(|&lane| is_hit.test(lane)) {
                assert_eq!((lanes >> lane & 1, hits[lane]), (1, None), "a ray has one axis");
                assert_eq!(is_back.test(lane), shear_of(&rays[lane]).is_back_face(triangle));
                hits[lane] = Some(found.of_lane(lane));
            }
        }
        hits
    })
}

fn alone(ray: &PathRay, triangle: &Triangle, triangle_ix: u32) -> Option<Hit> {
    shear_of(ray).intersect_triangle(triangle, triangle_ix)
}

fn shear_of(ray: &PathRay) -> Shear {
    Shear::of(ray.origin.to_array(), ray.direction.to_array())
}

/// Returns triangles without area, and triangles with NaN, infinite, large and small coordinates.
fn odd_triangles() -> Vec<Triangle> {
    let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
    let mut triangles: Vec<_> = [(x, x, y), (x, x, x), (x, -x, 0.5 * x), (0.1 * x, 0.2 * x, 0.3 * x + 1e-7 * y)]
        .map(|(v0, v1, v2)| meshes::triangle(v0, v1, v2))
        .into();
    for wrong in [f32::NAN, f32::INFINITY, f32::MAX, 1e-40] {
        triangles.extend(Vec3::AXES.map(|axis| meshes::triangle(x + wrong * axis, y, z)));
        triangles.push(meshes::triangle(wrong * x, wrong * y, wrong * z));
    }
    triangles
}

/// Returns nasty rays. In some packets, one ray has numbers that no ray should have.
fn rays_of_a_packet(random: &mut Random, world: &MeshWithTree) -> [PathRay; LANES] {
    let first = random.below(1000);
    let mut rays = from_fn(|lane| nasty_ray(random, world, first + lane));
    if random.below(10) == 0 {
        let ray = &mut rays[random.below(LANES)];
        let wrong = *random.of(&[0.0, f32::NAN, f32::INFINITY, -1e-40, 1e30]);
        if random.below(2) == 0 { ray.origin.x = wrong } else { ray.direction *= wrong }
    }
    rays
}

#[test]
fn a_triangle_is_met_as_by_one_ray() {
    let mut triangles = meshes::cube(2, 0.0);
    let world = MeshWithTree::new(triangles.clone());
    triangles.extend(odd_triangles());
    for simd_level in simd_levels() {
        let (mut n_hits, mut n_at_edges) = (0, 0);
        for seed in 0..5000 {
            let rays = rays_of_a_packet(&mut Random(seed), &world);
            for (triangle_ix, triangle) in (0..).zip(&triangles) {
                let found = together(simd_level, &rays, triangle, triangle_ix);
                for (ray, found) in rays.iter().zip(found) {
                    let expected = alone(ray, triangle, triangle_ix);
                    let [expected_bits, found_bits] = [&expected, &found].map(|hit| hit.as_ref().map(bits));
                    assert_eq!(
                        expected_bits, found_bits,
                        "{simd_level:?}: {ray:?}, {triangle:?}: {found:?}, not {expected:?}"
                    );
                    n_hits += u32::from(found.is_some());
                    n_at_edges += u32::from(found.is_some_and(|hit| hit.u == 0.0 || hit.v == 0.0));
                }
            }
        }
        assert!(n_hits > 10_000 && n_at_edges > 1000, "{simd_level:?}: {n_hits}, {n_at_edges}");
    }
}

#[test]
fn every_set_of_instructions_finds_the_same() {
    for triangles in [meshes::torus(40, 20), meshes::cube(9, 0.0), meshes::soup(1200, 7)] {
        let world = MeshWithTree::new(triangles);
        let rays: Vec<_> = (0..1500).flat_map(|seed| rays_of_a_packet(&mut Random(seed), &world)).collect();
        let mut one = Traverser::new(&world.inputs(), Traversal::Mask);
        let expected: Vec<Hit> = rays.iter().map(|ray| one.traverse::<false>(&world.inputs(), &ray.into())).collect();
        assert!(expected.iter().filter(|hit| hit.triangle_ix != NO_TRIANGLE).count() > rays.len() / 5);
        for simd_level in simd_levels() {
            let closest = traced::<false>(&world, simd_level, &rays);
            let wrong = (0..rays.len()).find(|&i| bits(&closest[i]) != bits(&expected[i]));
            assert_eq!(wrong.map(|i| (rays[i], closest[i], expected[i])), None, "{simd_level:?}");
            let any = traced::<true>(&world, simd_level, &rays);
            let is_hit = |hit: &Hit| hit.triangle_ix != NO_TRIANGLE;
            assert!(any.iter().map(is_hit).eq(expected.iter().map(is_hit)), "{simd_level:?}");
            check_one_by_one(&world, simd_level, &rays, &expected);
        }
    }
}

/// Returns directions of all signs and longest axes in turn. Some have components that are 0 or almost 0, with either
/// sign.
fn directions_in_turn() -> impl Iterator<Item = Vec3> {
    let sign = |i: u32, bit: u32| if i >> bit & 1 == 1 { -1.0 } else { 1.0 };
    (0..1000).map(move |i| {
        let flat = [1.0, 0.0, 1e-13, 1e-12, 2e-12][i as usize / 8 % 5];
        let direction = Vec3::new(sign(i, 0) * flat, 2.0 * sign(i, 1), 3.0 * sign(i, 2));
        [direction, direction.yzx(), direction.zxy()][i as usize / 40 % 3]
    })
}

#[test]
fn sixteen_rays_of_one_class_of_directions_are_a_packet() {
    let mut bins = DirectionBins::default();
    let mut seen = vec![];
    let mut n_packets = 0;
    for (ray_ix, direction) in directions_in_turn().enumerate() {
        let search_ray = SearchRay::from(&crate::support::rays::ray(Vec3::X * ray_ix as f32, direction));
        let Some(bin) = bins.push(ray_ix, &search_ray) else { continue };
        n_packets += 1;
        assert_eq!(bin.keys.len(), LANES);
        for (lane, ray_ix) in bin.keys.drain(..).enumerate() {
            let search_ray = bin.rays.get(lane);
            assert_eq!(search_ray.origin.x, ray_ix as f32, "the ray's own");
            let class_of = |direction: Vec3| (signs_of(direction), longest_axis(direction.to_array()));
            assert_eq!(class_of(search_ray.direction), class_of(bin.rays.get(0).direction));
            seen.push(ray_ix);
        }
    }
    assert!(n_packets > 1000 / LANES - 24);
    bins.non_empty().for_each(|bin| seen.extend(bin.keys.drain(..)));
    assert_eq!(bins.non_empty().count(), 0);
    seen.sort_unstable();
    assert_eq!(seen, (0..1000).collect::<Vec<_>>());
}

/// The signs of a direction tell in which order a ray comes to the children of a node, as [`TraversalRay`] does.
#[test]
fn rays_of_the_same_signs_take_children_in_one_order() {
    let world = MeshWithTree::new(meshes::cube(2, 0.0));
    for direction in directions_in_turn() {
        let ray =
            TraversalRay::new(&world.inputs(), &SearchRay::from(&crate::support::rays::ray(Vec3::ZERO, direction)));
        for axis in 0..3 {
            assert_eq!(signs_of(direction) >> axis & 1 == 1, ray.inv_direction[axis] < 0.0, "{direction}");
        }
    }
}
