//! Tests of pictures with several samples per pixel.

use glam::{Vec3, vec3};
use kdray::{
    frame::{Picture, Primary, RenderOptions},
    render::GpuRenderer,
    scene::Projection,
    world::FlatScene,
};

use super::{
    batches::glass_in_glass,
    studio::{
        assert_silent, device, differing, identical, on_both, options, samples_on_cpu as on_cpu,
        samples_on_device as on_device, world_of,
    },
};
use crate::support::{meshes, scenes};

/// Returns a scene that is white to the left of x = `edge` in the plane z = 0 and black elsewhere. In a picture 30
/// pixels high, a pixel is 1/10 wide in that plane.
fn half_plane(edge: f32) -> FlatScene {
    let mut scene = scenes::empty();
    let corner = |x: f32, y: f32| vec3(x, y, 0.0);
    let plane = meshes::triangle(corner(edge, -90.0), corner(edge, 90.0), corner(-90.0, 0.0));
    scenes::add(&mut scene, vec![plane], scenes::emissive(Vec3::ONE));
    scene.camera.eye = vec3(0.0, 0.0, 1.5);
    scene.camera.projection = Projection::Perspective { vertical_fov_degrees: 90.0 };
    scene
}

/// Returns the same scene in the same size, as an orthographic camera shows it.
fn half_plane_in_parallel(edge: f32) -> FlatScene {
    let mut scene = half_plane(edge);
    scene.camera.projection = Projection::Orthographic { height: 3.0 };
    scene
}

/// Returns the share of a tent filter over -1 to 1 that is left of `x`.
fn left_of(x: f32) -> f32 {
    let x = x.clamp(-1.0, 1.0);
    0.5 + x - x * x.abs() / 2.0
}

/// Returns the largest difference of any pixel of a picture 40 pixels wide from the filtered edge.
fn worst(picture: &Picture, edge: f32) -> f32 {
    let of_column = |x: usize| left_of((edge * 10.0 + 20.0) - (x as f32 + 0.5));
    let off = |(i, pixel): (usize, &[f32; 4])| (pixel[0] - of_column(i % 40)).abs();
    picture.radiance.iter().enumerate().map(off).fold(0.0, f32::max)
}

#[test]
fn an_edge_converges_to_the_filter_s_coverage() {
    for (scene, edge, primary) in [
        (half_plane(0.03), 0.03, Primary::Raster),
        (half_plane(0.68), 0.68, Primary::Trace),
        (half_plane(-1.25), -1.25, Primary::Raster),
        (half_plane_in_parallel(0.47), 0.47, Primary::Raster),
    ] {
        let options = RenderOptions { primary, ..options(40, 30, 1) };
        for (name, render) in [("device", on_device as fn(&_, &_, _) -> _), ("cpu", on_cpu)] {
            // The tolerance is the weight of three of 256 samples, and 1/32 px for edges moved by snapping to 1/16
            // px.
            let found = worst(&render(&scene, &options, 256), edge);
            assert!(found < 3.0 / 256.0 + 1.0 / 32.0, "{name}, {edge}: {found}");
            let one = worst(&render(&scene, &options, 1), edge);
            assert!(one > 0.1, "{name}: one sample is no filter, but {one}");
        }
    }
}

#[test]
fn device_and_cpu_agree() {
    let scene = scenes::mixed_outdoors();
    for primary in [Primary::Raster, Primary::Trace] {
        let options = RenderOptions { primary, ..options(80, 60, 4) };
        let (device, cpu) = (on_device(&scene, &options, 3), on_cpu(&scene, &options, 3));
        let n_differing = differing(&device, &cpu, 2e-3).len();
        assert!(n_differing <= 4800 / 30, "{primary}: {n_differing} pixels differ");
        assert!(differing(&device, &on_device(&scene, &options, 2), 2e-3).len() > 1000);
    }
}

#[test]
fn one_sample_is_the_frame() {
    let (scene, options) = (scenes::mixed_outdoors(), options(40, 30, 4));
    let [device, cpu] = on_both(&scene, &options);
    assert!(identical(&device, &on_device(&scene, &options, 1)) && identical(&cpu, &on_cpu(&scene, &options, 1)));
}

#[test]
fn small_queues_give_the_same_bits() {
    let (scene, options, context) = (glass_in_glass(), options(31, 25, 6), device());
    let world = world_of(&scene);
    let render = |capacity| {
        let renderer = GpuRenderer::with_queue_capacity(context.clone(), &world, &options, capacity);
        let mut renderer = renderer.expect("a renderer");
        let profiles: Vec<_> = (0..9).map(|_| renderer.draw_sample().expect("a sample")).collect();
        (renderer.picture().expect("a picture"), profiles)
    };
    let (whole, profiles) = render(100_000);
    // This capacity is enough for the first sample, but not for all samples.
    let enough: u32 = profiles[0].bounces.iter().map(|bounce| bounce.n_rays as u32).sum();
    for capacity in [600, 1000, enough] {
        let (picture, profiles) = render(capacity);
        assert!(identical(&whole, &picture), "queues for {capacity} rays");
        let n_batches = [&profiles[0], &profiles[8]].map(|profile| profile.n_batches);
        assert!(n_batches[1] > 1 && (capacity < enough || n_batches[0] == 1), "{n_batches:?}");
    }
    assert_silent(&context);
}
