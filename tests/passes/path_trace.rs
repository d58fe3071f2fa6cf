//! Tests of the kernel path_trace against its twin: hits of the paths that are alive, and the light of shadow rays that
//! nothing blocks.

use glam::Vec3;
use kdray::{
    layout::{Batch, PathState, SHADOW_RAY_NONE, SHADOW_RAY_WAITS, ShadowRay},
    reference::path_trace,
};

use super::{
    path_stage::PathStage,
    stage::{FIRST, RAY_COUNTS, UNTOUCHED_HIT},
};
use crate::support::{compare, random::Random, scenes};

#[test]
fn agrees_with_its_twin() {
    let stage = PathStage::new(scenes::mixed(), 0);
    let (rays, all_hits) = stage.rays_and_hits();
    let paths = stage.paths();
    let mut random = Random(3);
    let shadow_ray = |random: &mut Random, ix: usize| ShadowRay {
        origin: rays[ix].origin + rays[ix].direction * (0.999 * all_hits[ix].t),
        state: if random.unit() < 0.7 { SHADOW_RAY_WAITS } else { SHADOW_RAY_NONE },
        direction: random.direction(),
        source_triangle: all_hits[ix].triangle_ix,
        light: random.in_box(Vec3::ZERO, Vec3::ONE),
        t_max: random.between(0.1, 3.0),
    };
    for n in RAY_COUNTS.map(|n| n.min(1200)) {
        // Every path of the bounce before has a shadow ray or none, and is alive or not.
        let live: Vec<u32> = (0..n).filter(|_| random.unit() < 0.6).collect();
        let shadow_rays: Vec<_> = (0..1200).map(|ix| shadow_ray(&mut random, ix)).collect();
        let with_shadow_ray: Vec<u32> =
            (0..n).filter(|&ix| shadow_rays[ix as usize].state != SHADOW_RAY_NONE).collect();
        let states: Vec<_> =
            (0..1200).map(|_| PathState { radiance: random.in_box(Vec3::ZERO, Vec3::ONE), pdf: 0.5 }).collect();
        let mut lists = live.clone();
        lists.resize(2400, u32::MAX);
        lists.extend(&with_shadow_ray);
        lists.resize(3600, u32::MAX);
        stage.set_n_paths(&[(0, 0), (n, with_shadow_ray.len() as u32), (live.len() as u32, 0)]);
        stage.resources.queue.rays.upload(&rays).expect("rays");
        stage.resources.queue.hits.upload(&[UNTOUCHED_HIT; 1200]).expect("hits");
        paths.path_states.upload(&states).expect("path_states");
        paths.shadow_rays.upload(&shadow_rays).expect("shadow_rays");
        paths.live_paths.upload(&lists).expect("live_paths");
        // Bounce 2 has the first list.
        let batch = Batch { n_pixels: 1200, bounce_ix: 2, depth: 2, ..FIRST };
        stage.trace(&batch);

        let (inputs, traversal) = (stage.inputs(), stage.options.traversal);
        let (mut hits, mut states, mut shadow_rays) = (vec![UNTOUCHED_HIT; 1200], states, shadow_rays);
        let n_hits = path_trace::closest_hits(&inputs, &batch, traversal, (&live, &rays), &mut hits);
        path_trace::shadow_rays(&inputs, &batch, traversal, &with_shadow_ray, (&mut shadow_rays, &mut states));
        let n_shadow_rays = with_shadow_ray.len() as u32;
        let n_outliers = if stage.context.is_software() { 0 } else { n as usize / 500 };
        compare::hits(n_outliers, &hits, &stage.resources.queue.hits.download().expect("hits")).unwrap();
        let found = paths.path_states.download().expect("path_states");
        compare::exact_but_for(n_outliers, &states, &found).unwrap();
        compare::exact(&shadow_rays, &paths.shadow_rays.download().expect("shadow_rays")).unwrap();
        let counters = stage.resources.counters().expect("counters");
        assert_eq!((counters[2].n_hits, counters[1].n_shadow_rays), (n_hits, n_shadow_rays));
        assert!(n < 1000 || (n_shadow_rays > 600 && n_hits > 500), "{n_shadow_rays} shadow_rays, {n_hits} hits");
    }
}
