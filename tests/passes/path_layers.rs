//! Tests of the kernel path_layers against its twin, to the last bit, and of what the layers add up to.

use glam::Vec3;
use kdray::{
    frame::RenderOptions,
    layout::{Batch, LIGHT_LAYERS, PathState},
    reference::path_layers::path_layers,
};

use super::{path_stage::PathStage, stage::UNTOUCHED_PIXEL};
use crate::support::{compare, random::Random, scenes};

/// Three states of the radiance of all paths, in which it grows.
fn growing_states(n_paths: usize, random: &mut Random) -> Vec<Vec<PathState>> {
    let mut states = vec![PathState { radiance: Vec3::ZERO, pdf: 1.0 }; n_paths];
    let mut grow = |_| {
        states.iter_mut().for_each(|state| state.radiance += random.in_box(Vec3::ZERO, Vec3::splat(9.0)));
        states.clone()
    };
    (0..LIGHT_LAYERS).map(&mut grow).collect()
}

#[test]
fn agrees_with_its_twin() {
    for samples_log2 in 0..=4 {
        let options = RenderOptions { light_layers: true, ..RenderOptions::default() };
        let stage = PathStage::with_layers(scenes::mixed(), samples_log2, &options);
        let kernel = stage.passes.path_layers.as_ref().expect("the options ask for layers");
        let mut random = Random(u64::from(samples_log2));
        let states = growing_states(1200 << samples_log2, &mut random);
        let radiance = &stage.resources.pixels.pixel_radiance;
        radiance.upload(&vec![UNTOUCHED_PIXEL; 1200 * (1 + LIGHT_LAYERS as usize)]).expect("pixel_radiance");
        let mut snapshots = vec![[7.0; 4]; states[0].len()];
        stage.paths().path_snapshots.upload(&snapshots).expect("path_snapshots");
        let mut expected = vec![UNTOUCHED_PIXEL; 1200 * LIGHT_LAYERS as usize];
        // The last layer is that of any depth from 2 on.
        for (states, depth) in states.iter().zip([0, 1, 5]) {
            let batch = Batch { depth, ..stage.batch() };
            stage.paths().path_states.upload(states).expect("path_states");
            stage.run(|commands| kernel.record(commands, &batch));
            path_layers(stage.frame(), &batch, states, &mut snapshots, &mut expected);
            let found = radiance.download().expect("pixel_radiance");
            compare::exact(&[UNTOUCHED_PIXEL; 1200], &found[..1200]).unwrap();
            compare::exact(&expected, &found[1200..]).unwrap();
            compare::exact(&snapshots, &stage.paths().path_snapshots.download().expect("path_snapshots")).unwrap();
        }
        // All layers together are the light of all paths.
        let of_layers: f64 = expected.iter().map(|pixel| f64::from(pixel[0])).sum();
        let of_paths: f64 = states[2].iter().map(|state| f64::from(state.radiance.x)).sum();
        assert!((of_layers - of_paths).abs() < 1e-6 * of_paths, "{of_layers}, {of_paths}");
    }
}
