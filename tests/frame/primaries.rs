//! Tests that rasterized primary visibility gives the picture of traced primary rays, except for pixels on edges.

use std::collections::HashSet;

use glam::UVec2;
use kdray::{
    accel::kdtree::Traversal,
    engine::choices::{Processor, primary_by_rule, traversal_by_rule},
    frame::{Crop, Picture, Primary, RenderOptions},
    layout::Frame,
    reference::{
        inputs::KernelInputs,
        primary_hit::camera_ray,
        traverser::{Tracer, Traverser},
    },
    render::GpuRenderer,
    world::{FlatScene, World},
};

use super::studio::{assert_silent, device, differing, identical, on_cpu, on_device, options, world_of};
use crate::support::{scenes, with_lanes, without_wide_atomics};

/// Returns whether rays within 1/8 px of the pixel's centre meet more than one triangle. The rasterizer snaps corners
/// to a grid of 1/16 px or finer.
fn is_on_edge(world: &World, options: &RenderOptions, pixel_ix: usize) -> bool {
    let frame = world.frame_constants(options);
    let pixel = UVec2::new(pixel_ix as u32 % frame.width, pixel_ix as u32 / frame.width);
    let mut traverser = Traverser::new(&KernelInputs::new(world, &frame), options.traversal);
    let ids: HashSet<u32> = (0..25 * 25)
        .map(|i| {
            let [x, y] = [i % 25, i / 25].map(|i| (i - 12) as f32 / 96.0);
            let frame = Frame { sample_x: frame.sample_x + x, sample_y: frame.sample_y + y, ..frame };
            traverser
                .traverse::<false>(&KernelInputs::new(world, &frame), &(&camera_ray(&frame, pixel)).into())
                .triangle_ix
        })
        .collect();
    ids.len() > 1
}

/// Returns the number of pixels that differ, and those of them that are not on an edge.
fn off_edges(scene: &FlatScene, options: &RenderOptions, a: &Picture, b: &Picture) -> (usize, Vec<usize>) {
    let world = world_of(scene);
    let differing = differing(a, b, 0.0);
    let n = differing.len();
    (n, differing.into_iter().filter(|&i| !is_on_edge(&world, options, i)).collect())
}

#[test]
fn raster_and_trace_differ_only_on_edges() {
    let orthographic = scenes::orthographic(scenes::mixed_outdoors());
    for (scene, max_depth) in [(scenes::mixed(), 1), (scenes::mixed_outdoors(), 4), (orthographic, 4)] {
        let raster = options(120, 90, max_depth);
        let trace = RenderOptions { primary: Primary::Trace, ..raster.clone() };
        for (name, render) in [("device", on_device as fn(&_, &_) -> _), ("cpu", on_cpu)] {
            let (a, b) = (render(&scene, &raster), render(&scene, &trace));
            let (n_differing, wrong) = off_edges(&scene, &raster, &a, &b);
            assert_eq!(wrong, [0usize; 0], "{name}, {max_depth} levels");
            assert!(n_differing <= a.radiance.len() / 50, "{name}: {n_differing} pixels differ");
        }
    }
}

/// The picture of the rasterizing kernels is that of traced rays, to the last bit, also in batches, crops and
/// samples.
#[test]
fn compute_and_trace_are_the_same() {
    let trace = RenderOptions { primary: Primary::Trace, ..options(120, 90, 4) };
    let crop = Some(Crop { x0: 33, y0: 0, x1: 120, y1: 41 });
    let perspective = scenes::mixed_outdoors();
    let orthographic = scenes::orthographic(perspective.clone());
    let compute_and_trace = |scene: &FlatScene, options: &RenderOptions, n_samples: u32, capacity: u32| {
        let context = device();
        [Primary::SoftwareRaster, Primary::Trace].map(|primary| {
            let options = RenderOptions { primary, ..options.clone() };
            let world = world_of(scene);
            let mut renderer =
                GpuRenderer::with_queue_capacity(context.clone(), &world, &options, capacity).expect("a renderer");
            (0..n_samples).for_each(|_| drop(renderer.draw_sample().expect("a sample")));
            assert_silent(&context);
            renderer.picture().expect("a picture")
        })
    };
    if !device().has_int64_atomics() {
        return;
    }
    let cropped = RenderOptions { crop, ..trace.clone() };
    for (scene, options, n_samples, capacity) in [
        (&perspective, &trace, 1, 1 << 20),
        (&perspective, &cropped, 3, 1 << 20),
        (&perspective, &trace, 2, 4000),
        (&orthographic, &trace, 2, 4000),
        (&orthographic, &cropped, 3, 1 << 20),
    ] {
        let [compute, trace] = compute_and_trace(scene, options, n_samples, capacity);
        assert!(identical(&compute, &trace), "{n_samples} samples, room for {capacity} rays");
    }
}

/// The default method depends on the work and on the device's memory. A device that does not predicate branches
/// counts as a GPU.
#[test]
fn ways_suit_the_device() {
    let gpu = with_lanes(1000);
    let suited = |n_triangles| primary_by_rule(Some(&gpu), n_triangles, (100, 80));
    let software_raster = if gpu.has_int64_atomics() { Primary::SoftwareRaster } else { Primary::Trace };
    assert_eq!([suited(8001), suited(usize::MAX)], [software_raster, Primary::Trace]);
    let without = without_wide_atomics();
    let n_raster = if without.predicates_branches() { 4 * 8000 } else { 8000 };
    let suited = [n_raster, n_raster + 1].map(|n| primary_by_rule(Some(&without), n, (100, 80)));
    assert_eq!(suited, [Primary::Raster, Primary::Trace]);
    let way = if without.predicates_branches() { Traversal::Ropes } else { Traversal::Mask };
    let suited = [Some(&*gpu), Some(&*without), None].map(|context| traversal_by_rule(Processor::of(context)));
    assert_eq!(suited, [Traversal::Mask, way, Traversal::Stack]);
}

/// A renderer allocates the buffers of another method when its options change.
#[test]
fn primaries_change_between_frames() {
    let context = device();
    let (scene, raster) = (scenes::mixed(), options(60, 45, 2));
    let world = world_of(&scene);
    let mut renderer = GpuRenderer::new(context.clone(), &world, &raster).expect("a renderer");
    let mut pictures = Vec::new();
    let all = if context.has_int64_atomics() { Primary::ALL } else { &[Primary::Raster, Primary::Trace] };
    for &primary in all.iter().chain(all) {
        let options = RenderOptions { primary, ..raster.clone() };
        renderer.set_options(&options).expect("other options");
        pictures.push((primary, renderer.render().expect("a frame").0));
        assert_eq!(pictures.last().unwrap().1, on_device(&scene, &options), "{primary}");
    }
    assert_silent(&context);
    let (first, second) = pictures.split_at(all.len());
    assert!(first == second);
}

#[test]
fn a_pixel_off_the_edges_is_noticed() {
    let (scene, options) = (scenes::mixed(), options(120, 90, 1));
    let picture = on_cpu(&scene, &options);
    let mut changed = picture.clone();
    // At least one of ten pixels in a row is not on an edge.
    (500..510).for_each(|i| changed.radiance[i][0] += 0.1);
    assert!(!off_edges(&scene, &options, &picture, &changed).1.is_empty());
}
