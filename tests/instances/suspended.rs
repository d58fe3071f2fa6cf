//! Rays that take more loop iterations than a dispatch allows. They go on in the instance that they were in, or between
//! two, and find what rays find that are never interrupted.

use std::sync::Arc;

use kdray::{
    accel::{Query, kdtree::Traversal},
    cast::{GpuCaster, Hit, Ray},
    frame::{Integrator, Primary, RenderOptions},
    gpu::{Context, DeviceOverrides},
    world::World,
};

use super::{
    grids::{rays, scene, worlds_of_grids},
    kept,
    pictures::{on_device, options, scene_of_lamps},
};
use crate::support::{assert_silent, compare, pretended};

/// A device without a limit, and one of a few iterations a dispatch and room for some of the rays. `n_lanes`: a driver
/// with a search of its own if none.
fn devices(n_lanes: Option<u32>) -> [Arc<Context>; 2] {
    let plain = DeviceOverrides { n_lanes, ..DeviceOverrides::default() };
    let limited = DeviceOverrides { loop_limit: Some(3000), n_suspension_slots: Some(100), ..plain };
    [plain, limited].map(pretended)
}

/// Asserts that both kinds of casts find the same, whether they are interrupted or not.
fn assert_same(world: &World, traversal: Traversal, rays: &[Ray], devices: &[Arc<Context>; 2]) {
    for query in [Query::Closest, Query::Any] {
        let [expected, found] = devices.each_ref().map(|context| -> Vec<Hit> {
            let mut caster = GpuCaster::new(context, world.geometry(), traversal).expect("a caster");
            caster.cast(rays, query, 1).expect("hits").hits
        });
        let what = |what| panic!("{traversal} in {}, {query:?}: {what}", world.accel().kind());
        compare::exact(&expected, &found).unwrap_or_else(what);
    }
    assert_silent(&devices[1]);
}

#[test]
fn interrupted_casts_find_the_same_by_every_traversal() {
    let (world, rays) = (kept(&scene()), &rays()[2700..]);
    for n_lanes in [None, Some(32)] {
        let devices = devices(n_lanes);
        Traversal::ALL.iter().for_each(|traversal| assert_same(&world, *traversal, rays, &devices));
    }
}

#[test]
fn interrupted_casts_find_the_same_in_grids() {
    let (worlds, rays) = (worlds_of_grids(&scene()), &rays()[2700..]);
    for n_lanes in [None, Some(32)] {
        let devices = devices(n_lanes);
        worlds.iter().for_each(|world| assert_same(world, Traversal::OF_GPUS, rays, &devices));
    }
}

#[test]
fn interrupted_frames_are_the_same() {
    let scene = scene_of_lamps();
    let devices = devices(None);
    for world in [kept(&scene), worlds_of_grids(&scene)[1].clone()] {
        for integrator in [Integrator::Whitted, Integrator::Path] {
            let options = RenderOptions { width: 48, height: 36, integrator, primary: Primary::Trace, ..options() };
            let [expected, found] = devices.each_ref().map(|context| on_device(context, &world, &options));
            assert!(expected.radiance == found.radiance, "{integrator}, {}", world.accel().kind());
        }
    }
}
