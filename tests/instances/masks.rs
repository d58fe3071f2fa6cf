//! Instances that some kinds of rays pass through: of the camera, to lights, and all others.

use std::sync::Arc;

use kdray::{
    cpu,
    frame::{Denoise, Integrator, Picture, Primary, RenderOptions},
    gpu::Context,
    render::GpuRenderer,
    scene::{RayKinds, Scene, SceneError},
    world::World,
};

use super::kept;
use crate::support::{assert_silent, device};

const SIZE: u32 = 32;

/// A mirror in the plane y = 0 before a grey wall in the plane z = -4, and a plate between them. The camera looks along
/// -z from 2 above the mirror. `plate`: keys of the plate's table.
fn scene_of(plate: &str, rest: &str) -> Result<Scene, SceneError> {
    let text = format!(
        "background = [0.0, 0.0, 0.0]\nambient = [0.0, 0.0, 0.0]\n\
         camera = {{ eye = [0.0, 2.0, 6.0], target = [0.0, 2.0, 0.0], vertical_fov = 60.0 }}\n\
         materials.mirror = {{ Ks = [1.0, 1.0, 1.0], Kd = [0.0, 0.0, 0.0], illum = 3 }}\n\
         materials.grey = {{ Kd = [0.5, 0.5, 0.5] }}\n\
         materials.red = {{ Kd = [0.8, 0.0, 0.0] }}\n\
         materials.lamp = {{ Kd = [0.0, 0.0, 0.0], Ke = [3.0, 3.0, 3.0] }}\n{rest}\
         [[mesh]]\ngenerator = 'plane'\nsize = [40.0, 10.0]\nmaterial = 'mirror'\n\
         [[mesh]]\ngenerator = 'plane'\nsize = [40.0, 40.0]\nmaterial = 'grey'\n\
         transform = {{ rotate = [90.0, 0.0, 0.0], translate = [0.0, 0.0, -4.0] }}\n\
         [[mesh]]\ngenerator = 'plane'\nsize = [1.6, 1.6]\n{plate}\n\
         transform = {{ rotate = [90.0, 0.0, 0.0], translate = [0.0, 1.2, -2.0] }}\n"
    );
    Scene::of_text("masks.toml", &text)
}

const POINT: &str = "[[light]]\nkind = 'point'\nposition = [-8.0, 2.0, 6.0]\nintensity = [90.0, 90.0, 90.0]\n";

fn options(integrator: Integrator, primary: Primary) -> RenderOptions {
    let (width, height, max_depth) = (SIZE, SIZE, 3);
    RenderOptions { width, height, max_depth, integrator, primary, denoise: Denoise::Off, ..RenderOptions::default() }
}

/// The pictures of the CPU, of traced and of rasterized primary rays.
fn pictures(context: &Arc<Context>, scene: &Scene, integrator: Integrator) -> [Picture; 3] {
    let world: World = kept(scene);
    let draw = |primary| {
        let mut renderer =
            GpuRenderer::new(context.clone(), &world, &options(integrator, primary)).expect("a renderer");
        let picture = renderer.render().expect("a frame").0;
        assert_silent(context);
        picture
    };
    [cpu::render(&world, &options(integrator, Primary::Trace)).0, draw(Primary::Trace), draw(Primary::Raster)]
}

/// The radiance at a place of the picture whose middle is (0, 0) and whose upper edge is at y = 1.
fn at(picture: &Picture, [x, y]: [f32; 2]) -> [f32; 3] {
    let pixel = |c: f32| ((c + 1.0) / 2.0 * SIZE as f32) as usize;
    let [r, g, b, _] = picture.radiance[pixel(-y) * SIZE as usize + pixel(x)];
    [r, g, b]
}

/// The middle of the plate (0, 1.2, -2), seen from (0, 2, 6) by 60 degrees: -0.8 / 8 / tan 30.
const PLATE: [f32; 2] = [0.0, -0.173];
/// Its image (0, -1.2, -2).
const IMAGE: [f32; 2] = [0.0, -0.693];
/// Its shadow on the wall (2, 1, -4), and the place (-2, 1, -4), which is as bright without the shadow, or brighter.
const SHADOW: [f32; 2] = [0.346, -0.173];
const LIT: [f32; 2] = [-0.346, -0.173];

/// Whether the plate, and not the wall, is at a place. The wall may get some red light from the plate.
fn is_plate([r, g, b]: [f32; 3]) -> bool {
    let is_red = r > 0.02 && g == 0.0 && b == 0.0;
    assert!(is_red || g > 0.02 && (g - b).abs() < 1e-4, "{r} {g} {b}: neither the plate nor the wall");
    is_red
}

#[test]
fn each_kind_of_ray_passes_through_what_is_hidden_from_it() {
    let context = device();
    for kinds in 1..8_u32 {
        let has = |bit: u32| kinds & 1 << bit != 0;
        let names = ["camera", "shadow", "other"].into_iter().enumerate().filter(|(bit, _)| has(*bit as u32));
        let names = names.map(|(_, name)| format!("'{name}'")).collect::<Vec<_>>().join(", ");
        let scene = scene_of(&format!("material = 'red'\nrays = [{names}]"), POINT).expect("a scene");
        let rays = RayKinds { camera: has(0), shadow: has(1), other: has(2) };
        assert_eq!(scene.instances[2].rays, rays);
        for integrator in [Integrator::Whitted, Integrator::Path] {
            for (ix, picture) in pictures(&context, &scene, integrator).iter().enumerate() {
                let what = format!("{names}, {integrator}, picture {ix}");
                assert_eq!(is_plate(at(picture, PLATE)), rays.camera, "{what}: the plate");
                assert_eq!(is_plate(at(picture, IMAGE)), rays.other, "{what}: its image");
                // Whose shadow: the light that the wall gets from the plate and the mirror is less than a tenth.
                let share = at(picture, SHADOW)[1] / at(picture, LIT)[1];
                assert!(if rays.shadow { share < 0.1 } else { (0.5..=1.5).contains(&share) }, "{what}: {share}");
            }
        }
    }
}

#[test]
fn a_lamp_that_scattered_rays_pass_through_is_only_seen() {
    let context = device();
    for (names, lights) in [("'camera', 'shadow', 'other'", true), ("'camera', 'shadow'", false), ("'camera'", false)] {
        let scene = scene_of(&format!("material = 'lamp'\nrays = [{names}]"), "").expect("a scene");
        for (ix, picture) in pictures(&context, &scene, Integrator::Path).iter().enumerate() {
            assert_eq!(at(picture, PLATE), [3.0; 3], "{names}, picture {ix}");
            // The lamp shines along +z, so the wall behind it stays dark; the mirror shows the lamp.
            assert_eq!(at(picture, IMAGE) == [3.0; 3], lights, "{names}, picture {ix}");
        }
    }
}

#[test]
fn wrong_kinds_of_rays_are_refused() {
    for (rays, expected) in [("[]", "`rays` is empty"), ("['camera', 'light']", "light"), ("'camera'", "sequence")] {
        let error = scene_of(&format!("material = 'red'\nrays = {rays}"), POINT).expect_err("a refusal").to_string();
        assert!(error.contains("mesh 3") && error.contains(expected), "{error}");
    }
}
