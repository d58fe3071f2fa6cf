//! Tests of the kernel accumulate against its twin on the CPU. Sums agree exactly, means up to the rounding of a
//! division.

use kdray::{
    layout::{Bounce, Frame},
    reference,
};

use super::stage::{Stage, options};
use crate::support::{compare, random::Random, scenes};

type Pixels = Vec<[f32; 4]>;

fn stage(width: u32, height: u32, n_samples: u32) -> Stage {
    let mut scene = scenes::empty();
    scenes::add(&mut scene, Vec::new(), scenes::BLACK);
    let mut stage = Stage::new(scene, options(width, height), 1);
    let constants = Frame { n_samples, ..*stage.resources.constants() };
    stage.resources.frame.upload(&[constants]).expect("frame");
    stage.resources.set_constants(&constants);
    stage.resources.begin_sums(&stage.context).expect("pixel_accumulated");
    stage
}

fn some(n: usize, seed: u64) -> Pixels {
    let mut random = Random(seed);
    (0..n).map(|_| [random.unit(), random.unit() * 100.0, random.unit(), 1.0]).collect()
}

/// Runs the kernel on a sample and on the sums before it. Returns the means and the new sums.
fn accumulated(stage: &Stage, bounces: &[Bounce; 3], sample: &Pixels, sums: &Pixels) -> (Pixels, Pixels) {
    let pixels = &stage.resources.pixels;
    let accumulated = pixels.pixel_accumulated.as_ref().expect("pixel_accumulated");
    stage.resources.bounces.upload(bounces).expect("bounces");
    pixels.pixel_radiance.upload(sample).expect("pixel_radiance");
    accumulated.upload(sums).expect("pixel_accumulated");
    stage.run(|commands| stage.passes.accumulate.record(commands, &stage.resources));
    (pixels.pixel_radiance.download().expect("pixel_radiance"), accumulated.download().expect("pixel_accumulated"))
}

#[test]
fn agrees_with_its_twin() {
    let quiet = [Bounce::default(); 3];
    for (width, height, n_samples) in [(1, 1, 2), (7, 8, 3), (8, 8, 7), (9, 9, 100), (1, 65, 5), (100, 75, 9)] {
        let stage = stage(width, height, n_samples);
        let n = (width * height) as usize;
        let (sample, sums) = (some(n, 1), some(n, 2));
        let (found, found_sums) = accumulated(&stage, &quiet, &sample, &sums);
        let (mut expected, mut expected_sums) = (sample.clone(), sums.clone());
        reference::accumulate::accumulate(stage.resources.constants(), &quiet, &mut expected, &mut expected_sums);
        compare::exact(&expected_sums, &found_sums).unwrap();
        compare::pixels(1e-5, 0, &expected, &found).unwrap();
        assert!(compare::exact(&sums, &found_sums).is_err() && compare::pixels(1e-5, 0, &sample, &found).is_err());
    }
}

/// The sum of 1, 2, ... n is n (n + 1) / 2, and their mean is (n + 1) / 2.
#[test]
fn the_mean_of_whole_numbers_is_known() {
    let (mut radiance, mut sums) = (vec![[1.0; 4]], vec![[1.0; 4]]);
    for n in 2..=100_u32 {
        radiance[0] = [n as f32; 4];
        let frame = Frame { n_samples: n, ..Frame::default() };
        reference::accumulate::accumulate(&frame, &[], &mut radiance, &mut sums);
        assert_eq!((sums[0], radiance[0]), ([(n * (n + 1) / 2) as f32; 4], [(n + 1) as f32 / 2.0; 4]));
    }
}

#[test]
fn nothing_is_added_where_a_queue_overflowed() {
    let stage = stage(9, 5, 2);
    let (sample, sums) = (some(45, 1), some(45, 2));
    let mut bounces = [Bounce::default(); 3];
    bounces[0].any_overflow = 1;
    let (found, found_sums) = accumulated(&stage, &bounces, &sample, &sums);
    compare::exact(&sample, &found).unwrap();
    compare::exact(&sums, &found_sums).unwrap();
    let (mut twin, mut twin_sums) = (sample.clone(), sums.clone());
    reference::accumulate::accumulate(stage.resources.constants(), &bounces, &mut twin, &mut twin_sums);
    assert_eq!((twin, twin_sums), (sample.clone(), sums.clone()));
}
