//! Tests of the kernel path_begin against its twin: the camera rays of all samples of all pixels.

use kdray::{
    layout::{PathState, SEGMENT_NONE},
    scene::Projection,
};

use super::path_stage::PathStage;
use crate::support::{compare, scenes};

#[test]
fn agrees_with_its_twin() {
    for (scene, samples_log2) in [(scenes::mixed(), 2), (scenes::orthographic(scenes::mixed()), 0)] {
        let mut stage = PathStage::new(scene, samples_log2);
        for (filter, aperture) in [(0, 0.0), (1, 0.2), (2, 0.01)] {
            let mut frame = *stage.frame();
            (frame.pixel_filter, frame.aperture, frame.range_begin) = (filter, aperture, 32);
            frame.set_view(&stage.world.scene().camera, stage.world.bounds(), 64);
            stage.resources.set_constants(&frame);
            stage.resources.frame.upload(&[frame]).expect("constants");
            stage.run(|commands| stage.passes.path_begin.record(commands, &stage.resources, &stage.batch()));
            let (expected, _) = stage.rays_and_hits();
            let found = stage.resources.queue.rays.download().expect("rays");
            compare::rays(2e-6, 0, &expected, &found).unwrap();
            let is_unlike = |ray: &&kdray::layout::PathRay| ray.direction != expected[0].direction;
            let is_perspective = matches!(stage.world.scene().camera.projection, Projection::Perspective { .. });
            assert!(!is_perspective || found.iter().filter(is_unlike).count() > 1000);
            let paths = stage.paths();
            let live = paths.live_paths.download_first(expected.len()).expect("live_paths");
            assert!(live.iter().copied().eq(0..expected.len() as u32));
            assert!(paths.path_states.download().expect("path_states").iter().all(|s| *s == PathState::default()));
            assert!(paths.segments.download().expect("segments").iter().all(|s| s.state == SEGMENT_NONE));
        }
    }
}
