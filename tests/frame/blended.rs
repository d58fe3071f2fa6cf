//! Tests of rays of `whitted` that pass straight through blended surfaces, which makes them no deeper.

use glam::{Vec3, vec3};
use kdray::{
    frame::RenderOptions,
    layout::{MATERIAL_MICROFACET, MATERIAL_UNLIT, Material},
    world::FlatScene,
};

use super::studio::{on_both, options};
use crate::support::{
    meshes,
    scenes::{BLACK, add, emissive, empty, mirror},
};

/// Adds a square around the z axis, which is seen from both sides.
fn add_square(scene: &mut FlatScene, z: f32, material: Material) {
    let [a, b, c, d] = [(-99.0, -99.0), (99.0, -99.0), (99.0, 99.0), (-99.0, 99.0)].map(|(x, y)| vec3(x, y, z));
    add(scene, vec![meshes::triangle(a, b, c), meshes::triangle(a, c, d)], material);
}

/// Black sheets that let 0.9 of the light pass: of MTL, of microfacets and unlit ones, by turns.
fn add_sheets(scene: &mut FlatScene, n: u32) {
    for i in 0..n {
        let flags = [0, MATERIAL_MICROFACET, MATERIAL_UNLIT][i as usize % 3];
        add_square(scene, 3.5 - 0.1 * i as f32, Material { d: 0.1, roughness: 1.0, flags, ..BLACK });
    }
}

/// Asserts what all pixels show.
fn check(scene: &FlatScene, max_depth: u32, expected: f32) {
    check_with(scene, &options(9, 8, max_depth), expected);
}

fn check_with(scene: &FlatScene, options: &RenderOptions, expected: f32) {
    for picture in on_both(scene, options) {
        for &[r, _, _, _] in &picture.radiance {
            assert!((r - expected).abs() < 1e-5, "depth {}: {r}, not {expected}", options.max_depth);
        }
    }
}

/// The mirror behind ten sheets shows a lamp behind the camera: rays pass the sheets on their way to the mirror and
/// back. They use two levels, one for the camera's rays and one for what the mirror reflects.
#[test]
fn blended_sheets_make_rays_no_deeper() {
    for n_sheets in [0, 10] {
        let mut scene = empty();
        add_sheets(&mut scene, n_sheets);
        add_square(&mut scene, 0.0, mirror(Vec3::splat(0.5)));
        add_square(&mut scene, 5.0, emissive(Vec3::ONE));
        let expected = 0.5 * 0.9_f32.powi(2 * n_sheets as i32);
        for (max_depth, expected) in [(1, 0.0), (2, expected), (5, expected)] {
            check(&scene, max_depth, expected);
        }
    }
}

/// Between two mirrors, each level adds the lamp once more, with a sheet between them or without.
#[test]
fn reflections_are_deeper_behind_sheets_too() {
    for n_sheets in [0, 1] {
        let mut scene = empty();
        add_sheets(&mut scene, n_sheets);
        let glowing = Material { ke: Vec3::ONE, ..mirror(Vec3::splat(0.5)) };
        [0.0, 5.0].into_iter().for_each(|z| add_square(&mut scene, z, glowing));
        for max_depth in [1, 2, 6] {
            let passed = 0.9_f32.powi(n_sheets as i32);
            let expected = (0..max_depth as i32).map(|i| passed * (0.5 * passed).powi(i)).sum();
            check(&scene, max_depth, expected);
        }
    }
}

/// A pane of glass without thickness takes a level, though rays pass straight through it.
#[test]
fn panes_of_glass_make_rays_deeper() {
    let mut scene = empty();
    add_sheets(&mut scene, 2);
    let glass = Material { transmission: 1.0, kd: Vec3::ONE, flags: MATERIAL_MICROFACET, ..BLACK };
    add_square(&mut scene, 1.0, glass);
    add_square(&mut scene, 0.0, emissive(Vec3::ONE));
    check(&scene, 1, 0.0);
    check(&scene, 2, 0.81);
}

/// Behind more sheets than there are bounces, nothing is seen. The queue of a picture of one pixel has room for as many
/// rays as there are bounces.
#[test]
fn sheets_have_a_bound() {
    let most = RenderOptions::EXTRA_BOUNCES;
    for (n_sheets, max_depth, is_seen) in [(most, 1, true), (most + 1, 1, false), (most + 1, 2, true)] {
        let mut scene = empty();
        add_sheets(&mut scene, n_sheets);
        add_square(&mut scene, 0.0, emissive(Vec3::ONE));
        check_with(&scene, &options(1, 1, max_depth), if is_seen { 0.9_f32.powi(n_sheets as i32) } else { 0.0 });
    }
}
