//! Tests of the kernel tonemap against its twin on the CPU: within one level, since `pow` is not exact.

use kdray::{
    frame::{RenderOptions, Tonemap},
    reference,
};

use super::stage::{Stage, UNTOUCHED_WORD, options};
use crate::support::{compare, random::Random, scenes};

fn encoded(stage: &Stage, pixels: &[[f32; 4]]) -> Vec<[u8; 4]> {
    let resources = &stage.resources;
    resources.pixels.filtered().upload(pixels).expect("pixel_filtered");
    resources.pixels.pixel_display.upload(&vec![UNTOUCHED_WORD; pixels.len()]).expect("pixel_display");
    stage.run(|commands| stage.passes.tonemap.record(commands, resources));
    resources.pixels.pixel_display.download().expect("pixel_display").into_iter().map(u32::to_le_bytes).collect()
}

fn empty_stage(options: RenderOptions) -> Stage {
    let mut scene = scenes::empty();
    scenes::add(&mut scene, Vec::new(), scenes::BLACK);
    Stage::new(scene, options, 1)
}

#[test]
fn agrees_with_its_twin() {
    for (width, height) in [(1, 1), (7, 8), (8, 8), (9, 9), (1, 65), (100, 75)] {
        for &tonemap in Tonemap::ALL {
            let stage = empty_stage(RenderOptions { exposure: 0.7, tonemap, ..options(width, height) });
            let mut random = Random(6);
            let mut channel = |_| random.unit() * random.unit() * 2.0;
            let pixels: Vec<[f32; 4]> = (0..width * height).map(|_| [0; 4].map(&mut channel)).collect();
            let mut expected = vec![[0; 4]; pixels.len()];
            reference::tonemap::tonemap(stage.resources.constants(), tonemap, &pixels, &mut expected);
            let found = encoded(&stage, &pixels);
            compare::bytes(1, &expected, &found).unwrap();
            let n_off = expected.iter().zip(&found).filter(|(a, b)| a != b).count();
            assert!(n_off <= pixels.len() / 50, "{tonemap}: {n_off} pixels are one code off");
        }
    }
}

#[test]
fn another_curve_is_noticed() {
    let pixels: Vec<[f32; 4]> = (0..64).map(|i| [i as f32 / 32.0, 0.3, 0.1, 1.0]).collect();
    let shown = |&tonemap: &Tonemap| encoded(&empty_stage(RenderOptions { tonemap, ..options(8, 8) }), &pixels);
    let shown: Vec<_> = Tonemap::ALL.iter().map(shown).collect();
    for (i, j) in [(0, 1), (0, 2), (1, 2)] {
        assert!(compare::bytes(1, &shown[i], &shown[j]).is_err());
    }
}

/// The levels are values of IEC 61966-2-1, computed by hand.
#[test]
fn known_values_are_encoded_as_the_standard_says() {
    let stage = empty_stage(options(3, 3));
    let linear = [0.0, 0.001, 0.0031308, 0.01, 0.21404, 0.5, 1.0, 7.0, f32::INFINITY];
    let expected = [0, 3, 10, 25, 127, 188, 255, 255, 255];
    let pixels = linear.map(|x| [x, x, x, 1.0]);
    compare::bytes(1, &expected.map(|x| [x, x, x, 255]), &encoded(&stage, &pixels)).unwrap();
}
