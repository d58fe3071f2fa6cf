//! Tests that frames and casts through kd-trees that the device builds are those through the host's trees, bit for bit:
//! hits do not depend on the tree.

use std::sync::Arc;

use kdray::{
    accel::{AccelOptions, Statistics, kdtree::Traversal},
    buffers::SceneAccess,
    engine::choices::{Processor, TreeKind},
    frame::{Integrator, Picture, Primary, RenderOptions},
    gpu::Context,
    render::GpuRenderer,
    scene::Camera,
    world::{FlatScene, World},
};

use super::{
    large::{RANGE, device_with, large_world},
    studio::{assert_silent, device, identical, options},
};
use crate::support::{scenes, world_of};

/// Returns the scene with a tree that devices build.
fn lazy_world(scene: &FlatScene) -> World {
    let options = TreeKind::Gpu.options(Processor::Gpu);
    World::with_accel(scene.clone(), &AccelOptions::LazyTree(options)).expect("a material for each triangle")
}

fn drawn(context: &Arc<Context>, world: &World, options: &RenderOptions) -> Picture {
    let mut renderer = GpuRenderer::new(context.clone(), world, options).expect("a renderer");
    renderer.render().expect("a frame").0
}

#[test]
fn frames_are_those_of_the_best_tree() {
    let (context, scene) = (device(), scenes::mixed_outdoors());
    let (best, lazy) = (world_of(&scene), lazy_world(&scene));
    for (integrator, traversal) in [
        (Integrator::Whitted, Traversal::Mask),
        (Integrator::Whitted, Traversal::Ropes),
        (Integrator::Whitted, Traversal::MaskBoxes),
        (Integrator::Path, Traversal::Mask),
    ] {
        let options = RenderOptions { integrator, traversal, primary: Primary::Trace, ..options(60, 40, 4) };
        let [expected, found] = [&best, &lazy].map(|world| drawn(&context, world, &options));
        assert!(identical(&expected, &found), "{integrator} by {traversal}");
        let camera = Camera { eye: scene.camera.eye * 1.001, ..scene.camera };
        let moved = lazy_world(&FlatScene { camera, ..scene.clone() });
        assert!(!identical(&expected, &drawn(&context, &moved, &options)), "a moved camera is noticed");
    }
    assert_silent(&context);
}

#[test]
fn a_device_reports_its_tree() {
    let (context, scene) = (device(), scenes::mixed());
    let lazy = lazy_world(&scene);
    assert_eq!(lazy.device_build(), None);
    drawn(&context, &lazy, &options(8, 6, 1));
    let report = lazy.device_build().expect("a report");
    assert!(report.ms.is_none_or(|ms| ms > 0.0) && report.stages.iter().any(|stage| stage.name == "kdtree_leaves"));
    let (Statistics::KdTree(known), Statistics::KdTree(best)) = (lazy.statistics(), world_of(&scene).statistics())
    else {
        panic!("both are kd-trees")
    };
    assert!(known.n_references.abs_diff(best.n_references) * 5 < best.n_references, "{known:?}, {best:?}");
    assert_eq!(known.sah_cost, None);
    assert_eq!(lazy.tree().validate(&lazy.scene().triangles), Ok(()), "the host's own tree");
    assert_silent(&context);
}

#[test]
fn without_room_the_host_builds_the_tree() {
    let options = RenderOptions { primary: Primary::Trace, ..options(24, 16, 3) };
    let world = large_world();
    let expected = drawn(&device(), &world, &options);
    let narrow = device_with(RANGE, 1);
    let lazy = lazy_world(world.scene());
    let mut renderer = GpuRenderer::new(narrow.clone(), &lazy, &options).expect("a renderer");
    assert_eq!(renderer.resources().accel.access(), SceneAccess::Address);
    assert_eq!(lazy.device_build(), None);
    assert!(identical(&expected, &renderer.render().expect("a frame").0));
    assert_silent(&narrow);
}

/// Trees are read as texels where the device has enough of them, else as bound storage.
#[test]
fn a_bound_tree_gives_the_same_bits() {
    let scene = scenes::mixed_outdoors();
    let options = RenderOptions { primary: Primary::Trace, ..options(24, 16, 3) };
    let expected = drawn(&device(), &world_of(&scene), &options);
    let context = device_with(u64::MAX, 1);
    let lazy = lazy_world(&scene);
    let mut renderer = GpuRenderer::new(context.clone(), &lazy, &options).expect("a renderer");
    assert_eq!(renderer.resources().accel.access(), SceneAccess::Bound);
    assert!(lazy.device_build().is_some());
    assert!(identical(&expected, &renderer.render().expect("a frame").0));
    assert_silent(&context);
}
