//! Tests of the kernel for false colours against its twin on the CPU: within one level, since division is not exact.

use glam::{Vec3, vec3};
use kdray::{
    layout::{FalseColor, NO_TRIANGLE, PixelAovs, VIEW_COST, VIEW_DEPTH, VIEW_ID, VIEW_NORMAL, VIEW_RAYS},
    reference,
};

use super::stage::{Stage, UNTOUCHED_WORD, options};
use crate::support::{compare, random::Random, scenes};

const VIEWS: [u32; 5] = [VIEW_DEPTH, VIEW_NORMAL, VIEW_ID, VIEW_COST, VIEW_RAYS];

fn stage(width: u32, height: u32) -> Stage {
    let mut scene = scenes::empty();
    scenes::add(&mut scene, Vec::new(), scenes::BLACK);
    Stage::new(scene, kdray::frame::RenderOptions { pixel_aovs: true, ..options(width, height) }, 1)
}

fn displayed(stage: &Stage, push: &FalseColor, pixel_aovs: &[PixelAovs]) -> Vec<[u8; 4]> {
    let pixels = &stage.resources.pixels;
    pixels.pixel_aovs.upload(pixel_aovs).expect("pixel_aovs");
    pixels.pixel_display.upload(&vec![UNTOUCHED_WORD; pixel_aovs.len()]).expect("pixel_display");
    stage.run(|commands| stage.passes.false_color.record(commands, &stage.resources, push));
    pixels.pixel_display.download().expect("pixel_display").into_iter().map(u32::to_le_bytes).collect()
}

fn random_aovs(n: u32) -> Vec<PixelAovs> {
    let mut random = Random(9);
    let mut unit = || random.unit();
    (0..n)
        .map(|i| PixelAovs {
            triangle_ix: if i % 5 == 3 { NO_TRIANGLE } else { (unit() * 1e6) as u32 },
            normal_world: vec3(unit() - 0.5, unit() - 0.5, unit() - 0.5).normalize_or(Vec3::X),
            depth: if i % 5 == 3 { f32::INFINITY } else { unit() * 100.0 },
            n_rays: (unit() * 40.0) as u32,
            n_steps: (unit() * 4000.0) as u32,
            ..PixelAovs::default()
        })
        .collect()
}

#[test]
fn agrees_with_its_twin() {
    for (width, height) in [(1, 1), (8, 8), (9, 9), (1, 65), (100, 75)] {
        let (stage, pixel_aovs) = (stage(width, height), random_aovs(width * height));
        for view in VIEWS {
            let push = FalseColor { view, brightest: if view == VIEW_COST { 2000.0 } else { 20.0 } };
            let mut expected = vec![[0; 4]; pixel_aovs.len()];
            reference::false_color::false_color(&push, &pixel_aovs, &mut expected);
            compare::bytes(1, &expected, &displayed(&stage, &push, &pixel_aovs)).unwrap();
        }
    }
}

#[test]
fn every_view_shows_something_else() {
    let (stage, pixel_aovs) = (stage(8, 8), random_aovs(64));
    let shown = VIEWS.map(|view| displayed(&stage, &FalseColor { view, brightest: 20.0 }, &pixel_aovs));
    for (i, a) in shown.iter().enumerate() {
        for b in &shown[..i] {
            assert!(compare::bytes(1, a, b).is_err());
        }
    }
}

#[test]
fn known_values_have_known_colours() {
    let stage = stage(2, 1);
    let nothing = PixelAovs { triangle_ix: NO_TRIANGLE, depth: f32::INFINITY, ..PixelAovs::default() };
    let hit = PixelAovs { depth: 10.0, normal_world: Vec3::Y, n_rays: 7, n_steps: 30, ..PixelAovs::default() };
    let show = |view| displayed(&stage, &FalseColor { view, brightest: 10.0 }, &[nothing, hit]);
    let black = [0, 0, 0, 255];
    compare::bytes(1, &[black, [128, 128, 128, 255]], &show(VIEW_DEPTH)).unwrap();
    compare::bytes(1, &[black, [128, 255, 128, 255]], &show(VIEW_NORMAL)).unwrap();
    compare::bytes(1, &[black, [255, 255, 255, 255]], &show(VIEW_COST)).unwrap();
    // At 0.7 of the scale, red is 1, green is 1.1 and blue is 0.1 before clamping.
    compare::bytes(1, &[black, [255, 255, 26, 255]], &show(VIEW_RAYS)).unwrap();
}
