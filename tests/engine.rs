//! Tests what the engine draws and casts with its own choices, on a device and on the CPU.

mod support;

use kdray::{
    accel::{
        Query,
        kdtree::{BuildOptions, Traversal},
    },
    cast::{CpuCaster, NO_TRIANGLE, Ray},
    engine::{Built, Engine, choices::Workload},
    frame::RenderOptions,
    gpu::ContextOptions,
};
use support::scenes;

#[test]
fn an_engine_renders_and_casts_alike_on_device_and_cpu() {
    let scene = scenes::mixed();
    let options = RenderOptions { width: 40, height: 30, max_depth: 3, ..RenderOptions::default() };
    let device = Engine::open(&ContextOptions::new(None, true)).expect("a device with validation");
    let engines = [device.clone(), Engine::on_cpu()];
    let rendered = engines.map(|engine| {
        let workload = Workload::of_pictures(&options, scene.lights.len(), 1);
        let Built { world, .. } = engine.build_flat(scene.clone(), &workload).expect("a world");
        let picture = engine.render(&world, &options).expect("a picture").picture;
        let eye = scene.camera.eye;
        let ray = |i: u32| Ray {
            origin: eye,
            t_min: 0.0,
            direction: scene.camera.target - eye + 0.01 * glam::Vec3::splat(i as f32),
            t_max: f32::INFINITY,
        };
        let rays: Vec<_> = (0..50).map(ray).collect();
        let hits = engine.cast(&world, &rays, Query::Closest).expect("hits");
        assert_eq!(hits.len(), rays.len());
        (picture, hits)
    });
    let [(on_device, device_hits), (on_cpu, cpu_hits)] = rendered;
    let differing = on_device.display.iter().zip(&on_cpu.display).filter(|(a, b)| a != b).count();
    assert!(differing < 40 * 30 / 20, "{differing} pixels differ");
    assert!(on_device.display.iter().any(|pixel| pixel != &on_device.display[0]), "the picture shows something");
    assert!(device_hits.iter().zip(&cpu_hits).all(|(a, b)| a.triangle_ix == b.triangle_ix));
    assert!(cpu_hits.iter().any(|hit| hit.triangle_ix != NO_TRIANGLE));
    let device = device.device().expect("a device");
    assert_eq!(device.validation_messages(), Vec::<String>::new());
}

/// The engine's choice of tree changes no hit.
#[test]
fn trees_of_either_kind_give_the_same_hits() {
    let scene = scenes::mixed();
    let ray = Ray {
        origin: scene.camera.eye,
        t_min: 0.0,
        direction: scene.camera.target - scene.camera.eye,
        t_max: f32::INFINITY,
    };
    let hits = [BuildOptions::fast(), BuildOptions::default()].map(|options| {
        let world = support::world_by(&scene, &options);
        CpuCaster::new(world.geometry(), Traversal::Stack).cast(&[ray], Query::Closest)
    });
    assert_eq!(hits[0], hits[1]);
}
