//! Meshes of very different sizes side by side. The rounding of a far origin is larger than the small meshes, so two
//! methods agree on hits only if both move such an origin to the same place. All methods do, bit for bit.

use crate::support::{
    MeshWithTree, assert_silent, compare, device, meshes, n_outliers,
    random::Random,
    rays::{N_KINDS, nasty_ray},
};
use glam::{Vec3, vec3};
use kdray::{
    accel::{Accel, AccelOptions, Query, grid::GridOptions, kdtree::Traversal},
    cast::{GpuCaster, Ray, cast_on_cpu},
    layout::{Hit, NO_TRIANGLE, Triangle},
    world::Geometry,
};

const N_RAYS: usize = 1000 * N_KINDS;

/// A torus of 1 mm above a triangle of 200,000 km.
fn speck_and_huge_triangle() -> Vec<Triangle> {
    let speck = meshes::placed(meshes::torus(40, 20), 3.5e-4, vec3(2e-4, 1e-4, 0.0));
    let [a, b, c] = [(-1e8, -1e8), (0.0, 1e8), (1e8, -1e8)].map(|(x, z)| vec3(x, -2e-4, z));
    [speck, vec![meshes::triangle(a, b, c)]].concat()
}

/// Tori of 2.8 mm to 2.8 km in a row, each ten times as large as the one before.
fn six_decades() -> Vec<Triangle> {
    let sizes = (-3..=3).map(|exponent| 10_f32.powi(exponent));
    sizes.flat_map(|size| meshes::placed(meshes::torus(24, 12), size, 3.0 * size * Vec3::X)).collect()
}

/// Returns nasty rays, most of them at small triangles, from origins at all distances up to the largest mesh's size.
fn rays_at(world: &MeshWithTree) -> Vec<Ray> {
    let ray = |ix: usize| {
        let mut random = Random(ix as u64);
        let ray = nasty_ray(&mut random, world, ix);
        let back = if ix.is_multiple_of(4) { 0.0 } else { world.radius() * 2_f32.powf(random.between(-30.0, 2.0)) };
        let t_min = if ix.is_multiple_of(8) { -1.0 } else { 0.0 };
        Ray { origin: ray.origin - back * ray.direction, t_min, direction: ray.direction, t_max: ray.t_max + back }
    };
    (0..N_RAYS).map(ray).collect()
}

/// A search through a structure, and its name.
struct Method {
    name: String,
    accel: Accel,
    traversal: Traversal,
}

/// Returns brute force, which is the first, and all searches through trees and grids.
fn methods(world: &MeshWithTree) -> Vec<Method> {
    let mut traversals: Vec<Traversal> = Traversal::ALL.to_vec();
    traversals.sort_by_key(|&traversal| traversal != Traversal::Brute);
    let of_tree = |traversal: Traversal| Method { name: traversal.to_string(), accel: world.accel.clone(), traversal };
    let of_grid = |options| {
        let accel = Accel::new(&world.triangles, &AccelOptions::Grid(options));
        Method { name: accel.kind().name().to_owned(), accel, traversal: Traversal::OF_GPUS }
    };
    let grids = [GridOptions::uniform(), GridOptions::two_level()].map(of_grid);
    traversals.into_iter().map(of_tree).chain(grids).collect()
}

/// Asserts that `cast` finds the same hits by all methods.
fn assert_alike(world: &MeshWithTree, cast: impl Fn(Geometry, Traversal, Query) -> Vec<Hit>) -> Vec<Hit> {
    let methods = methods(world);
    let hits_of = |method: &Method, query| {
        let geometry = Geometry::new(&world.triangles, &method.accel).expect("a structure of these triangles");
        cast(geometry, method.traversal, query)
    };
    let is_hit = |hit: &Hit| hit.triangle_ix != NO_TRIANGLE;
    let expected = hits_of(&methods[0], Query::Closest);
    let n_hits = expected.iter().filter(|hit| is_hit(hit)).count();
    assert!(n_hits > N_RAYS / 8, "only {n_hits} rays hit anything");
    for method in &methods {
        let found = hits_of(method, Query::Closest);
        compare::exact(&expected, &found).unwrap_or_else(|difference| panic!("{}: {difference}", method.name));
        let any = hits_of(method, Query::Any);
        assert!(any.iter().map(is_hit).eq(expected.iter().map(is_hit)), "{}: any hit", method.name);
    }
    expected
}

fn check(triangles: Vec<Triangle>) {
    let world = MeshWithTree::new(triangles);
    let rays = rays_at(&world);
    let reach = world.accel.origin_reach();
    let n_far = rays.iter().filter(|ray| ray.origin.abs().max_element() > reach).count();
    assert!(n_far > N_RAYS / 8, "only {n_far} rays begin beyond {reach}");
    let on_cpu = assert_alike(&world, |geometry, traversal, query| cast_on_cpu(geometry, traversal, &rays, query));
    let context = device();
    let on_device = assert_alike(&world, |geometry, traversal, query| {
        let mut caster = GpuCaster::new(&context, geometry, traversal).expect("a caster");
        caster.cast(&rays, query, 1).expect("a cast").hits
    });
    compare::exact_or_hits(n_outliers(&context, rays.len()), &on_cpu, &on_device).unwrap();
    assert_silent(&context);
}

#[test]
fn a_speck_on_a_huge_triangle() {
    check(speck_and_huge_triangle());
}

#[test]
fn sizes_of_six_decades() {
    check(six_decades());
}
