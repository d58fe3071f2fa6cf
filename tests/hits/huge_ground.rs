//! A small mesh on a ground of many kilometres. The rounding of hits on the ground is larger than the mesh's triangles.
//! Yet rays find the mesh's triangles about as fast as without the ground, and miss none.

use crate::support::{
    MeshWithTree, assert_silent,
    compare::{self, first_difference},
    device, meshes, n_outliers,
    packets::check_one_by_one,
    random::Random,
    rays::{N_KINDS, nasty_ray, outward_ray, ray},
};
use fearless_simd::Level;
use glam::{Vec3, vec3};
use kdray::{
    accel::{
        Query,
        kdtree::{BuildOptions, KdTree, Traversal},
    },
    cast::{GpuCaster, Ray, cast_on_cpu},
    cpu::tracer::FastTracer,
    layout::{Hit, PathRay, Triangle},
    reference::{
        brute, counting::steps::count_steps, inputs::KernelInputs, search_ray::SearchRay, traversal_ray::near_scene,
        traverser::Tracer,
    },
};
use rayon::prelude::*;

/// Half of the edges of the grounds, m: 10 km and 1000 km.
const GROUNDS: [f32; 2] = [1e4, 1e6];

/// The two triangles of a square ground at y = -0.6.
fn ground(half: f32) -> [Triangle; 2] {
    let [a, b, c, d] = [(-half, -half), (half, -half), (half, half), (-half, half)].map(|(x, z)| vec3(x, -0.6, z));
    [meshes::triangle(a, c, b), meshes::triangle(a, d, c)]
}

/// Returns a torus of 28 mm, whose triangles are some 2 mm long.
fn small_torus() -> MeshWithTree {
    MeshWithTree::new(meshes::placed(meshes::torus(60, 30), 0.01, Vec3::ZERO))
}

/// Returns the mesh with a ground.
fn with_ground(mesh: &[Triangle], half: f32) -> MeshWithTree {
    MeshWithTree::new([mesh, &ground(half)].concat())
}

/// Returns rays of all nasty kinds at a mesh. The origin of each is moved back by the length that `back` makes.
fn rays_at(mesh: &MeshWithTree, n: usize, back: impl Fn(&mut Random) -> f32) -> Vec<PathRay> {
    let nasty = |i: usize| {
        let mut random = Random(i as u64);
        let mut ray = nasty_ray(&mut random, mesh, i);
        let back = back(&mut random);
        ray.origin -= back * ray.direction;
        ray.t_max += back;
        ray
    };
    (0..n).map(nasty).collect()
}

/// Returns a length between 1 m and `most`, all magnitudes alike.
fn length(random: &mut Random, most: f32) -> f32 {
    2f32.powf(random.between(0.0, most.log2()))
}

fn traced(inputs: &KernelInputs, traversal: Traversal, rays: &[PathRay]) -> Vec<Hit> {
    let of_task = |tracer: &mut FastTracer, rays: &[PathRay]| {
        let mut hits = vec![Hit::default(); rays.len()];
        let search_rays = rays.iter().map(SearchRay::from).enumerate();
        tracer.trace_all::<false, _>(inputs, search_rays, |i, hit| hits[i] = hit);
        hits
    };
    rays.par_chunks(1001).map_init(|| FastTracer::new(inputs, traversal), of_task).flatten().collect()
}

fn tree_traversals() -> impl Iterator<Item = Traversal> {
    Traversal::ALL.iter().copied().filter(|&traversal| traversal != Traversal::Brute)
}

#[test]
fn trees_are_valid() {
    for (half, mesh) in GROUNDS.into_iter().zip([small_torus().triangles, meshes::soup(5000, 7)]) {
        let world = with_ground(&mesh, half);
        assert_eq!(world.tree().validate(&world.triangles), Ok(()));
    }
}

#[test]
fn the_ground_costs_little() {
    let mesh = MeshWithTree::new(meshes::torus(400, 200));
    let rays: Vec<PathRay> = rays_at(&mesh, 5000, |_| 0.0);
    let n_steps = |world: &MeshWithTree| {
        let steps = count_steps(&world.inputs(), Traversal::Mask, Query::Closest, &rays);
        (steps.n_nodes + steps.n_triangles) as f64
    };
    let n_references = |world: &MeshWithTree| {
        world.tree().statistics(world.triangles.len(), &BuildOptions::default()).references_per_triangle
    };
    let without = (n_steps(&mesh), n_references(&mesh));
    for half in GROUNDS {
        let world = with_ground(&mesh.triangles, half);
        let with = (n_steps(&world), n_references(&world));
        println!("ground of {half}: steps, references a triangle {with:?}, without it {without:?}");
        assert!(with.0 < 2.0 * without.0 && with.1 < 1.5 * without.1, "{half}: {with:?}, not {without:?}");
    }
}

fn check_against_brute_force(mesh: &MeshWithTree, world: &MeshWithTree, rays: &[PathRay]) {
    let expected: Vec<Hit> = rays.par_iter().map(|ray| world.by_brute_force(ray, 0.0)).collect();
    let n_hits = expected.iter().filter(|hit| hit.triangle_ix < mesh.triangles.len() as u32).count();
    assert!(n_hits > rays.len() / 8, "only {n_hits} rays hit the mesh");
    for traversal in tree_traversals() {
        let difference = first_difference(rays, &expected, &traced(&world.inputs(), traversal, rays));
        assert_eq!(difference, None, "{traversal}, {:?}", world.tree().bounds());
    }
    check_one_by_one(world, Level::new(), rays, &expected);
}

/// The origins are near the mesh, at all distances, and at distances just below that from which rays are moved. There,
/// the rounding of rays that are not moved is greatest. Most rays go to vertices and edges, or along split planes.
#[test]
fn rays_find_what_brute_force_finds() {
    let mesh = small_torus();
    for half in GROUNDS {
        let world = with_ground(&mesh.triangles, half);
        let reach = world.accel.origin_reach();
        assert!(reach < 0.1 * half);
        let n = 1000 * N_KINDS;
        check_against_brute_force(&mesh, &world, &rays_at(&mesh, n, |_| 0.0));
        check_against_brute_force(&mesh, &world, &rays_at(&mesh, n, |random| length(random, 3.0 * half)));
        check_against_brute_force(&mesh, &world, &rays_at(&mesh, 5 * n, |random| reach * random.between(0.8, 0.99)));
    }
}

/// The cells of a shallow tree reach up to the ground's edge, so a ray's interval of t in a cell has large ends.
#[test]
fn triangles_in_large_cells_are_found() {
    let mesh = small_torus();
    let options = BuildOptions { max_depth: Some(2), ..BuildOptions::default() };
    for half in GROUNDS {
        let triangles = with_ground(&mesh.triangles, half).triangles;
        let tree = KdTree::build(&triangles, &options);
        assert_eq!(tree.validate(&triangles), Ok(()));
        let world = MeshWithTree::with_tree(triangles, tree);
        check_against_brute_force(&mesh, &world, &rays_at(&mesh, 500 * N_KINDS, |random| length(random, 10.0)));
    }
}

#[test]
fn rays_from_inside_never_leak() {
    let cube = meshes::cube(40, 0.5);
    let scale = 0.01;
    let scaled = |ray: PathRay| PathRay { origin: scale * ray.origin, ..ray };
    let rays: Vec<PathRay> = (0..300_000).map(|i| scaled(outward_ray(&mut Random(i), &cube))).collect();
    let mesh = meshes::placed(cube, scale, Vec3::ZERO);
    for half in GROUNDS {
        let world = with_ground(&mesh, half);
        for traversal in [Traversal::Mask, Traversal::Ropes, Traversal::Stack] {
            let hits = traced(&world.inputs(), traversal, &rays);
            let n_leaks = hits.iter().filter(|hit| hit.t > 4.0 * scale).count();
            assert_eq!(n_leaks, 0, "{traversal}, ground of {half}");
            if traversal == Traversal::Stack {
                check_one_by_one(&world, Level::new(), &rays, &hits);
            }
        }
    }
}

/// Rays from far away are moved to the mesh. They hit the same places as rays that are not moved, except at
/// silhouettes: a moved origin is rounded to 2^-24 of its distance.
#[test]
fn moved_rays_hit_the_same_places() {
    let mesh = MeshWithTree::new(meshes::torus(400, 200));
    let half = GROUNDS[0];
    let world = with_ground(&mesh.triangles, half);
    let rays = rays_at(&mesh, 200 * N_KINDS, |random| half * random.between(0.3, 0.9));
    let is_moved = |ray: &PathRay| near_scene(&world.inputs(), &SearchRay::from(ray)).1 > 0.0;
    let rays: Vec<PathRay> = rays.into_iter().filter(is_moved).collect();
    let unmoved: Vec<Hit> =
        rays.par_iter().map(|ray| brute::closest_hit(&world.triangles, &SearchRay::from(ray))).collect();
    let found = traced(&world.inputs(), Traversal::Stack, &rays);
    let is_on_mesh = |hit: &&Hit| hit.triangle_ix < mesh.triangles.len() as u32;
    let n_hits = unmoved.iter().filter(is_on_mesh).count();
    let differs = |(a, b): &(&Hit, &Hit)| (a.t - b.t).abs() > 2e-6 * half;
    let n = unmoved.iter().zip(&found).filter(differs).count();
    println!("{n} of {} rays differ, {n_hits} hit the mesh", rays.len());
    assert!(n_hits > 1000 && n * 50 < rays.len());
}

/// The kernels move rays as the CPU does, and find the same hits.
#[test]
fn the_device_finds_the_same() {
    let context = device();
    let mesh = small_torus();
    for half in GROUNDS {
        let world = with_ground(&mesh.triangles, half);
        let cast = |ray: PathRay, t_min| Ray { origin: ray.origin, t_min, direction: ray.direction, t_max: ray.t_max };
        let rays = rays_at(&mesh, 500 * N_KINDS, |random| length(random, 3.0 * half) - 1.0);
        let rays: Vec<Ray> = (0..).zip(rays).map(|(i, ray)| cast(ray, if i % 4 == 0 { -1.0 } else { 0.0 })).collect();
        for traversal in tree_traversals() {
            let expected = cast_on_cpu(world.geometry(), traversal, &rays, Query::Closest);
            let mut caster = GpuCaster::new(&context, world.geometry(), traversal).expect("a caster");
            let found = caster.cast(&rays, Query::Closest, 1).expect("a cast").hits;
            compare::exact_or_hits(n_outliers(&context, rays.len()), &expected, &found).unwrap();
        }
    }
    assert_silent(&context);
}

#[test]
fn a_far_origin_is_moved_only_if_the_ray_comes_near_the_middle() {
    let world = with_ground(&small_torus().triangles, GROUNDS[0]);
    let moved = |origin: Vec3, direction: Vec3| {
        near_scene(&world.inputs(), &SearchRay::from(&ray(origin, direction.normalize()))).1
    };
    let origin = vec3(5000.0, 1.0, 0.0);
    assert!((moved(origin, Vec3::NEG_X) - 5000.0).abs() < 1.0);
    assert_eq!(moved(origin, Vec3::X), 0.0);
    assert_eq!(moved(origin, Vec3::Y), 0.0);
    assert_eq!(moved(vec3(3.0, 1.0, 2.0), vec3(-1.0, -0.1, 0.2)), 0.0);
}
