//! Tests of the kernel path_trace against its twin: hits of the paths that are alive, and the light of segments that
//! nothing blocks.

use glam::Vec3;
use kdray::{
    layout::{Batch, PathState, SEGMENT_NONE, SEGMENT_WAITS, Segment},
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
    let segment = |random: &mut Random, ix: usize| Segment {
        origin: rays[ix].origin + rays[ix].direction * (0.999 * all_hits[ix].t),
        state: if random.unit() < 0.7 { SEGMENT_WAITS } else { SEGMENT_NONE },
        direction: random.direction(),
        source_triangle: all_hits[ix].triangle_ix,
        light: random.in_box(Vec3::ZERO, Vec3::ONE),
        t_max: random.between(0.1, 3.0),
    };
    for n in RAY_COUNTS.map(|n| n.min(1200)) {
        // Every path of the bounce before has a segment or none, and is alive or not.
        let live: Vec<u32> = (0..n).filter(|_| random.unit() < 0.6).collect();
        let segments: Vec<_> = (0..1200).map(|ix| segment(&mut random, ix)).collect();
        let with_segment: Vec<u32> = (0..n).filter(|&ix| segments[ix as usize].state != SEGMENT_NONE).collect();
        let states: Vec<_> =
            (0..1200).map(|_| PathState { radiance: random.in_box(Vec3::ZERO, Vec3::ONE), pdf: 0.5 }).collect();
        let mut lists = live.clone();
        lists.resize(2400, u32::MAX);
        lists.extend(&with_segment);
        lists.resize(3600, u32::MAX);
        stage.set_n_paths(&[(0, 0), (n, with_segment.len() as u32), (live.len() as u32, 0)]);
        stage.resources.queue.rays.upload(&rays).expect("rays");
        stage.resources.queue.hits.upload(&[UNTOUCHED_HIT; 1200]).expect("hits");
        paths.path_states.upload(&states).expect("path_states");
        paths.segments.upload(&segments).expect("segments");
        paths.live_paths.upload(&lists).expect("live_paths");
        // Bounce 2 has the first list.
        stage.trace(&Batch { n_pixels: 1200, bounce_ix: 2, depth: 2, ..FIRST });

        let (inputs, traversal) = (stage.inputs(), stage.options.traversal);
        let (mut hits, mut states, mut segments) = (vec![UNTOUCHED_HIT; 1200], states, segments);
        let n_hits = path_trace::closest_hits(&inputs, traversal, &live, &rays, &mut hits);
        path_trace::segments(&inputs, traversal, &with_segment, &mut segments, &mut states);
        let n_segments = with_segment.len() as u32;
        let n_outliers = if stage.context.is_software() { 0 } else { n as usize / 500 };
        compare::hits(n_outliers, &hits, &stage.resources.queue.hits.download().expect("hits")).unwrap();
        let found = paths.path_states.download().expect("path_states");
        compare::exact_but_for(n_outliers, &states, &found).unwrap();
        compare::exact(&segments, &paths.segments.download().expect("segments")).unwrap();
        let counters = stage.resources.counters().expect("counters");
        assert_eq!((counters[2].n_hits, counters[1].n_shadow_rays), (n_hits, n_segments));
        assert!(n < 1000 || (n_segments > 600 && n_hits > 500), "{n_segments} segments, {n_hits} hits");
    }
}
