//! Tests that the search through a grid finds the hits of a test of every triangle, for rays on which traversals may
//! fail.

use crate::support::{
    MeshWithTree,
    compare::first_difference,
    meshes,
    random::Random,
    rays::{nasty_ray, outward_ray, ray},
};
use glam::{Vec3, vec3};
use kdray::{
    accel::grid::{Grid, GridOptions},
    layout::{Hit, NO_TRIANGLE, PathRay, Triangle},
    reference::{
        grid::search_grid,
        inputs::KernelInputs,
        search_ray::SearchRay,
        traversal_ray::{TraversalRay, hit_from_near},
    },
};
use rayon::prelude::*;

const N_RAYS: usize = 100_000;

/// Returns the options of both kinds of grids, each with its name.
fn kinds() -> [(&'static str, GridOptions); 2] {
    [("uniform", GridOptions::uniform()), ("two levels", GridOptions::two_level())]
}

fn traced<const ANY_HIT: bool>(inputs: &KernelInputs, rays: &[PathRay]) -> Vec<Hit> {
    let hit = |ray: &PathRay| {
        hit_from_near(inputs, &ray.into(), |near: &SearchRay, best| {
            search_grid::<ANY_HIT>(inputs, &TraversalRay::new(inputs, near), best);
        })
    };
    rays.par_iter().map(hit).collect()
}

/// Returns a ray that starts in one to three planes between cells. Most of these rays also lie in the plane, or in
/// the line where two planes meet, or almost do so.
fn ray_in_planes(random: &mut Random, grid: &Grid) -> PathRay {
    let lattice = grid.lattice();
    let [least, greatest] = grid.bounds();
    let mut origin = random.in_box(least, greatest);
    let mut direction = random.direction();
    let n_planes = 1 + random.below(3);
    for axis in 0..n_planes {
        let plane_ix = random.below(lattice.n_cells[axis] as usize + 1) as u32;
        origin[axis] = lattice.plane(axis, plane_ix);
        match random.below(4) {
            0 => direction[axis] *= 1e-6,
            1 if n_planes == 3 => (),
            _ => direction[axis] = 0.0,
        }
    }
    if direction.length_squared() < 1e-9 {
        direction = Vec3::X;
    }
    ray(origin, direction.normalize())
}

fn rays_at(world: &MeshWithTree, grid: &Grid) -> Vec<PathRay> {
    let ray = |i: usize| {
        let random = &mut Random(i as u64);
        if i.is_multiple_of(4) { ray_in_planes(random, grid) } else { nasty_ray(random, world, i) }
    };
    (0..N_RAYS).into_par_iter().map(ray).collect()
}

fn check_against_brute_force(name: &str, triangles: Vec<Triangle>) {
    let world = MeshWithTree::new(triangles);
    for (kind, options) in kinds() {
        let grid = Grid::build(&world.triangles, &options);
        let rays = rays_at(&world, &grid);
        let expected: Vec<Hit> = rays.par_iter().map(|ray| world.by_brute_force(ray, 0.0)).collect();
        let n_hits = expected.iter().filter(|hit| hit.triangle_ix != NO_TRIANGLE).count();
        assert!(n_hits > N_RAYS / 8, "{name}: only {n_hits} rays hit anything");
        let inputs = KernelInputs::of_grid(&world.triangles, &grid);
        assert_eq!(first_difference(&rays, &expected, &traced::<false>(&inputs, &rays)), None, "{name}, {kind}");
        let is_hit = |hit: &Hit| hit.triangle_ix != NO_TRIANGLE;
        let any = traced::<true>(&inputs, &rays);
        assert!(any.iter().map(is_hit).eq(expected.iter().map(is_hit)), "{name}, {kind}: any hit");
    }
}

#[test]
fn finds_what_brute_force_finds() {
    check_against_brute_force("torus", meshes::torus(40, 20));
    check_against_brute_force("cube", meshes::cube(9, 0.0));
    check_against_brute_force("sphere", meshes::cube(10, 1.0));
    check_against_brute_force("threefold", meshes::threefold(meshes::torus(20, 10)));
    check_against_brute_force("soup", meshes::soup(1200, 7));
    check_against_brute_force("tiny", meshes::placed(meshes::torus(40, 20), 1e-6, Vec3::ZERO));
    check_against_brute_force("huge", meshes::placed(meshes::torus(40, 20), 1e6, Vec3::ZERO));
    check_against_brute_force("far", meshes::placed(meshes::torus(40, 20), 0.3, vec3(1000.0, -70.0, 3.0)));
    check_against_brute_force("farther", meshes::placed(meshes::torus(40, 20), 10.0, vec3(1e5, -1e5, 3.0)));
    check_against_brute_force("one", vec![meshes::triangle(Vec3::X, Vec3::Y, Vec3::Z)]);
}

#[test]
fn rays_from_inside_never_leak() {
    for (name, triangles) in [("sphere", meshes::cube(20, 1.0)), ("cube", meshes::cube(20, 0.0))] {
        for (kind, options) in kinds() {
            let grid = Grid::build(&triangles, &options);
            let rays: Vec<PathRay> = (0..300_000).map(|i| outward_ray(&mut Random(i), &triangles)).collect();
            let hits = traced::<false>(&KernelInputs::of_grid(&triangles, &grid), &rays);
            let n_leaks = hits.iter().filter(|hit| hit.triangle_ix == NO_TRIANGLE).count();
            assert_eq!(n_leaks, 0, "{name}, {kind}");
        }
    }
}

#[test]
fn a_triangle_that_no_cell_has_is_noticed() {
    let world = MeshWithTree::new(meshes::torus(20, 10));
    // Grids do not contain triangles that are not finite.
    let mut without = world.triangles.clone();
    without[11].v0 = Vec3::NAN;
    for (kind, options) in kinds() {
        let [whole, holed] = [&world.triangles, &without].map(|triangles| Grid::build(triangles, &options));
        let rays = rays_at(&world, &whole);
        let [expected, found] =
            [&whole, &holed].map(|grid| traced::<false>(&KernelInputs::of_grid(&world.triangles, grid), &rays));
        assert!(first_difference(&rays, &expected, &found).is_some(), "{kind}");
    }
}

#[test]
fn limits_of_memory_make_cells_larger() {
    // Each of these long triangles is in a large number of cells.
    let lengthened = |triangle: Triangle| Triangle { v1: triangle.v0 + 30.0 * (triangle.v1 - triangle.v0), ..triangle };
    let triangles: Vec<Triangle> = meshes::soup(3000, 5).into_iter().map(lengthened).collect();
    for (kind, options) in kinds() {
        let limited = GridOptions { max_references_per_triangle: 3, ..options.clone() };
        let statistics = Grid::build(&triangles, &limited).statistics();
        assert!(statistics.n_coarser > 0, "{kind}: {statistics:?}");
        assert!(statistics.n_references <= 3 * 3000 + 1024, "{kind}: {statistics:?}");
        let free = GridOptions { max_references_per_triangle: 10_000, ..options };
        assert_eq!(Grid::build(&triangles, &free).statistics().n_coarser, 0, "{kind}");
    }
}

#[test]
fn nothing_is_hit_in_an_empty_world() {
    for (kind, options) in kinds() {
        let grid = Grid::build(&[], &options);
        let rays = [ray(Vec3::ZERO, Vec3::X), ray(Vec3::ONE, Vec3::NEG_ONE.normalize())];
        let hits = traced::<false>(&KernelInputs::of_grid(&[], &grid), &rays);
        assert!(hits.iter().all(|hit| hit.triangle_ix == NO_TRIANGLE && hit.t == f32::INFINITY), "{kind}");
    }
}
