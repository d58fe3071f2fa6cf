//! What rays through instances cost: the nodes and triangles that they read.

use kdray::{
    accel::kdtree::Traversal,
    cpu::{Batching, CpuRenderer},
    frame::{Primary, RenderOptions},
    render::GpuRenderer,
};

use super::{
    kept,
    pictures::{options, scene},
};
use crate::support::{assert_silent, device};

/// There are no shadow rays, which a kernel ends at their first hit.
#[test]
fn brute_force_counts_the_triangles_of_the_instances_that_a_ray_comes_to() {
    let mut scene = scene();
    scene.lights.clear();
    let (world, context) = (kept(&scene), device());
    let options = RenderOptions {
        traversal: Traversal::Brute,
        primary: Primary::Trace,
        pixel_aovs: true,
        max_depth: 1,
        ..options()
    };
    let mut renderer = GpuRenderer::new(context.clone(), &world, &options).expect("a renderer");
    renderer.draw().expect("a frame");
    let on_device = renderer.pixel_aovs().expect("AOVs");
    let mut renderer = CpuRenderer::new(&world, &options, Batching::default());
    renderer.draw_sample();
    let on_cpu = renderer.pixel_aovs();
    let n_differing = on_device.iter().zip(&on_cpu).filter(|(a, b)| a.n_steps != b.n_steps).count();
    let [of_device, of_cpu] =
        [&on_device, &on_cpu].map(|all| all.iter().map(|aovs| u64::from(aovs.n_steps)).sum::<u64>());
    assert!(n_differing <= on_cpu.len() / 100, "{n_differing} pixels differ, {of_device} and {of_cpu} steps");
    assert!(of_device > 20 * on_cpu.len() as u64, "{of_device} steps");
    assert_silent(&context);
}
