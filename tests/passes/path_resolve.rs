//! Tests of the kernel path_resolve against its twin, to the last bit, and against sums in double precision.

use glam::Vec3;
use kdray::{layout::PathState, reference::path_resolve::path_resolve};

use super::{path_stage::PathStage, stage::UNTOUCHED_PIXEL};
use crate::support::{compare, random::Random, scenes};

#[test]
fn agrees_with_its_twin() {
    for samples_log2 in 0..=4 {
        let stage = PathStage::new(scenes::mixed(), samples_log2);
        let mut random = Random(u64::from(samples_log2));
        let state = |_| PathState { radiance: random.in_box(Vec3::ZERO, Vec3::splat(9.0)), pdf: 1.0 };
        let states: Vec<_> = (0..1200 << samples_log2).map(state).collect();
        stage.paths().path_states.upload(&states).expect("path_states");
        stage.run(|commands| stage.passes.path_resolve.record(commands, &stage.batch()));
        let mut expected = vec![UNTOUCHED_PIXEL; 1200];
        path_resolve(stage.frame(), &stage.batch(), &states, &mut expected);
        let found = stage.resources.pixels.pixel_radiance.download().expect("pixel_radiance");
        compare::exact(&expected, &found).unwrap();
        let sum = |states: &mut dyn Iterator<Item = &PathState>| states.map(|s| f64::from(s.radiance.x)).sum::<f64>();
        let of_pixels: f64 = found.iter().map(|pixel| f64::from(pixel[0])).sum();
        let of_states = sum(&mut states.iter());
        assert!((of_pixels - of_states).abs() < 1e-6 * of_states, "{of_pixels}, {of_states}");
    }
}
