//! Eight rays together, with each set of instructions that the machine has, against one ray after the other: the same,
//! bit for bit.

mod support;

use std::array::from_fn;

use fearless_simd::{Level, Simd, dispatch, f32x8, prelude::*};
use glam::Vec3;
use kdray::{
    cpu::{
        companions::{point_the_same_way, sort_by_direction},
        packet::LANES,
        packet_triangle::Shears,
        probe::Probe,
        traverser::Traverser,
        triangle::Shear,
    },
    frame::Traversal,
    layout::{Hit, NO_TRIANGLE, Ray, Triangle},
};
use support::{World, meshes, random::Random, rays::nasty_ray};

/// The baseline first.
fn levels() -> Vec<Level> {
    let mut levels = vec![Level::baseline()];
    #[cfg(target_arch = "x86_64")]
    {
        let best = Level::new();
        levels.extend(best.as_sse4_2().map(Simd::level));
        levels.extend(best.as_avx2().map(Simd::level));
        levels.extend(best.as_avx512().map(Simd::level));
    }
    levels
}

#[test]
#[cfg(target_arch = "x86_64")]
fn the_machines_instructions_are_tested() {
    let has = |is: fn(&Level) -> bool| levels().iter().any(is);
    assert!(has(|level| matches!(level, Level::Sse2(_))));
    assert_eq!(has(|level| matches!(level, Level::Avx2(_))), is_x86_feature_detected!("avx2"));
}

/// With floats by their bits.
fn bits(hit: &Hit) -> [u32; 4] {
    bytemuck::cast(*hit)
}

fn together(level: Level, rays: &[Ray; LANES], triangle: &Triangle, triangle_ix: u32) -> [Option<Hit>; LANES] {
    dispatch!(level, simd => {
        let columns = |of: fn(&Ray) -> Vec3| -> [_; 3] {
            from_fn(|axis| f32x8::load_array(simd, from_fn(|lane| of(&rays[lane])[axis])))
        };
        let shears = Shears::of(&columns(|ray| ray.origin), &columns(|ray| ray.direction));
        let mut hits = [None; LANES];
        for axis in 0..3 {
            let lanes = shears.lanes_of_axis[axis] & 0xff;
            let Some((found, is_hit)) = shears.intersect_triangle(triangle, triangle_ix, axis, lanes) else { continue };
            for lane in (0..LANES).filter(|&lane| is_hit.test(lane)) {
                assert_eq!((lanes >> lane & 1, hits[lane]), (1, None), "a ray has one axis");
                hits[lane] = Some(found.of_lane(lane));
            }
        }
        hits
    })
}

fn alone(ray: &Ray, triangle: &Triangle, triangle_ix: u32) -> Option<Hit> {
    Shear::of(ray.origin.to_array(), ray.direction.to_array()).intersect_triangle(triangle, triangle_ix)
}

/// Without area, with numbers that are none, large and small.
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

/// Nasty rays, and some with numbers that no ray should have.
fn eight_rays(random: &mut Random, world: &World) -> [Ray; LANES] {
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
    let world = World::new(triangles.clone());
    triangles.extend(odd_triangles());
    for level in levels() {
        let (mut n_hits, mut n_at_edges) = (0, 0);
        for seed in 0..5000 {
            let rays = eight_rays(&mut Random(seed), &world);
            for (triangle_ix, triangle) in (0..).zip(&triangles) {
                let found = together(level, &rays, triangle, triangle_ix);
                for (ray, found) in rays.iter().zip(found) {
                    let expected = alone(ray, triangle, triangle_ix);
                    let [expected_bits, found_bits] = [&expected, &found].map(|hit| hit.as_ref().map(bits));
                    assert_eq!(
                        expected_bits, found_bits,
                        "{level:?}: {ray:?}, {triangle:?}: {found:?}, not {expected:?}"
                    );
                    n_hits += u32::from(found.is_some());
                    n_at_edges += u32::from(found.is_some_and(|hit| hit.u == 0.0 || hit.v == 0.0));
                }
            }
        }
        assert!(n_hits > 10_000 && n_at_edges > 1000, "{level:?}: {n_hits}, {n_at_edges}");
    }
}

fn traced<const ANY_HIT: bool>(world: &World, level: Level, rays: &[Ray]) -> Vec<Hit> {
    let mut hits = Vec::new();
    let probes = rays.iter().map(|ray| ((), Probe::from(ray)));
    let mut traverser = Traverser::at_level(Traversal::Stack, level);
    traverser.traverse_all::<ANY_HIT, _>(&world.bindings(), probes, |(), hit| hits.push(hit));
    hits
}

#[test]
fn every_set_of_instructions_finds_the_same() {
    for triangles in [meshes::torus(40, 20), meshes::cube(9, 0.0), meshes::soup(1200, 7)] {
        let world = World::new(triangles);
        let rays: Vec<_> = (0..1500).flat_map(|seed| eight_rays(&mut Random(seed), &world)).collect();
        let mut one = Traverser::new(Traversal::Mask);
        let expected: Vec<Hit> = rays.iter().map(|ray| one.traverse::<false>(&world.bindings(), &ray.into())).collect();
        assert!(expected.iter().filter(|hit| hit.triangle_ix != NO_TRIANGLE).count() > rays.len() / 5);
        for level in levels() {
            let closest = traced::<false>(&world, level, &rays);
            let wrong = (0..rays.len()).find(|&i| bits(&closest[i]) != bits(&expected[i]));
            assert_eq!(wrong.map(|i| (rays[i], closest[i], expected[i])), None, "{level:?}");
            let any = traced::<true>(&world, level, &rays);
            let is_hit = |hit: &Hit| hit.triangle_ix != NO_TRIANGLE;
            assert!(any.iter().map(is_hit).eq(expected.iter().map(is_hit)), "{level:?}");
        }
    }
}

fn towards(directions: impl IntoIterator<Item = Vec3>) -> Vec<Probe> {
    directions.into_iter().map(|direction| Probe::from(&support::rays::ray(Vec3::ZERO, direction))).collect()
}

#[test]
fn neighbours_of_two_octants_go_together() {
    let along = |signs: [f32; 3]| towards(signs.map(|sign| Vec3::new(1.0, 2.0 * sign, 0.1)));
    assert!(point_the_same_way(&along([1.0, 1.0, 1.0])));
    assert!(point_the_same_way(&along([1.0, -1.0, 1.0])));
    assert!(!point_the_same_way(&towards(Vec3::AXES.map(|axis| Vec3::ONE - 2.0 * axis))));
}

/// Of 512 rays into all octants in turn, eight that go together point into one.
#[test]
fn others_go_with_rays_of_their_direction() {
    let sign = |i: u32, bit: u32| if i >> bit & 1 == 1 { -1.0 } else { 1.0 };
    let probes = towards((0..512).map(|i| Vec3::new(sign(i, 0), 2.0 * sign(i, 1), 3.0 * sign(i, 2))));
    let mut order: Vec<u32> = (0..512).collect();
    sort_by_direction(&probes, &mut order);
    for eight in order.chunks(LANES) {
        assert!(eight.iter().all(|&ix| probes[ix as usize].direction == probes[eight[0] as usize].direction));
    }
    order.sort_unstable();
    assert_eq!(order, (0..512).collect::<Vec<_>>());
}
