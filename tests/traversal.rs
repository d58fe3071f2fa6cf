//! Compares the CPU's kd-tree traversals with brute force over all triangles, and with one another.

mod support;

use fearless_simd::Level;
use glam::{Vec3, vec3};
use kdray::{
    accel::{
        Query,
        kdtree::{BuildOptions, KdTree, Traversal},
        wide_bvh::WideBvh,
    },
    cpu::tracer::FastTracer,
    layout::{Hit, NO_TRIANGLE, PathRay, Slab, Triangle},
    reference::{
        brute,
        counting::{steps::count_steps, table::CountedSlice},
        inputs::KernelInputs,
        search_ray::SearchRay,
        traversal_ray::near_scene,
        traverser::{Tracer, Traverser},
    },
};
use rayon::prelude::*;
use support::{
    MeshWithTree,
    compare::first_difference,
    meshes,
    packets::{check_one_by_one, traced_one_by_one},
    random::Random,
    rays::{nasty_ray, outward_ray, ray},
};

const N_RAYS: usize = 100_000;

/// Returns all traversals that use the tree.
fn tree_traversals() -> impl Iterator<Item = Traversal> {
    Traversal::ALL.iter().copied().filter(|&traversal| traversal != Traversal::Brute)
}

fn rays_at(world: &MeshWithTree) -> Vec<PathRay> {
    (0..N_RAYS).map(|i| nasty_ray(&mut Random(i as u64), world, i)).collect()
}

/// Returns the hits that the engine finds for rays together. They must be the reference's, bit for bit, and any-hit
/// queries must hit with the same rays.
fn traced(world: &MeshWithTree, traversal: Traversal, rays: &[PathRay]) -> Vec<Hit> {
    let hits = traced_through(&world.inputs(), traversal, rays);
    if traversal == Traversal::Stack {
        check_one_by_one(world, Level::new(), rays, &hits);
    }
    hits
}

fn traced_through(bindings: &KernelInputs, traversal: Traversal, rays: &[PathRay]) -> Vec<Hit> {
    let of_task = |(engine, reference): &mut (FastTracer, Traverser), rays: &[PathRay]| {
        let (mut closest, mut is_hit) = (vec![Hit::default(); rays.len()], vec![false; rays.len()]);
        let search_rays = || rays.iter().map(SearchRay::from).enumerate();
        engine.trace_all::<false, _>(bindings, search_rays(), |i, hit| closest[i] = hit);
        engine.trace_all::<true, _>(bindings, search_rays(), |i, hit| is_hit[i] = hit.triangle_ix != NO_TRIANGLE);
        let alone = rays.iter().map(|ray| reference.traverse::<false>(bindings, &ray.into())).collect::<Vec<_>>();
        assert_eq!(first_difference(rays, &alone, &closest), None, "{traversal}: engine and reference");
        assert_eq!(is_hit, closest.iter().map(|hit| hit.triangle_ix != NO_TRIANGLE).collect::<Vec<_>>(), "{traversal}");
        closest
    };
    // The number of rays is not a multiple of the packet size.
    rays.par_chunks(1001)
        .map_init(|| (FastTracer::new(bindings, traversal), Traverser::new(bindings, traversal)), of_task)
        .flatten()
        .collect()
}

fn check_against_brute_force(name: &str, triangles: Vec<Triangle>) {
    let world = MeshWithTree::new(triangles);
    let rays = rays_at(&world);
    let expected: Vec<Hit> = rays.par_iter().map(|ray| world.by_brute_force(ray, 0.0)).collect();
    let n_hits = expected.iter().filter(|hit| hit.triangle_ix != NO_TRIANGLE).count();
    assert!(n_hits > N_RAYS / 5, "{name}: only {n_hits} rays hit anything");
    let wrong: Vec<String> = tree_traversals()
        .filter_map(|traversal| {
            let difference = first_difference(&rays, &expected, &traced(&world, traversal, &rays))?;
            Some(format!("{name}, {traversal}: {difference}"))
        })
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn finds_what_brute_force_finds() {
    check_against_brute_force("torus", meshes::torus(40, 20));
    check_against_brute_force("cube", meshes::cube(9, 0.0));
    check_against_brute_force("sphere", meshes::cube(10, 1.0));
    check_against_brute_force("threefold", meshes::threefold(meshes::torus(20, 10)));
    check_against_brute_force("stacked", vec![meshes::triangle(Vec3::X, Vec3::Y, Vec3::Z); 300]);
    check_against_brute_force("soup", meshes::soup(1200, 7));
    check_against_brute_force("tiny", meshes::placed(meshes::torus(40, 20), 1e-6, Vec3::ZERO));
    check_against_brute_force("far", meshes::placed(meshes::torus(40, 20), 0.3, vec3(1000.0, -70.0, 3.0)));
    check_against_brute_force("one", vec![meshes::triangle(Vec3::X, Vec3::Y, Vec3::Z)]);
}

#[test]
fn all_agree_in_larger_meshes() {
    for triangles in [meshes::torus(400, 200), meshes::cube(100, 0.3), meshes::soup(50_000, 3)] {
        let world = MeshWithTree::new(triangles);
        let rays = rays_at(&world);
        let masked = traced(&world, Traversal::Mask, &rays);
        for traversal in tree_traversals() {
            let difference = first_difference(&rays, &masked, &traced(&world, traversal, &rays));
            assert_eq!(difference, None, "{traversal}");
        }
    }
}

#[test]
fn a_wrong_bit_or_triangle_is_noticed() {
    let world = MeshWithTree::new(meshes::torus(20, 10));
    let rays = rays_at(&world);
    let hits = traced(&world, Traversal::Mask, &rays);
    assert_eq!(first_difference(&rays, &hits, &hits), None);
    let i = hits.iter().position(|hit| hit.triangle_ix != NO_TRIANGLE).expect("some ray hits");
    let mut wrong = hits.clone();
    wrong[i].t = f32::from_bits(hits[i].t.to_bits() + 1);
    assert!(first_difference(&rays, &hits, &wrong).is_some());
    wrong[i] = Hit { triangle_ix: hits[i].triangle_ix ^ 1, ..hits[i] };
    assert!(first_difference(&rays, &hits, &wrong).is_some());
}

#[test]
fn a_missing_triangle_in_a_leaf_is_noticed() {
    let mut world = MeshWithTree::new(meshes::torus(20, 10));
    let rays = rays_at(&world);
    let hits = traced(&world, Traversal::Mask, &rays);
    // A tree leaves out triangles that are not finite.
    let mut without = world.triangles.clone();
    without[world.tree().leaf_triangles()[0] as usize].v0 = Vec3::NAN;
    world = MeshWithTree::with_tree(world.triangles, KdTree::build(&without, &BuildOptions::default()));
    assert!(first_difference(&rays, &hits, &traced(&world, Traversal::Mask, &rays)).is_some());
    let bvh = WideBvh::new(world.tree(), &world.triangles);
    let one_by_one = traced_one_by_one::<false>(&world.inputs(), &bvh, Level::new(), &rays);
    assert!(first_difference(&rays, &hits, &one_by_one).is_some());
}

/// A thread takes several rays by turns, and fewer at the end of its list.
#[test]
fn any_number_of_rays_is_traced_by_turns() {
    let world = MeshWithTree::new(meshes::torus(40, 20));
    let rays = rays_at(&world);
    let hits = traced(&world, Traversal::Mask, &rays);
    let (bvh, inputs) = (WideBvh::new(world.tree(), &world.triangles), world.inputs());
    for n in 0..20 {
        let by_turns = traced_one_by_one::<false>(&inputs, &bvh, Level::new(), &rays[..n]);
        assert_eq!(first_difference(&rays[..n], &hits[..n], &by_turns), None, "{n} rays");
    }
}

#[test]
fn slabs_spare_steps() {
    let world = MeshWithTree::new(meshes::torus(120, 60));
    let rays = rays_at(&world);
    let bindings = world.inputs();
    let without = KernelInputs { kd_slabs: CountedSlice::from(&[][..]), ..bindings };
    for traversal in tree_traversals() {
        let [some, all] = [bindings, without].map(|bindings| {
            let steps = count_steps(&bindings, traversal, Query::Closest, &rays);
            steps.n_nodes + steps.n_triangles
        });
        assert!(some < all * 97 / 100, "{traversal}: {some} steps of {all}");
    }
}

#[test]
fn slabs_beside_their_surface_are_noticed() {
    let world = MeshWithTree::new(meshes::torus(120, 60));
    let rays = rays_at(&world);
    let bindings = world.inputs();
    let moved: Vec<Slab> =
        world.tree().slabs().iter().map(|slab| Slab { offset: slab.offset + 2.0, ..*slab }).collect();
    let moved = KernelInputs { kd_slabs: CountedSlice::from(&moved[..]), ..bindings };
    for traversal in tree_traversals() {
        let [expected, found] = [&bindings, &moved].map(|bindings| traced_through(bindings, traversal, &rays));
        assert!(first_difference(&rays, &expected, &found).is_some(), "{traversal}");
    }
}

#[test]
fn rays_from_inside_never_leak() {
    for (name, triangles) in [("sphere", meshes::cube(20, 1.0)), ("cube", meshes::cube(20, 0.0))] {
        let world = MeshWithTree::new(triangles);
        let rays: Vec<PathRay> = (0..300_000).map(|i| outward_ray(&mut Random(i), &world.triangles)).collect();
        for traversal in tree_traversals() {
            let n_leaks = traced(&world, traversal, &rays).iter().filter(|hit| hit.triangle_ix == NO_TRIANGLE).count();
            assert_eq!(n_leaks, 0, "{name}, {traversal}");
        }
    }
}

#[test]
fn a_hole_leaks() {
    let mut triangles = meshes::cube(20, 1.0);
    triangles.remove(7);
    let world = MeshWithTree::new(triangles);
    let rays: Vec<PathRay> = (0..100_000).map(|i| outward_ray(&mut Random(i), &world.triangles)).collect();
    assert!(traced(&world, Traversal::Mask, &rays).iter().any(|hit| hit.triangle_ix == NO_TRIANGLE));
}

/// Each component of origin and direction takes numbers that no ray should have. Rays whose directions are merely far
/// from unit length only have to end.
#[test]
fn rays_that_are_none_end_and_miss() {
    let world = MeshWithTree::new(meshes::torus(40, 20));
    let (nan, infinity) = (f32::NAN, f32::INFINITY);
    let mut must_miss = vec![ray(Vec3::ZERO, Vec3::ZERO), ray(Vec3::NAN, Vec3::NAN)];
    let mut must_end = Vec::new();
    for origin in [Vec3::ZERO, Vec3::X, vec3(3.0, 0.1, 0.2), world.triangles[5].v0] {
        for direction in [Vec3::X, Vec3::NEG_X, Vec3::Y, vec3(-0.6, 0.8, 0.0), vec3(-0.7, 0.1, -0.6)] {
            for axis in 0..3 {
                for wrong in [nan, infinity, -infinity] {
                    must_miss.push(ray(with(origin, axis, wrong), direction));
                    must_miss.push(ray(origin, with(direction, axis, wrong)));
                }
                for wrong in [f32::MAX, f32::MIN_POSITIVE, 1e-40, -1e-40, -1e30, 1e20] {
                    must_end.push(ray(with(origin, axis, wrong), direction));
                    must_end.push(ray(origin, with(direction, axis, wrong)));
                }
            }
            must_end.extend([1e-38, 1e-44, 1e38].map(|scale| ray(origin, direction * scale)));
            must_miss.extend([nan, 0.0, -1.0, -infinity].map(|t_max| PathRay { t_max, ..ray(origin, direction) }));
        }
    }
    for &traversal in Traversal::ALL {
        let hits = traced(&world, traversal, &must_miss);
        for (ray, hit) in must_miss.iter().zip(hits) {
            assert_eq!(hit.triangle_ix, NO_TRIANGLE, "{traversal}: {ray:?} hits at {}", hit.t);
        }
        traced(&world, traversal, &must_end);
    }
}

fn with(mut v: Vec3, axis: usize, value: f32) -> Vec3 {
    v[axis] = value;
    v
}

/// Seen from its end, a needle's corners are on one line with the ray, as far as rounded products can tell.
#[test]
fn a_needle_is_not_hit_beside() {
    let triangles = meshes::soup(1200, 7);
    let origin = vec3(-1.7435632, -4.7086616, -7.629315);
    let needle = ray(origin, vec3(0.40416333, 0.5116821, 0.75817764));
    assert_eq!(brute::closest_hit(&triangles, &SearchRay::from(&needle)).triangle_ix, NO_TRIANGLE);
}

/// These rays come from so far away that they are moved to the scene first. They hit the same triangles as in a test
/// without that.
#[test]
fn rays_from_afar_hit_the_same() {
    let world = MeshWithTree::new(meshes::torus(40, 20));
    for distance in [10.0, 300.0, 3000.0] {
        let afar = |i: usize| {
            let mut random = Random(i as u64);
            let within = random.in_box(world.tree().box_min(), world.tree().box_max());
            let origin = world.centre() + distance * world.radius() * random.direction();
            ray(origin, (within - origin).normalize())
        };
        let rays: Vec<PathRay> = (0..N_RAYS / 10).map(afar).collect();
        assert!(rays.iter().all(|ray| near_scene(&world.inputs(), &SearchRay::from(ray)).1 > 0.0));
        let unmoved: Vec<Hit> =
            rays.par_iter().map(|ray| brute::closest_hit(&world.triangles, &SearchRay::from(ray))).collect();
        for traversal in tree_traversals() {
            let found = traced(&world, traversal, &rays);
            let differs = |(a, b): &(&Hit, &Hit)| a.triangle_ix != b.triangle_ix || (a.t - b.t).abs() > 1e-6 * a.t;
            let n = unmoved.iter().zip(&found).filter(differs).count();
            // Only rays at edges differ: an origin is rounded to 2^-24 of its distance, and a triangle is some 2^-4
            // wide.
            assert!(n as f32 <= 5.0 + rays.len() as f32 * distance * 2e-6, "{traversal}, {distance}: {n} rays differ");
            assert!(found.iter().filter(|hit| hit.triangle_ix != NO_TRIANGLE).count() > rays.len() / 5);
        }
    }
}

#[test]
fn nothing_is_hit_in_an_empty_world() {
    let world = MeshWithTree::new(Vec::new());
    let rays = [ray(Vec3::ZERO, Vec3::X), ray(Vec3::ONE, Vec3::NEG_ONE.normalize())];
    for traversal in tree_traversals() {
        let hits = traced(&world, traversal, &rays);
        assert!(hits.iter().all(|hit| hit.triangle_ix == NO_TRIANGLE && hit.t == f32::INFINITY));
    }
}
