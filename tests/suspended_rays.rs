//! Tests rays that take more loop iterations than a dispatch allows. They end in a further dispatch, with the hits of
//! rays that are never interrupted.

mod support;

use std::sync::Arc;

use glam::{Vec3, vec3};
use kdray::{
    accel::{Accel, AccelOptions, Query, grid::GridOptions, kdtree::Traversal},
    cast::{GpuCaster, Hit, NO_TRIANGLE, Ray, cast_on_cpu},
    frame::{Picture, Primary, Profile, RenderOptions},
    gpu::{Context, DeviceOverrides},
    layout::{PixelAovs, Triangle},
    render::GpuRenderer,
    world::Geometry,
};
use support::{
    MeshWithTree, assert_silent, compare, device, meshes, pretended, random::Random, rays::nasty_ray, scenes, world_of,
};

/// Opens a device that ends shaders after `loop_limit` iterations. With `n_lanes` it is a
/// GPU of that many lanes, in place of a software driver.
fn limited_device(loop_limit: u32, n_lanes: Option<u32>, n_suspension_slots: Option<usize>) -> Arc<Context> {
    pretended(DeviceOverrides {
        loop_limit: Some(loop_limit),
        n_lanes,
        n_suspension_slots,
        ..DeviceOverrides::default()
    })
}

fn cast(context: &Arc<Context>, world: &MeshWithTree, traversal: Traversal, query: Query, rays: &[Ray]) -> Vec<Hit> {
    let mut caster = GpuCaster::new(context, world.geometry(), traversal).expect("a caster");
    caster.cast(rays, query, 1).expect("a cast").hits
}

/// Returns a grid of each kind.
fn grids(triangles: &[Triangle]) -> [Accel; 2] {
    let options = [GridOptions::uniform(), GridOptions::two_level()].map(AccelOptions::Grid);
    options.map(|options| Accel::new(triangles, &options))
}

fn nasty_rays(world: &MeshWithTree, n: usize) -> Vec<Ray> {
    let some_ray = |i: usize| {
        let ray = nasty_ray(&mut Random(i as u64), world, i);
        Ray { origin: ray.origin, t_min: 0.0, direction: ray.direction, t_max: ray.t_max }
    };
    (0..n).map(some_ray).collect()
}

/// Returns a leaf of many copies of a triangle, whose last entry is a triangle slightly above them, and rays. The
/// rays come from above; those with an even index hit.
fn copies(n: usize) -> (MeshWithTree, Vec<Ray>) {
    let [below, above] = [0.0, 1e-6].map(|y| meshes::triangle(vec3(0.0, y, 0.0), vec3(1.0, y, 0.0), vec3(0.0, y, 1.0)));
    let mut triangles = vec![below; n];
    triangles.push(above);
    let ray = |i: u32| {
        let x = if i.is_multiple_of(2) { 0.2 } else { 0.7 };
        let origin = vec3(x, 1.0, 0.4 + 0.001 * i as f32);
        Ray { origin, t_min: 0.0, direction: Vec3::NEG_Y, t_max: f32::INFINITY }
    };
    (MeshWithTree::new(triangles), (0..200).map(ray).collect())
}

/// Counts the rays on `n` copies whose hits are right: the closest hit is that of the last triangle.
fn n_right(n: usize, hits: &[Hit], query: Query) -> usize {
    let is_right = |(i, hit): (usize, &Hit)| match (i.is_multiple_of(2), query) {
        (false, _) => hit.triangle_ix == NO_TRIANGLE,
        (true, Query::Closest) => hit.triangle_ix == n as u32 && hit.t < 1.0,
        (true, Query::Any) => hit.triangle_ix != NO_TRIANGLE,
    };
    hits.iter().enumerate().filter(|hit| is_right(*hit)).count()
}

#[test]
fn a_leaf_of_more_triangles_than_a_driver_takes_turns_is_searched_to_its_end() {
    const N: usize = 70_000;
    let (world, rays) = copies(N);
    let context = device();
    for &traversal in Traversal::ALL.iter().filter(|&&traversal| traversal != Traversal::Brute) {
        for query in [Query::Closest, Query::Any] {
            let hits = cast(&context, &world, traversal, query, &rays);
            assert_eq!(n_right(N, &hits, query), rays.len(), "{traversal} {query:?}");
        }
    }
    for accel in grids(&world.triangles) {
        let geometry = Geometry::new(&world.triangles, &accel).expect("a grid of these triangles");
        for query in [Query::Closest, Query::Any] {
            let mut caster = GpuCaster::new(&context, geometry, Traversal::OF_GPUS).expect("a caster");
            let hits = caster.cast(&rays, query, 1).expect("a cast").hits;
            assert_eq!(n_right(N, &hits, query), rays.len(), "{} {query:?}", accel.kind());
        }
    }
    assert_silent(&context);
    // If kernels do not count iterations, a driver with such a limit loses hits.
    if context.loop_limit().expect("a probe").is_some() {
        let careless = limited_device(u32::MAX, None, None);
        let hits = cast(&careless, &world, Traversal::Mask, Query::Closest, &rays);
        assert!(n_right(N, &hits, Query::Closest) < rays.len(), "the driver's limit is not met");
    }
}

/// Far from the origin, the tree's margin is larger than the triangles, so its leaves contain most of them.
#[test]
fn a_far_soup_of_small_triangles_is_as_on_the_cpu() {
    let world = MeshWithTree::new(meshes::placed(meshes::soup(20_000, 3), 1.0, Vec3::splat(1e7)));
    let rays = nasty_rays(&world, 280);
    let context = device();
    for traversal in [Traversal::OF_SOFTWARE_DRIVERS, Traversal::OF_GPUS] {
        let expected = cast_on_cpu(world.geometry(), traversal, &rays, Query::Closest);
        let hits = cast(&context, &world, traversal, Query::Closest, &rays);
        if context.is_software() {
            compare::exact(&expected, &hits).unwrap();
        } else {
            compare::hits(rays.len() / 100, &expected, &hits).unwrap();
        }
    }
    assert_silent(&context);
}

/// The hits do not depend on the iteration budget, the number of slots or the kind of search.
#[test]
fn interrupted_casts_find_the_same() {
    let world = MeshWithTree::new([meshes::soup(500, 1), meshes::torus(20, 10)].concat());
    let rays = nasty_rays(&world, 300);
    for n_lanes in [None, Some(1000)] {
        let plain = pretended(DeviceOverrides { n_lanes, ..DeviceOverrides::default() });
        let limited =
            [(1000, Some(100)), (5000, None)].map(|(iterations, n_slots)| limited_device(iterations, n_lanes, n_slots));
        for &traversal in Traversal::ALL {
            for query in [Query::Closest, Query::Any] {
                let expected = cast(&plain, &world, traversal, query, &rays);
                for context in &limited {
                    let found = cast(context, &world, traversal, query, &rays);
                    compare::exact(&expected, &found).unwrap_or_else(|e| panic!("{traversal} {query:?}: {e}"));
                }
            }
        }
        limited.iter().for_each(|context| assert_silent(context));
    }
}

#[test]
fn interrupted_casts_through_grids_find_the_same() {
    let world = MeshWithTree::new([meshes::soup(500, 1), meshes::torus(20, 10)].concat());
    let rays = nasty_rays(&world, 300);
    for accel in grids(&world.triangles) {
        let geometry = Geometry::new(&world.triangles, &accel).expect("a grid of these triangles");
        let cast = |context: &Arc<Context>, query| {
            let mut caster = GpuCaster::new(context, geometry, Traversal::OF_GPUS).expect("a caster");
            caster.cast(&rays, query, 1).expect("a cast").hits
        };
        for n_lanes in [None, Some(1000)] {
            let plain = pretended(DeviceOverrides { n_lanes, ..DeviceOverrides::default() });
            for (iterations, n_slots) in [(1000, Some(100)), (1000, None), (5000, None)] {
                let limited = limited_device(iterations, n_lanes, n_slots);
                for query in [Query::Closest, Query::Any] {
                    compare::exact(&cast(&plain, query), &cast(&limited, query))
                        .unwrap_or_else(|e| panic!("{} {query:?}: {e}", accel.kind()));
                }
                assert_silent(&limited);
            }
        }
    }
}

fn options(traversal: Traversal, primary: Primary) -> RenderOptions {
    RenderOptions {
        width: 28,
        height: 21,
        max_depth: 4,
        traversal,
        primary,
        pixel_aovs: true,
        ..RenderOptions::default()
    }
}

/// Draws a picture. Returns it with what its rays cost.
fn draw(context: &Arc<Context>, options: &RenderOptions) -> (Picture, Vec<PixelAovs>, Profile) {
    let scene = scenes::mixed();
    let world = world_of(&scene);
    let mut renderer = GpuRenderer::new(context.clone(), &world, options).expect("a renderer");
    let (picture, profile) = renderer.render().expect("a frame");
    let pixel_aovs = renderer.pixel_aovs().expect("pixel_aovs");
    (picture, pixel_aovs, profile)
}

#[test]
fn interrupted_frames_are_the_same() {
    let plain = device();
    for (traversal, primary) in [
        (Traversal::Ropes, Primary::Trace),
        (Traversal::Mask, Primary::Raster),
        (Traversal::ShortStack, Primary::Trace),
        (Traversal::Restart, Primary::Raster),
    ] {
        let options = options(traversal, primary);
        let (picture, pixel_aovs, profile) = draw(&plain, &options);
        for (loop_limit, n_slots) in [(400, Some(64)), (2000, None)] {
            let limited = limited_device(loop_limit, None, n_slots);
            let (found, found_aovs, found_profile) = draw(&limited, &options);
            assert!(picture == found, "{traversal} {primary}, {loop_limit} iterations");
            compare::exact(&pixel_aovs, &found_aovs).unwrap();
            assert_eq!(profile.bounces, found_profile.bounces, "{traversal} {primary}, {loop_limit} iterations");
            assert_silent(&limited);
        }
    }
    assert_silent(&plain);
}
