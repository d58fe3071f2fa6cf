//! Tests that slabs (pairs of planes that bound a node's triangles) spare rays steps, and change nothing else.

use std::sync::Arc;

use glam::Vec3;
use kdray::{
    accel::kdtree::{BuildOptions, Traversal},
    cpu::{self, Batching},
    frame::{Picture, Primary, RenderOptions},
    gpu::Context,
    layout::{PixelAovs, Slab},
    render::GpuRenderer,
    world::{FlatScene, World},
};

use super::studio::{assert_silent, identical, options};
use crate::support::{kept, meshes, scenes, with_lanes, world_by, world_of};

/// Returns a device whose kernels test slabs on every driver.
fn device() -> Arc<Context> {
    with_lanes(0)
}

/// Returns a scene with a mirror of many small triangles, which rays graze.
fn scene() -> FlatScene {
    let mut scene = scenes::mixed();
    scenes::add(&mut scene, meshes::torus(120, 60), scenes::mirror(Vec3::splat(0.8)));
    scene
}

fn options_of(traversal: Traversal) -> RenderOptions {
    RenderOptions { primary: Primary::Trace, pixel_aovs: true, traversal, ..options(40, 30, 3) }
}

fn steps(pixel_aovs: &[PixelAovs]) -> u64 {
    pixel_aovs.iter().map(|aovs| u64::from(aovs.n_steps)).sum()
}

/// Returns the picture and the number of steps of all its rays.
fn render(context: &Arc<Context>, world: &World, traversal: Traversal) -> (Picture, u64) {
    let mut renderer = GpuRenderer::new(context.clone(), world, &options_of(traversal)).expect("a renderer");
    let picture = renderer.render().expect("a frame").0;
    (picture, steps(&renderer.pixel_aovs().expect("pixel_aovs")))
}

fn steps_on_cpu(world: &World, traversal: Traversal) -> u64 {
    let options = options_of(traversal);
    let mut renderer = cpu::CpuRenderer::new(world, &options, Batching::default());
    renderer.draw_sample();
    steps(&renderer.pixel_aovs())
}

#[test]
fn slabs_spare_steps_and_change_no_bit() {
    if kept::leaves_out("the slabs of one tree") {
        return;
    }
    let (scene, context) = (scene(), device());
    let [with, without] = [true, false].map(|slabs| world_by(&scene, &BuildOptions { slabs, ..Default::default() }));
    assert!(without.tree().slabs().is_empty());
    // After a missed slab, each of these traversals continues in its own way: by its mask, by boxes, or by ropes.
    for traversal in [Traversal::Mask, Traversal::Backtrack, Traversal::Ropes] {
        let ((expected, all), (found, some)) =
            (render(&context, &without, traversal), render(&context, &with, traversal));
        assert!(identical(&expected, &found), "{traversal}");
        assert!(some < all * 97 / 100, "{traversal}: {some} steps of {all}");
        let on_cpu = steps_on_cpu(&with, traversal);
        assert!(some.abs_diff(on_cpu) < all / 200, "{traversal}: {some} steps, {on_cpu} on the CPU");
    }
    assert_silent(&context);
}

/// Slabs that do not enclose their triangles lose them. This shows that the kernels do test slabs.
#[test]
fn slabs_beside_their_surface_lose_it() {
    if kept::leaves_out("the slabs of one tree") {
        return;
    }
    let (scene, context) = (scene(), device());
    let world = world_of(&scene);
    let options = options_of(Traversal::Mask);
    let mut renderer = GpuRenderer::new(context.clone(), &world, &options).expect("a renderer");
    let expected = renderer.render().expect("a frame").0;
    let moved: Vec<Slab> =
        world.tree().slabs().iter().map(|slab| Slab { offset: slab.offset + 2.0, ..*slab }).collect();
    renderer.resources().accel.arrays.kd_slabs.upload(&moved).expect("slabs");
    assert!(!identical(&expected, &renderer.render().expect("a frame").0));
}
