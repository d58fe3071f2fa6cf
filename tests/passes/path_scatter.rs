//! Tests of the kernel path_scatter against its twin: the light at the hits of paths, the segments to lights, and the
//! rays with which they go on.

use glam::Vec3;
use kdray::{
    layout::{Batch, PathRay, PathState, SCAN_GROUP_SIZE, SEGMENT_NONE, Segment},
    reference::path_scatter::{PathBuffers, path_scatter},
};

use super::{
    path_stage::PathStage,
    stage::{FIRST, RAY_COUNTS, UNTOUCHED_WORD},
};
use crate::support::{compare, meshes, random::Random, scenes};

const NO_SEGMENT: Segment = Segment {
    origin: Vec3::ZERO,
    state: SEGMENT_NONE,
    direction: Vec3::ZERO,
    source_triangle: 0,
    light: Vec3::ZERO,
    t_max: 0.0,
};

/// A path's segment as a ray, so that it can be compared as one.
fn as_ray(segment: &Segment) -> PathRay {
    PathRay {
        origin: segment.origin,
        pixel_ix: segment.state,
        direction: segment.direction,
        source_triangle: segment.source_triangle,
        throughput: segment.light,
        t_max: segment.t_max,
    }
}

#[test]
fn agrees_with_its_twin() {
    let mut scene = scenes::mixed();
    scenes::add(&mut scene, meshes::torus(6, 5), scenes::emissive(Vec3::new(3.0, 2.0, 1.0)));
    for depth in [0, 1, 3] {
        let stage = PathStage::new(scene.clone(), 0);
        let (rays, hits) = stage.rays_and_hits();
        let paths = stage.paths();
        let mut random = Random(5);
        for n in RAY_COUNTS.map(|n| n.min(1200)) {
            let live: Vec<u32> = (0..n).collect();
            let states: Vec<_> = (0..1200)
                .map(|ix| PathState { radiance: random.in_box(Vec3::ZERO, Vec3::ONE), density: (ix % 2) as f32 })
                .collect();
            let mut list = live.clone();
            list.resize(2400, u32::MAX);
            list.copy_within(..1200, 1200);
            let mut rows = vec![0; depth];
            rows.push(n);
            stage.set_n_paths(&rows);
            stage.resources.queue.rays.upload(&rays).expect("rays");
            stage.resources.queue.hits.upload(&hits).expect("hits");
            stage.resources.queue.child_kinds.upload(&[UNTOUCHED_WORD; 1200]).expect("child_kinds");
            paths.path_states.upload(&states).expect("path_states");
            paths.segments.upload(&[NO_SEGMENT; 1200]).expect("segments");
            paths.live_paths.upload(&list).expect("live_paths");
            let batch = Batch { n_pixels: 1200, bounce_ix: depth as u32, depth: depth as u32, ..FIRST };
            stage.run(|commands| stage.passes.path_scatter.record(commands, &stage.resources, &batch));

            let (mut rays, mut states, mut segments) = (rays.clone(), states, vec![NO_SEGMENT; 1200]);
            let mut kinds = vec![UNTOUCHED_WORD; 1200];
            let mut blocks = vec![0; n.div_ceil(SCAN_GROUP_SIZE) as usize];
            let buffers = PathBuffers { rays: &mut rays, states: &mut states, segments: &mut segments };
            let counts = (&mut kinds[..n as usize], &mut blocks[..]);
            path_scatter(&stage.inputs(), &batch, (&live, &hits), buffers, counts);
            // Where rounding decides which lobe or which light is chosen, a path takes another way.
            let n_outliers = n as usize / 50;
            let queue = &stage.resources.queue;
            let found = queue.child_kinds.download().expect("child_kinds");
            compare::exact_but_for(n_outliers, &kinds, &found).unwrap();
            let of_block = |kinds: &[u32]| kinds.iter().sum::<u32>();
            let sums: Vec<_> = found[..n as usize].chunks(SCAN_GROUP_SIZE as usize).map(of_block).collect();
            compare::exact(&sums, &queue.scan_blocks.download_first(blocks.len()).expect("scan_blocks")).unwrap();
            compare::rays(1e-3, n_outliers, &rays, &queue.rays.download().expect("rays")).unwrap();
            let found: Vec<_> = paths.segments.download().expect("segments").iter().map(as_ray).collect();
            let expected: Vec<_> = segments.iter().map(as_ray).collect();
            compare::rays(1e-3, n_outliers, &expected, &found).unwrap();
            let pixels = |states: &[PathState]| -> Vec<_> {
                states.iter().map(|s| s.radiance.extend(s.density).to_array()).collect()
            };
            let found = paths.path_states.download().expect("path_states");
            compare::pixels(1e-3, n_outliers, &pixels(&states), &pixels(&found)).unwrap();
            let n_lit = segments.iter().filter(|segment| segment.state != SEGMENT_NONE).count();
            let n_going_on = of_block(&kinds[..n as usize]);
            let is_last = depth == 3;
            assert!(n < 1000 || is_last || (n_lit > 200 && n_going_on > 500), "{n_lit} lit, {n_going_on} go on");
            assert!(!is_last || (n_lit, n_going_on) == (0, 0));
        }
    }
}
