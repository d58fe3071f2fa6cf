//! Tests of the kernel path_accumulate against its twin, to the last bit, and against means in double precision.

use kdray::reference::path_accumulate::path_accumulate;

use super::path_stage::PathStage;
use crate::support::{compare, random::Random, scenes};

#[test]
fn agrees_with_its_twin() {
    let mut stage = PathStage::new(scenes::mixed(), 0);
    stage.resources.make_room_for_sums(&stage.context.clone(), 8).expect("sums");
    let mut random = Random(8);
    let (mut sums, mut total) = (Vec::new(), vec![0.0; 1200]);
    let mut n_samples = 0;
    // Numbers of samples whose sums are joined, kept apart, and joined again.
    for log2 in [4, 4, 4, 3, 3, 2, 1, 0, 0, 3] {
        let mut frame = *stage.frame();
        frame.samples_log2 = log2;
        n_samples += 1 << log2;
        frame.n_samples = n_samples;
        frame.samples_reciprocal = 1.0 / n_samples as f32;
        stage.resources.set_constants(&frame);
        stage.resources.frame.upload(&[frame]).expect("constants");
        let samples: Vec<[f32; 4]> = (0..1200).map(|_| [0; 4].map(|_| random.between(0.0, 5.0))).collect();
        total.iter_mut().zip(&samples).for_each(|(sum, sample)| *sum += f64::from(sample[0]));
        stage.resources.pixels.pixel_radiance.upload(&samples).expect("pixel_radiance");
        stage.run(|commands| stage.passes.path_accumulate.record(commands, &stage.resources));
        let mut expected = samples;
        path_accumulate(&frame, &mut expected, &mut sums);
        let found = stage.resources.pixels.pixel_radiance.download().expect("pixel_radiance");
        compare::exact(&expected, &found).unwrap();
        for (pixel, sum) in found.iter().zip(&total) {
            let mean = sum / f64::from(n_samples);
            assert!((f64::from(pixel[0]) - mean).abs() < 1e-6 * mean, "{n_samples}: {}, {mean}", pixel[0]);
        }
    }
}
