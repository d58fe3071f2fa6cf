//! Tests that frames traced through grids are the kd-tree's frames, bit for bit: hits do not depend on the
//! acceleration structure.

use kdray::{
    accel::kdtree::Traversal,
    buffers::SceneAccess,
    cpu,
    frame::{Picture, Primary, RenderOptions},
    layout::PixelAovs,
    render::GpuRenderer,
    scene::Camera,
    world::World,
};

use super::{
    large::{RANGE, device_with, large_world},
    studio::{assert_silent, device, identical, options},
};
use crate::support::{grid_worlds, scenes, world_of};

/// Renders a frame. Returns it and its AOVs, whose costs are set to 0.
fn on_device(world: &World, options: &RenderOptions) -> (Picture, Vec<PixelAovs>) {
    let context = device();
    let options = RenderOptions { pixel_aovs: true, ..options.clone() };
    let mut renderer = GpuRenderer::new(context.clone(), world, &options).expect("a renderer");
    let picture = renderer.render().expect("a frame").0;
    let pixel_aovs = renderer.pixel_aovs().expect("pixel_aovs").into_iter();
    assert_silent(&context);
    (picture, pixel_aovs.map(|aovs| PixelAovs { n_steps: 0, ..aovs }).collect())
}

#[test]
fn frames_on_the_device_are_the_kd_trees() {
    for (scene, primary) in [(scenes::mixed(), Primary::Raster), (scenes::mixed_outdoors(), Primary::Trace)] {
        let options = RenderOptions { primary, ..options(80, 60, 5) };
        let expected = on_device(&world_of(&scene), &options);
        for world in grid_worlds(&scene) {
            let found = on_device(&world, &options);
            assert!(identical(&expected.0, &found.0), "{} {primary}", world.accel().kind());
            assert!(expected.1 == found.1, "{} {primary}: pixel_aovs", world.accel().kind());
        }
    }
}

/// A grid is read as texels where the device has enough of them, as bound storage, or by address.
#[test]
fn all_ways_to_read_a_grid_give_the_same_bits() {
    let options = RenderOptions { primary: Primary::Trace, ..options(24, 16, 3) };
    let contexts = [(u64::MAX, 1), (RANGE, 1)].map(|(bytes, n_texels)| device_with(bytes, n_texels));
    for world in grid_worlds(large_world().scene()) {
        let expected = on_device(&world, &options).0;
        for (context, access) in contexts.iter().zip([SceneAccess::Bound, SceneAccess::Address]) {
            let mut renderer = GpuRenderer::new(context.clone(), &world, &options).expect("a renderer");
            assert_eq!(renderer.resources().accel.access(), access);
            let found = renderer.render().expect("a frame").0;
            assert!(identical(&expected, &found), "{} {access:?}", world.accel().kind());
        }
    }
    contexts.iter().for_each(|context| assert_silent(context));
}

#[test]
fn frames_on_the_cpu_are_the_kd_trees() {
    let (scene, options) = (scenes::mixed_outdoors(), options(80, 60, 5));
    let options = RenderOptions { primary: Primary::Trace, ..options };
    let expected = cpu::render(&world_of(&scene), &RenderOptions { traversal: Traversal::OF_CPU, ..options.clone() }).0;
    for world in grid_worlds(&scene) {
        let found = cpu::render(&world, &options).0;
        assert!(identical(&expected, &found), "{}", world.accel().kind());
    }
}

#[test]
fn a_moved_camera_is_noticed() {
    let (scene, options) = (scenes::mixed(), options(40, 30, 2));
    let expected = on_device(&world_of(&scene), &options).0;
    let camera = Camera { eye: scene.camera.eye * 1.001, ..scene.camera };
    let [moved, _] = grid_worlds(&kdray::world::FlatScene { camera, ..scene });
    assert!(!identical(&expected, &on_device(&moved, &options).0));
}
