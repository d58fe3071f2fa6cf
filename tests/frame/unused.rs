//! Tests that buffers and passes that the options do not need are not made, so that they cost no memory and no time.

use kdray::{
    buffers::Resources,
    frame::{Primary, RenderOptions},
    render::GpuRenderer,
    world::FlatScene,
};

use super::studio::{assert_silent, device, identical, options, world_of};
use crate::support::{kept, scenes};

const SIZE: (u32, u32) = (24, 18);

fn with(primary: Primary) -> RenderOptions {
    RenderOptions { primary, ..options(SIZE.0, SIZE.1, 2) }
}

/// Asserts that the graphics pipeline's indices and targets exist if it is used, and do not exist otherwise.
fn assert_drawn_by(resources: &Resources, scene: &FlatScene, primary: Primary) {
    let pixels = &resources.pixels;
    let found = (
        resources.vertex_indices.as_ref().map(|indices| indices.len()),
        pixels.depth.as_ref().map(|depth| depth.size()),
        pixels.triangle_ids.size(),
    );
    let expected = match primary {
        Primary::Raster => (Some(3 * scene.triangles.len()), Some(SIZE), SIZE),
        Primary::SoftwareRaster | Primary::Trace => (None, None, (1, 1)),
    };
    assert_eq!(found, expected, "{primary}");
}

fn indices(renderer: &GpuRenderer) -> Vec<u32> {
    renderer.resources().vertex_indices.as_ref().expect("indices").download().expect("indices")
}

#[test]
fn only_what_draws_has_indices_and_targets() {
    if kept::leaves_out("the vertex indices of flat triangles") {
        return;
    }
    let (scene, context) = (scenes::mixed_outdoors(), device());
    let world = world_of(&scene);
    let new = |primary| GpuRenderer::new(context.clone(), &world, &with(primary)).expect("a renderer");
    let mut drawing = new(Primary::Raster);
    let drawn = drawing.render().expect("a frame").0;
    let ways = [Primary::Trace, Primary::SoftwareRaster];
    for from in ways.into_iter().filter(|&way| way == Primary::Trace || context.has_int64_atomics()) {
        let mut renderer = new(from);
        assert_drawn_by(renderer.resources(), &scene, from);
        let before = renderer.render().expect("a frame").0;
        renderer.set_options(&with(Primary::Raster)).expect("options");
        assert_drawn_by(renderer.resources(), &scene, Primary::Raster);
        assert_eq!(indices(&renderer), indices(&drawing));
        assert!(identical(&renderer.render().expect("a frame").0, &drawn), "{from}");
        renderer.set_options(&with(from)).expect("options");
        assert_drawn_by(renderer.resources(), &scene, from);
        assert!(identical(&renderer.render().expect("a frame").0, &before), "{from}");
    }
    assert_drawn_by(drawing.resources(), &scene, Primary::Raster);
    assert_silent(&context);
}
