//! Tests that the device's picture agrees with the CPU's.

use std::path::Path;

use kdray::{
    accel::kdtree::Traversal,
    frame::{Denoise, Primary, RenderOptions},
    world::FlatScene,
};

use super::studio::{device, differing, on_both, options};
use crate::support::scenes;

/// Largest accepted difference of a pixel's radiance: some 2^-13 of a steep highlight's `pow`.
const TOLERANCE: f32 = 2e-3;

/// Asserts that at most the fraction `share` of all pixels differs by more than `TOLERANCE`. They do where the
/// rasterizer's snapped edges, or the rounding of another `sqrt` or `pow`, send a ray past the other side of an edge.
/// Glass multiplies such rays.
fn check(name: &str, scene: &FlatScene, options: &RenderOptions, share: f64) {
    let [device, cpu] = on_both(scene, options);
    let n_differing = differing(&device, &cpu, TOLERANCE).len();
    let n_allowed = (share * device.radiance.len() as f64) as usize;
    assert!(n_differing <= n_allowed, "{name}: {n_differing} of {} pixels differ", device.radiance.len());
    let lit = device.radiance.iter().filter(|pixel| pixel[..3].iter().sum::<f32>() > 0.05).count();
    assert!(lit > device.radiance.len() / 2, "{name}: most of the picture is dark");
}

#[test]
fn device_and_cpu_agree_on_the_scenes_that_ship() {
    let depth = |scene: &FlatScene| scene.defaults.max_depth;
    for name in ["cornell", "paper2", "paper3", "paper4"] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(format!("{name}.toml"));
        let scene = scenes::load(&path);
        let raster = options(96, 72, depth(&scene));
        let share = if device().is_software() { 0.002 } else { 0.003 };
        check(name, &scene, &RenderOptions { primary: Primary::Trace, ..raster.clone() }, share);
        // Corners are snapped to 1/16 px. Triangles of less than a pixel have many outlines, which snapping moves
        // far.
        check(name, &scene, &raster, 0.05);
    }
}

#[test]
fn device_and_cpu_agree_whatever_the_options() {
    let scene = scenes::mixed_outdoors();
    for &traversal in Traversal::ALL {
        for primary in [Primary::Raster, Primary::Trace] {
            let share = if primary == Primary::Raster { 0.02 } else { 0.005 };
            check("mixed", &scene, &RenderOptions { traversal, primary, ..options(80, 60, 5) }, share);
        }
    }
    // In three rows, the walls' seam at y = 0 is exactly on the middle row's samples. An H200's rasterizer leaves those
    // beside the camera empty.
    let wide = if device().is_software() { (130, 3, 4) } else { (131, 4, 4) };
    for (width, height, max_depth) in [(1, 1, 1), (7, 91, 2), wide] {
        check("odd size", &scenes::mixed(), &options(width, height, max_depth), 0.03);
    }
    let denoise = Denoise::Paper { threshold: 0.3 };
    check("filtered", &scene, &RenderOptions { denoise, exposure: 2.0, ..options(80, 60, 3) }, 0.02);
}

#[test]
fn an_empty_scene_shows_its_background() {
    let mut scene = scenes::empty();
    scenes::add(&mut scene, Vec::new(), scenes::BLACK);
    scene.background = glam::Vec3::new(0.25, 0.5, 1.0);
    for picture in on_both(&scene, &options(9, 5, 3)) {
        assert_eq!(picture.radiance, [[0.25, 0.5, 1.0, 1.0]; 45]);
        assert_eq!(picture.display, [[137, 188, 255, 255]; 45]);
    }
}
