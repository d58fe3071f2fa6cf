//! Tests that a changed renderer draws the same picture as a new one, bit for bit.

use glam::vec3;
use kdray::{
    accel::kdtree::Traversal,
    frame::{Denoise, FrameRenderer, Integrator, Picture, Primary, RenderOptions, Tonemap},
    gpu::GpuError,
    render::GpuRenderer,
    scene::{Camera, Environment, Projection},
    world::FlatScene,
};

use super::studio::{assert_silent, device, identical, on_device, options, world_of};
use crate::support::scenes;

const ELSEWHERE: Camera = Camera {
    eye: vec3(1.5, 0.5, 3.5),
    target: vec3(0.0, -0.2, 0.0),
    up: glam::Vec3::Y,
    projection: Projection::Perspective { vertical_fov_degrees: 60.0 },
};

/// Draws `n_samples` samples from the start and returns their mean.
fn sampled(renderer: &mut GpuRenderer, n_samples: u32) -> Picture {
    renderer.reset_samples();
    for _ in 0..n_samples {
        renderer.draw_sample().expect("a sample");
    }
    assert_eq!(renderer.n_samples(), n_samples);
    renderer.picture().expect("a picture")
}

fn sampled_anew(scene: &FlatScene, options: &RenderOptions, n_samples: u32) -> Picture {
    sampled(&mut GpuRenderer::new(device(), &world_of(scene), options).expect("a renderer"), n_samples)
}

/// The renderers of both integrators share the scene's arrays, in whichever order they are made.
#[test]
fn renderers_that_share_a_scene_draw_what_new_ones_draw() {
    let colours = (0..32).map(|ix| vec3(ix as f32 / 8.0, 0.5, 1.0)).collect();
    let (environment, _) = Environment::new([8, 4], colours, (0.0, 1.0)).unwrap();
    let scene = FlatScene { environment: Some(environment), ..scenes::mixed_outdoors() };
    let (world, context) = (world_of(&scene), device());
    let of = |integrator, traversal| RenderOptions { integrator, traversal, ..options(24, 18, 3) };
    for integrators in [[Integrator::Whitted, Integrator::Path], [Integrator::Path, Integrator::Whitted]] {
        for traversals in [[Traversal::Ropes; 2], [Traversal::Ropes, Traversal::MaskBoxes]] {
            let [first, second] = [0, 1].map(|ix| of(integrators[ix], traversals[ix]));
            let mut one = GpuRenderer::new(context.clone(), &world, &first).expect("a renderer");
            let mut other = one.sharing(&second).expect("a renderer");
            for is_other in [true, false, true] {
                let (renderer, options) = if is_other { (&mut other, &second) } else { (&mut one, &first) };
                assert!(identical(&sampled(renderer, 2), &sampled_anew(&scene, options, 2)), "{options:?}");
            }
            one.set_options(&second).expect("options");
            assert!(identical(&sampled(&mut one, 2), &sampled(&mut other, 2)), "{second:?}");
        }
    }
    assert_silent(&context);
}

#[test]
fn other_options_draw_what_a_new_renderer_draws() {
    let scene = scenes::mixed_outdoors();
    let (world, context) = (world_of(&scene), device());
    let start = options(40, 30, 3);
    let filtered = RenderOptions { denoise: Denoise::Paper { threshold: 0.3 }, ..start.clone() };
    let steps = [
        RenderOptions { max_depth: 5, ..start.clone() },
        RenderOptions { primary: Primary::Trace, ..start.clone() },
        RenderOptions { traversal: Traversal::Ropes, ..start.clone() },
        RenderOptions { traversal: Traversal::MaskBoxes, max_depth: 2, ..start.clone() },
        filtered.clone(),
        RenderOptions { exposure: 0.5, ..filtered.clone() },
        RenderOptions { width: 70, height: 50, ..filtered },
        RenderOptions { width: 17, height: 9, ..start.clone() },
        start.clone(),
    ];
    let mut renderer = GpuRenderer::new(context.clone(), &world, &start).expect("a renderer");
    let before = sampled(&mut renderer, 2);
    for to in &steps {
        renderer.set_options(to).expect("options");
        let n_samples = 1 + to.max_depth % 2;
        assert!(identical(&sampled(&mut renderer, n_samples), &sampled_anew(&scene, to, n_samples)), "{to:?}");
    }
    assert!(identical(&before, &sampled(&mut renderer, 2)));
    assert_silent(&context);
}

#[test]
fn other_cameras_and_sizes_draw_what_a_new_renderer_draws() {
    let scene = scenes::mixed_outdoors();
    let (world, context) = (world_of(&scene), device());
    let mut renderer = GpuRenderer::new(context.clone(), &world, &options(40, 30, 3)).expect("a renderer");
    renderer.draw_sample().expect("a sample");
    renderer.set_camera(&ELSEWHERE);
    assert_eq!((renderer.n_samples(), renderer.camera()), (0, &ELSEWHERE));
    let from_there = FlatScene { camera: ELSEWHERE, ..scene };
    for (width, height) in [(40, 30), (90, 20), (12, 60), (41, 30)] {
        renderer.resize(width, height).expect("another size");
        let expected = on_device(&from_there, &options(width, height, 3));
        assert!(identical(&sampled(&mut renderer, 1), &expected), "{width}x{height}");
    }
    // The kernels of an orthographic camera are others.
    let in_parallel = scenes::orthographic(from_there.clone());
    for scene in [&in_parallel, &from_there] {
        renderer.set_camera(&scene.camera);
        let expected = on_device(scene, &options(41, 30, 3));
        assert!(identical(&sampled(&mut renderer, 1), &expected), "orthographic: {}", scene.camera.is_orthographic());
    }
    assert_silent(&context);
}

#[test]
fn exposure_curve_and_threshold_keep_the_samples() {
    let scene = scenes::mixed_outdoors();
    let (world, context) = (world_of(&scene), device());
    let denoise = |threshold| Denoise::Paper { threshold };
    let start = RenderOptions { denoise: denoise(2.0), ..options(40, 30, 3) };
    let mut renderer = GpuRenderer::new(context.clone(), &world, &start).expect("a renderer");
    sampled(&mut renderer, 3);
    let to = RenderOptions { exposure: 2.0, denoise: denoise(0.2), tonemap: Tonemap::Agx, ..start };
    renderer.set_options(&to).expect("options");
    assert_eq!(renderer.n_samples(), 3);
    renderer.show().expect("the picture");
    let shown = renderer.picture().expect("a picture");
    assert!(identical(&shown, &sampled_anew(&scene, &to, 3)));
    renderer.draw_sample().expect("a sample");
    assert!(identical(&renderer.picture().expect("a picture"), &sampled_anew(&scene, &to, 4)));
    assert_silent(&context);
}

#[test]
fn refused_options_change_nothing() {
    let scene = scenes::mixed_outdoors();
    let (world, context) = (world_of(&scene), device());
    let mut renderer = GpuRenderer::new(context.clone(), &world, &options(40, 30, 3)).expect("a renderer");
    let before = sampled(&mut renderer, 1);
    let refused = renderer.resize(1 << 20, 1);
    assert!(matches!(refused, Err(GpuError::BadOptions(_))), "{:?}", refused.err());
    assert!(identical(&before, &sampled(&mut renderer, 1)));
    assert_silent(&context);
}
