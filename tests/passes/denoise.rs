//! Tests of the kernel denoise against its twin on the CPU.

use kdray::{
    frame::{Denoise, RenderOptions},
    reference,
};

use super::stage::{Stage, UNTOUCHED_PIXEL, options};
use crate::support::{compare, random::Random, scenes};

/// Returns dark pixels with some bright ones among them, of which some are brighter than white.
fn noisy(n: usize) -> Vec<[f32; 4]> {
    let mut random = Random(5);
    let mut pixel = |_| {
        let scale = if random.below(4) == 0 { 3.0 } else { 0.3 };
        [random.unit() * scale, random.unit() * scale, random.unit() * scale, 1.0]
    };
    (0..n).map(&mut pixel).collect()
}

fn filtered(stage: &Stage, pixels: &[[f32; 4]]) -> Vec<[f32; 4]> {
    let resources = &stage.resources;
    resources.pixels.pixel_radiance.upload(pixels).expect("pixel_radiance");
    resources.pixels.filtered().upload(&vec![UNTOUCHED_PIXEL; pixels.len()]).expect("pixel_filtered");
    stage.run(|commands| stage.passes.denoise.record(commands, resources));
    resources.pixels.filtered().download().expect("pixel_filtered")
}

fn empty_stage(options: RenderOptions) -> Stage {
    let mut scene = scenes::empty();
    scenes::add(&mut scene, Vec::new(), scenes::BLACK);
    Stage::new(scene, options, 1)
}

#[test]
fn agrees_with_its_twin() {
    for (width, height) in [(1, 1), (7, 8), (8, 8), (9, 9), (1, 65), (100, 75)] {
        let stage = empty_stage(RenderOptions { exposure: 1.3, ..options(width, height) });
        let pixels = noisy((width * height) as usize);
        let mut expected = vec![UNTOUCHED_PIXEL; pixels.len()];
        reference::denoise::denoise(stage.resources.constants(), &pixels, &mut expected);
        // A sum of differences close to the threshold may be on either side of it.
        compare::pixels(1e-6, pixels.len() / 5000, &expected, &filtered(&stage, &pixels)).unwrap();
        let n_smoothed = pixels.iter().zip(&expected).filter(|(before, after)| before != after).count();
        assert!(pixels.len() < 50 || (pixels.len() / 10..pixels.len() * 9 / 10).contains(&n_smoothed));
    }
}

/// The differences of a white pixel to its four neighbours sum to 4 if it is alone on black, to 2 at a corner, and to
/// 1 at an edge.
#[test]
fn a_lone_pixel_goes_and_an_edge_stays() {
    let threshold = Denoise::DEFAULT_THRESHOLD;
    let stage = empty_stage(RenderOptions { denoise: Denoise::Paper { threshold }, ..options(16, 16) });
    let mut pixels = vec![[0.0, 0.0, 0.0, 1.0]; 256];
    for (x, y) in (8..16).flat_map(|y| (0..16).map(move |x| (x, y))) {
        pixels[y * 16 + x] = [1.0; 4];
    }
    compare::exact(&pixels, &filtered(&stage, &pixels)).unwrap();
    let mut speckled = pixels.clone();
    speckled[3 * 16 + 5] = [1.0; 4];
    let found = filtered(&stage, &speckled);
    compare::pixels(1e-6, 0, &[[0.2, 0.2, 0.2, 1.0]], &found[3 * 16 + 5..3 * 16 + 6]).unwrap();
}
