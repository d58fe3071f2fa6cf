//! Tests of orthographic cameras: closed forms, and the same first hits by each way of primary rays.

use std::sync::Arc;

use glam::{Vec3, vec3};
use kdray::{
    cpu::{self, Batching},
    frame::{Picture, Primary, RenderOptions},
    gpu::Context,
    layout::{NO_TRIANGLE, PixelAovs},
    render::GpuRenderer,
    scene::{Camera, Projection},
    world::{FlatScene, World},
};

use super::studio::{assert_silent, device, differing, options, world_of};
use crate::support::{meshes, scenes};

/// Draws a sample on the device, with AOVs.
fn on_device(context: &Arc<Context>, world: &World, options: &RenderOptions) -> (Picture, Vec<PixelAovs>) {
    let options = RenderOptions { pixel_aovs: true, ..options.clone() };
    let mut renderer = GpuRenderer::new(context.clone(), world, &options).expect("a renderer");
    let picture = renderer.render().expect("a frame").0;
    (picture, renderer.pixel_aovs().expect("pixel_aovs"))
}

/// Draws the same on the CPU.
fn on_cpu(world: &World, options: &RenderOptions) -> (Picture, Vec<PixelAovs>) {
    let options = RenderOptions { pixel_aovs: true, ..options.clone() };
    let mut renderer = cpu::CpuRenderer::new(world, &options, Batching::default());
    renderer.draw_sample();
    (renderer.picture(), renderer.pixel_aovs())
}

/// The ways in which the device finds the hits of primary rays.
fn primaries(context: &Context) -> &'static [Primary] {
    if context.has_int64_atomics() { Primary::ALL } else { &[Primary::Raster, Primary::Trace] }
}

/// A box of half sides 0.52 and 0.33 covers the same pixels from any distance, also if it is beside the middle.
#[test]
fn a_box_covers_the_same_pixels_at_any_distance() {
    let context = device();
    let mut scene = scenes::empty();
    let mut sides = meshes::cube(1, 0.0);
    for v in sides.iter_mut().flat_map(|t| [&mut t.v0, &mut t.v1, &mut t.v2]) {
        *v = *v * vec3(0.52, 0.33, 0.5) + vec3(0.8, 0.0, 0.0);
    }
    scenes::add(&mut scene, sides, scenes::emissive(Vec3::ONE));
    for distance in [0.6_f32, 3.0, 900.0] {
        scene.camera.eye = vec3(0.0, 0.0, distance);
        // A pixel is 1/10 wide. The picture shows x from -2 to 2.
        scene.camera.projection = Projection::Orthographic { height: 3.0 };
        let world = world_of(&scene);
        let check = |name: &str, (picture, pixel_aovs): (Picture, Vec<PixelAovs>)| {
            for (i, (pixel, aovs)) in picture.radiance.iter().zip(pixel_aovs).enumerate() {
                let (x, y) = ((i % 40) as f32 / 10.0 + 0.05 - 2.0, 1.5 - 0.05 - (i / 40) as f32 / 10.0);
                let is_covered = (x - 0.8).abs() < 0.52 && y.abs() < 0.33;
                assert_eq!(pixel[0] == 1.0, is_covered, "{name}, {distance}: {x}, {y}");
                let off = aovs.position_world - vec3(x, y, 0.5);
                assert!(!is_covered || off.abs().max_element() < 1e-4, "{name}, {distance}: {off}");
                let off = aovs.depth - (distance - 0.5);
                assert!(!is_covered || off.abs() < 1e-4, "{name}, {distance}: {}", aovs.depth);
            }
        };
        for &primary in primaries(&context) {
            let options = RenderOptions { primary, ..options(40, 30, 1) };
            check(&primary.to_string(), on_device(&context, &world, &options));
        }
        check("cpu", on_cpu(&world, &options(40, 30, 1)));
    }
    assert_silent(&context);
}

/// Nothing behind the eye is seen: from the middle of the box, its far side shows.
#[test]
fn what_is_behind_the_eye_is_not_seen() {
    let context = device();
    let mut scene = scenes::empty();
    scenes::add(&mut scene, meshes::cube(2, 0.0), scenes::emissive(Vec3::ONE));
    // A screen through the eye's plane, half of which is in front of the eye.
    let corner = |x: f32, y: f32| vec3(x, y, 0.2 - x);
    let screen = meshes::triangle(corner(-1.9, -9.0), corner(1.9, -9.0), corner(0.0, 9.0));
    scenes::add(&mut scene, vec![screen], scenes::emissive(vec3(0.0, 0.5, 0.0)));
    let projection = Projection::Orthographic { height: 1.0 };
    scene.camera = Camera { eye: vec3(0.0, 0.0, 0.2), target: vec3(0.0, 0.0, -1.0), up: Vec3::Y, projection };
    let world = world_of(&scene);
    let check = |name: &str, (picture, pixel_aovs): (Picture, Vec<PixelAovs>)| {
        for (i, (pixel, aovs)) in picture.radiance.iter().zip(pixel_aovs).enumerate() {
            // The screen is in front of the eye where x is above 0.
            let x = ((i % 20) as f32 + 0.5) / 20.0 - 0.5;
            let expected = if x > 0.0 { ([0.0, 0.5, 0.0], x) } else { ([1.0; 3], 1.2) };
            assert_eq!(pixel[..3], expected.0, "{name}: {x}");
            assert!((aovs.depth - expected.1).abs() < 1e-5, "{name}: {x}, {}", aovs.depth);
        }
    };
    for &primary in primaries(&context) {
        check(&primary.to_string(), on_device(&context, &world, &RenderOptions { primary, ..options(20, 20, 1) }));
    }
    check("cpu", on_cpu(&world, &options(20, 20, 1)));
    assert_silent(&context);
}

/// Returns the pixels whose hit is not on the ray that begins at the pixel's place in the image plane, in front of it.
fn off_their_rays(scene: &FlatScene, (width, height): (u32, u32), pixel_aovs: &[PixelAovs]) -> Vec<usize> {
    let Camera { eye, target, up, .. } = scene.camera;
    let forward = (target - eye).normalize();
    let right = forward.cross(up).normalize();
    let pixel_side = scene.camera.height_at(0.0) / height as f32;
    let is_off = |&i: &usize| {
        let PixelAovs { position_world, depth, triangle_ix, .. } = pixel_aovs[i];
        let x = ((i as u32 % width) as f32 + 0.5 - width as f32 / 2.0) * pixel_side;
        let y = (height as f32 / 2.0 - (i as u32 / width) as f32 - 0.5) * pixel_side;
        let expected = eye + x * right + y * right.cross(forward) + depth * forward;
        triangle_ix != NO_TRIANGLE && !((position_world - expected).length() < 2e-3 * pixel_side && depth > 0.0)
    };
    (0..pixel_aovs.len()).filter(is_off).collect()
}

/// The device and the CPU show the same, and each pixel shows a point of its ray. A rasterized pixel on an edge may
/// show the edge's nearest point.
#[test]
fn every_pixel_shows_a_point_of_its_ray() {
    let context = device();
    let scene = scenes::orthographic(scenes::mixed_outdoors());
    let world = world_of(&scene);
    let size = (80, 60);
    let (expected, pixel_aovs) = on_cpu(&world, &RenderOptions { primary: Primary::Trace, ..options(80, 60, 4) });
    assert_eq!(off_their_rays(&scene, size, &pixel_aovs), [0usize; 0]);
    for &primary in primaries(&context) {
        let (picture, pixel_aovs) = on_device(&context, &world, &RenderOptions { primary, ..options(80, 60, 4) });
        let share = if primary == Primary::Raster { 50 } else { 200 };
        let n_differing = differing(&expected, &picture, 2e-3).len();
        assert!(n_differing <= 4800 / share, "{primary}: {n_differing} pixels differ");
        let n_off = off_their_rays(&scene, size, &pixel_aovs).len();
        assert!(n_off <= if primary == Primary::Raster { 48 } else { 0 }, "{primary}: {n_off} pixels off their rays");
    }
    assert_silent(&context);
    // A perspective camera's hits are elsewhere.
    let perspective = FlatScene { camera: scenes::empty().camera, ..scene.clone() };
    let (_, pixel_aovs) = on_cpu(&world_of(&perspective), &options(80, 60, 1));
    assert!(off_their_rays(&scene, size, &pixel_aovs).len() > 4000);
}

/// A sheet of half side 1 has a hole of half side 1/2, through which the wall behind it is seen. The picture shows both
/// from above and obliquely.
#[test]
fn a_hole_is_seen_through_in_every_way() {
    let context = device();
    let mut scene = super::textures::holed_sheet();
    // The sheet is at z = 0.5, the wall at z = -0.5. A pixel is 1/8 wide.
    let projection = Projection::Orthographic { height: 4.0 };
    for slope in [0.0_f32, 0.25] {
        let eye = vec3(4.0 * slope, 0.0, 4.5);
        scene.camera = Camera { eye, target: vec3(0.0, 0.0, 0.5), up: Vec3::Y, projection };
        let world = world_of(&FlatScene::new(&scene).expect("a scene that fits together"));
        let cosine = (1.0 + slope * slope).sqrt().recip();
        let check = |name: &str, (_, pixel_aovs): (Picture, Vec<PixelAovs>)| {
            for (i, aovs) in pixel_aovs.iter().enumerate() {
                let at = |i: usize| (i as f32 + 0.5) / 8.0 - 2.0;
                let (x, y) = (at(i % 32) / cosine, at(i / 32));
                let is_sheet = x.abs().max(y.abs()) < 1.0 && x.abs().max(y.abs()) > 0.5;
                // Rounding decides on samples on an edge.
                let is_on_edge = [0.5, 1.0].iter().any(|edge| (x.abs() - edge).abs() < 1e-3);
                let z = if is_sheet { 0.5 } else { -0.5 };
                let off = (aovs.position_world.z - z).abs();
                assert!(is_on_edge || off < 1e-4, "{name}, {slope}: {x}, {y}: {}", aovs.position_world);
            }
        };
        for &primary in primaries(&context) {
            check(&primary.to_string(), on_device(&context, &world, &RenderOptions { primary, ..options(32, 32, 1) }));
        }
        check("cpu", on_cpu(&world, &options(32, 32, 1)));
    }
    assert_silent(&context);
}
