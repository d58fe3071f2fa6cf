//! Shadow against its twin, from the same hits.

use kdray::{
    cpu,
    frame::{RenderOptions, Traversal},
};

use super::stage::{FIRST, RAY_COUNTS, Stage, UNTOUCHED_WORD, hits_of, options, some_rays};
use crate::support::{compare, scenes};

fn check(stage: &Stage, n_rays: u32) {
    let rays = some_rays(stage, n_rays);
    let hits = hits_of(stage, &rays);
    let mut expected = vec![UNTOUCHED_WORD; stage.resources.queues.light_visibility.len()];
    let n_tested = cpu::shadow::shadow(&stage.bindings(), stage.options.traversal, &rays, &hits, &mut expected);
    stage.set_n_rays(n_rays);
    stage.set_rays(&rays);
    stage.set_hits(&hits);
    stage.resources.queues.light_visibility.upload(&vec![UNTOUCHED_WORD; expected.len()]).expect("light_visibility");
    stage.run(&FIRST, |commands| stage.passes.shadow.record(commands, &stage.resources, &FIRST));
    let n_outliers = stage.n_outliers(n_rays * stage.scene.lights.len() as u32);
    let found = stage.resources.queues.light_visibility.download().expect("light_visibility");
    compare::exact_but_for(n_outliers, &expected, &found).unwrap();
    assert!(stage.counters().n_shadow_rays.abs_diff(n_tested) as usize <= n_outliers, "{n_rays} rays");
}

#[test]
fn agrees_with_its_twin() {
    for &traversal in Traversal::ALL {
        let stage = Stage::new(scenes::mixed_outdoors(), RenderOptions { traversal, ..options(8, 8) }, 2010);
        RAY_COUNTS.into_iter().for_each(|n| check(&stage, n));
    }
}
