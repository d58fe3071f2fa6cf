//! Tests that the number of lanes per ray, and how they run, does not change the picture.

use kdray::{
    frame::{Primary, RenderOptions},
    gpu::Context,
    render::GpuRenderer,
};

use super::studio::{assert_silent, identical, options, world_of};
use crate::support::{scenes, with_lanes};

#[test]
fn a_device_with_lanes_to_spare_gives_the_same_bits() {
    let scene = scenes::mixed();
    // So few rays leave lanes of a GPU idle, so it is taken for a device with a single lane.
    let (world, plain) = (world_of(&scene), with_lanes(1));
    let options = RenderOptions { primary: Primary::Trace, ..options(40, 30, 4) };
    let picture = |context: &std::sync::Arc<Context>| {
        let mut renderer = GpuRenderer::new(context.clone(), &world, &options).expect("a renderer");
        let picture = renderer.render().expect("a frame").0;
        let lanes_log2: Vec<_> =
            renderer.resources().bounces.download().expect("bounces").iter().map(|row| row.trace_lanes_log2).collect();
        (picture, lanes_log2)
    };
    let (expected, lanes_log2) = picture(&plain);
    assert!(lanes_log2.iter().all(|&log2| log2 == 0), "{lanes_log2:?}");
    // Later bounces have fewer rays, and so more lanes per ray.
    let spare = with_lanes(3000);
    let (found, lanes_log2) = picture(&spare);
    assert!(lanes_log2[0] == 1 && lanes_log2.is_sorted() && lanes_log2[3] > 1, "{lanes_log2:?}");
    assert!(identical(&expected, &found));
    assert_silent(&plain);
    assert_silent(&spare);
}
