//! Tests of the kernel path_begin against its twin: the camera rays of all samples of all pixels.

use kdray::{
    layout::{PathRay, PathState, SHADOW_RAY_NONE},
    scene::Projection,
};

use super::path_stage::PathStage;
use crate::support::scenes;

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
            // Vulkan allows sines and cosines an absolute error of 2^-11, and SwiftShader has several times that.
            let is_near = |a: &PathRay, b: &PathRay| {
                a.origin.distance(b.origin) <= 5.0e-3 * aperture + 1e-5
                    && a.direction.distance(b.direction) <= 5.0e-3 * aperture + 1e-4
                    && (a.pixel_ix, a.source_triangle) == (b.pixel_ix, b.source_triangle)
            };
            let differing = expected.iter().zip(&found).position(|(a, b)| !is_near(a, b));
            let pair = differing.map(|ix| (expected[ix], found[ix]));
            assert!(differing.is_none(), "{filter}, {aperture}: {pair:?}");
            let moved = PathRay { origin: expected[0].origin + 0.01, ..expected[0] };
            assert!(!is_near(&expected[0], &moved));
            let is_unlike = |ray: &&PathRay| ray.direction != expected[0].direction;
            let is_perspective = matches!(stage.world.scene().camera.projection, Projection::Perspective { .. });
            assert!(!is_perspective || found.iter().filter(is_unlike).count() > 1000);
            let paths = stage.paths();
            let live = paths.live_paths.download_first(expected.len()).expect("live_paths");
            assert!(live.iter().copied().eq(0..expected.len() as u32));
            assert!(paths.path_states.download().expect("path_states").iter().all(|s| *s == PathState::default()));
            assert!(paths.shadow_rays.download().expect("shadow_rays").iter().all(|s| s.state == SHADOW_RAY_NONE));
        }
    }
}
