//! Tests that pictures have the same bits in every run, in batches of any size, on any number of threads.

use glam::Vec3;
use kdray::{
    cpu::{self, Batching},
    gpu::GpuError,
    render::GpuRenderer,
    world::FlatScene,
};

use super::studio::{assert_silent, device, identical, options, world_of};
use crate::support::scenes;

/// Returns a scene of glass in glass without dark places, in which the number of rays doubles at each surface.
pub fn glass_in_glass() -> FlatScene {
    let mut scene = scenes::empty();
    scenes::add(&mut scene, scenes::smooth_sphere(6, 1.4, Vec3::ZERO), scenes::glass(1.5));
    scenes::add(&mut scene, scenes::smooth_sphere(5, 0.9, Vec3::ZERO), scenes::glass(1.2));
    scenes::add(&mut scene, scenes::smooth_sphere(4, 0.4, Vec3::ZERO), scenes::emissive(Vec3::new(0.9, 0.5, 0.1)));
    scenes::add(&mut scene, scenes::room(5.0), scenes::diffuse(Vec3::splat(0.6)));
    scene.lights = vec![scenes::point_light(Vec3::new(2.0, 3.0, 3.0), Vec3::splat(20.0))];
    scene.ambient = Vec3::splat(0.3);
    scene
}

#[test]
fn small_queues_give_the_same_bits_on_the_device() {
    let (scene, options, context) = (glass_in_glass(), options(32, 24, 8), device());
    let world = world_of(&scene);
    let render = |capacity| {
        let renderer = GpuRenderer::with_queue_capacity(context.clone(), &world, &options, capacity);
        renderer.expect("a renderer").render().expect("a frame")
    };
    let (whole, profile) = render(100_000);
    assert_eq!(profile.n_batches, 1);
    for capacity in [2000, 600, 257] {
        let (picture, profile) = render(capacity);
        assert!(profile.n_batches > 1, "{capacity} rays");
        assert!(identical(&whole, &picture), "queues for {capacity} rays");
    }
    assert_silent(&context);
}

#[test]
fn small_queues_give_the_same_bits_on_the_cpu() {
    let (scene, options) = (glass_in_glass(), options(32, 24, 8));
    let world = world_of(&scene);
    let (whole, one) = cpu::render(&world, &options);
    assert_eq!(one.n_batches, 1);
    for batching in [
        Batching { n_pixels: 100, ..Batching::default() },
        Batching { n_pixels: 1 << 16, queue_capacity: 300 },
        Batching { n_pixels: 768, queue_capacity: 1 },
    ] {
        let (picture, profile) = cpu::render_in_batches(&world, &options, batching);
        assert!(profile.n_batches > 1);
        assert!(identical(&whole, &picture), "{batching:?}");
        assert_eq!(profile.bounces, one.bounces, "{batching:?}");
    }
}

#[test]
fn a_pixel_that_overflows_alone_is_an_error() {
    let (scene, context) = (glass_in_glass(), device());
    let mut renderer =
        GpuRenderer::with_queue_capacity(context, &world_of(&scene), &options(8, 8, 8), 2).expect("a renderer");
    match renderer.render() {
        Err(GpuError::Limit { limit: 2, value, .. }) => assert!(value > 2),
        other => panic!("{:?}", other.map(|(_, profile)| profile)),
    }
}

#[test]
fn every_run_gives_the_same_bits() {
    let (scene, options) = (scenes::mixed_outdoors(), options(64, 48, 5));
    let world = world_of(&scene);
    let context = device();
    let mut first = GpuRenderer::new(context.clone(), &world, &options).expect("a renderer");
    let mut second = GpuRenderer::new(device(), &world, &options).expect("a renderer");
    let picture = first.render().expect("a frame").0;
    for again in [first.render(), second.render(), first.render()] {
        assert!(identical(&picture, &again.expect("a frame").0));
    }
    assert_silent(&context);
}

#[test]
fn every_number_of_threads_gives_the_same_bits() {
    let (scene, options) = (scenes::mixed_outdoors(), options(64, 48, 5));
    let world = world_of(&scene);
    let on_threads = |n| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("a pool");
        pool.install(|| cpu::render(&world, &options).0)
    };
    let picture = on_threads(1);
    assert!([2, 3, 8].into_iter().all(|n| identical(&picture, &on_threads(n))));
}

#[test]
fn device_and_cpu_count_alike() {
    let (mut scene, options) = (scenes::mixed(), options(40, 30, 4));
    // With blended surfaces, the device goes through bounces without rays.
    scene.materials.iter_mut().for_each(|material| material.d = 1.0);
    let world = world_of(&scene);
    let context = device();
    let (_, device) =
        GpuRenderer::new(context.clone(), &world, &options).expect("a renderer").render().expect("a frame");
    let (_, cpu) = cpu::render(&world, &options);
    assert_eq!(device.bounces.len(), cpu.bounces.len());
    for (a, b) in device.bounces.iter().zip(&cpu.bounces) {
        let near = |a: u64, b: u64| a.abs_diff(b) <= b / 50;
        assert!(near(a.n_rays, b.n_rays) && near(a.n_hits, b.n_hits) && near(a.n_shadow_rays, b.n_shadow_rays));
    }
    assert_eq!((device.bounces[0].n_rays, cpu.bounces[0].n_rays), (1200, 1200));
    let names = |profile: &kdray::frame::Profile| -> Vec<_> {
        profile.passes.iter().map(|pass| (pass.name, pass.bounce)).filter(|pass| pass.0 != "denoise").collect()
    };
    assert_eq!(names(&device), names(&cpu));
    assert_silent(&context);
}
