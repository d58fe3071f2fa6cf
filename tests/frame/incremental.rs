//! Tests that a sample drawn in batches is the same, bit for bit, as one drawn at once, and is not visible before it is
//! complete.

use glam::uvec2;
use kdray::{
    frame::{FrameRenderer, Picture, RenderOptions, View},
    render::{Displayed, GpuRenderer},
    scene::{Camera, Projection},
};

use super::{
    batches::glass_in_glass,
    studio::{assert_silent, device, identical, options, world_of},
};

fn options_of_batches() -> RenderOptions {
    options(32, 24, 5)
}

/// Draws `n_samples` samples in batches. Returns the picture and the number of batches.
fn in_batches(renderer: &mut GpuRenderer, n_samples: u32) -> (Picture, u32) {
    let mut n_batches = 0;
    while renderer.n_samples() < n_samples {
        assert_eq!(renderer.progress() > 0.0, renderer.is_pending());
        n_batches += 1;
        if let Some(profile) = renderer.draw_batch().expect("a batch") {
            assert_eq!(profile.bounces[0].n_rays, 32 * 24);
        }
    }
    assert!(!renderer.is_pending());
    (renderer.picture().expect("a picture"), n_batches)
}

fn at_once(renderer: &mut GpuRenderer, n_samples: u32) -> Picture {
    renderer.reset_samples();
    (0..n_samples).for_each(|_| drop(renderer.draw_sample().expect("a sample")));
    renderer.picture().expect("a picture")
}

#[test]
fn batches_make_the_same_picture() {
    let (scene, context) = (glass_in_glass(), device());
    let world = world_of(&scene);
    let mut renderer = GpuRenderer::new(context.clone(), &world, &options_of_batches()).expect("a renderer");
    let whole = [1, 3].map(|n_samples| at_once(&mut renderer, n_samples));
    for (most_pixels, n_batches) in [(None, 1), (Some(768), 1), (Some(767), 2), (Some(100), 8)] {
        renderer.limit_batches(most_pixels).expect("batches");
        for (n_samples, whole) in [1, 3].into_iter().zip(&whole) {
            renderer.reset_samples();
            let (picture, n) = in_batches(&mut renderer, n_samples);
            assert!(identical(&picture, whole), "{most_pixels:?}, {n_samples} samples");
            // There are more batches if a queue overflowed.
            assert!(n >= n_samples * n_batches, "{most_pixels:?}: {n} batches");
        }
        assert!(identical(&at_once(&mut renderer, 3), &whole[1]));
    }
    assert_silent(&context);
}

#[test]
fn what_is_dropped_half_way_leaves_no_trace() {
    let (scene, context, options) = (glass_in_glass(), device(), options_of_batches());
    let world = world_of(&scene);
    let mut renderer = GpuRenderer::new(context.clone(), &world, &options).expect("a renderer");
    let whole = at_once(&mut renderer, 3);
    renderer.limit_batches(Some(200)).expect("batches");
    for n_before in 0..3 {
        renderer.reset_samples();
        in_batches(&mut renderer, n_before);
        assert!(renderer.draw_batch().expect("a batch").is_none() && renderer.is_pending());
        // The sample is begun again, in other batches.
        renderer.limit_batches(Some(300 + n_before)).expect("batches");
        assert!(!renderer.is_pending());
        assert!(identical(&in_batches(&mut renderer, 3).0, &whole), "after {n_before} samples");
    }
    assert!(renderer.draw_batch().expect("a batch").is_none());
    let brighter = RenderOptions { exposure: 2.0, ..options.clone() };
    renderer.set_options(&brighter).expect("options");
    assert!(!renderer.is_pending() && renderer.n_samples() == 3);
    assert!(!identical(&in_batches(&mut renderer, 4).0, &at_once(&mut renderer, 3)));
    renderer.set_options(&options).expect("options");
    assert!(identical(&at_once(&mut renderer, 3), &whole));
    assert_silent(&context);
}

#[test]
fn batches_that_overflow_are_drawn_anew() {
    let (scene, context) = (glass_in_glass(), device());
    let world = world_of(&scene);
    let new = |capacity| {
        GpuRenderer::with_queue_capacity(context.clone(), &world, &options_of_batches(), capacity).expect("a renderer")
    };
    let whole = at_once(&mut new(100_000), 3);
    assert!(identical(&in_batches(&mut new(600), 3).0, &whole));
    assert_silent(&context);
}

#[test]
fn the_picture_changes_with_the_last_batch() {
    let (scene, context) = (glass_in_glass(), device());
    let world = world_of(&scene);
    let mut renderer = GpuRenderer::new(context.clone(), &world, &options_of_batches()).expect("a renderer");
    assert_eq!(renderer.displayed(), None);
    renderer.limit_batches(Some(400)).expect("batches");
    assert!(renderer.draw_batch().expect("a batch").is_none());
    assert_eq!(renderer.displayed(), None);
    assert!(renderer.draw_batch().expect("a batch").is_some());
    let seen_from = |camera: Camera, size| Some(Displayed { size, camera });
    assert_eq!(renderer.displayed(), seen_from(scene.camera, (32, 24)));
    let elsewhere = Camera { projection: Projection::Perspective { vertical_fov_degrees: 20.0 }, ..scene.camera };
    renderer.set_camera(&elsewhere);
    let before = renderer.displayed_picture().expect("a picture");
    assert!(renderer.draw_batch().expect("a batch").is_none());
    assert_eq!(renderer.displayed(), seen_from(scene.camera, (32, 24)), "what is seen is still the one before");
    assert_eq!(renderer.displayed_picture().expect("a picture"), before);
    assert!(renderer.draw_batch().expect("a batch").is_some());
    assert_eq!(renderer.displayed(), seen_from(elsewhere, (32, 24)));
    renderer.resize(16, 12).expect("a size");
    assert!(renderer.draw_batch().expect("a batch").is_some());
    assert_eq!(renderer.displayed(), seen_from(elsewhere, (16, 12)));
    renderer.resize(32, 24).expect("a size");
    assert!(renderer.draw_batch().expect("a batch").is_none());
    assert_eq!(renderer.displayed(), seen_from(elsewhere, (16, 12)), "what is seen is still the small one");
    let small = renderer.displayed_picture().expect("a picture").expect("one is shown");
    assert_eq!((small.width, small.height, small.display.len()), (16, 12, 16 * 12));
    renderer.resize(64, 48).expect("a size");
    assert_eq!(renderer.displayed(), None, "larger buffers hold nothing yet");
    assert_silent(&context);
}

#[test]
fn recordings_make_the_same_picture() {
    let (scene, context) = (glass_in_glass(), device());
    let world = world_of(&scene);
    let mut renderer = GpuRenderer::new(context.clone(), &world, &options_of_batches()).expect("a renderer");
    let whole = at_once(&mut renderer, 2);
    renderer.reset_samples();
    for _ in 0..2 {
        let mut shares = vec![0.0];
        while renderer.draw_next().expect("a recording").is_none() {
            shares.push(renderer.progress());
        }
        // There are recordings that begin and end the frame, and recordings for its bounces and their light. There are
        // more where rays can be suspended.
        assert!(shares.len() >= options_of_batches().max_depth as usize + 3);
        assert!(shares.is_sorted_by(|a, b| a < b) && shares.iter().all(|share| *share < 1.0), "{shares:?}");
    }
    assert!(identical(&renderer.picture().expect("a picture"), &whole));
    assert_silent(&context);
}

/// The views of depth, normals and triangles trace only primary rays, have the same AOVs, and leave the picture
/// as it is.
#[test]
fn views_of_first_hits_trace_primary_rays_only() {
    let (scene, context) = (glass_in_glass(), device());
    let world = world_of(&scene);
    let options = RenderOptions { pixel_aovs: true, ..options_of_batches() };
    let new = || GpuRenderer::new(context.clone(), &world, &options).expect("a renderer");
    let (mut whole, mut renderer) = (new(), new());
    let picture = at_once(&mut whole, 2);
    whole.draw().expect("a frame");
    let pixel_aovs = whole.pixel_aovs().expect("pixel_aovs");
    for (view, most_pixels) in [(View::Depth, None), (View::Normal, Some(200)), (View::Id, None)] {
        renderer.limit_batches(most_pixels).expect("batches");
        assert!(renderer.set_view(view, 1.0));
        assert!(renderer.draw_batch().expect("a batch").is_some() == most_pixels.is_none());
        renderer.reset_samples();
        let profile = renderer.draw_sample().expect("a sample");
        let names: Vec<_> = profile.passes.iter().map(|pass| pass.name).collect();
        for name in ["trace", "compact_reduce", "shadow", "shade", "resolve", "accumulate", "denoise"] {
            assert!(!names.contains(&name), "{view} runs {name}");
        }
        assert!(names.contains(&"primary_hit") && names.last() == Some(&"false_color"), "{view}: {names:?}");
        assert!(profile.bounces[0].n_rays == 32 * 24 && profile.bounces[1..].iter().all(|bounce| bounce.n_rays == 0));
        for (found, expected) in renderer.pixel_aovs().expect("pixel_aovs").iter().zip(&pixel_aovs) {
            assert_eq!((found.triangle_ix, found.depth), (expected.triangle_ix, expected.depth));
            assert_eq!((found.normal_world, found.material_ix), (expected.normal_world, expected.material_ix));
        }
        renderer.show().expect("the view again");
        // Back in the picture's view, the picture and the AOVs with all rays are the same.
        renderer.set_view(View::Picture, 1.0);
        assert_eq!(renderer.n_samples(), 0, "no sample of the picture is there yet");
        assert!(identical(&in_batches(&mut renderer, 2).0, &picture), "after {view}");
        renderer.draw().expect("a frame");
        assert_eq!(renderer.pixel_aovs().expect("pixel_aovs"), pixel_aovs);
    }
    for view in [View::Cost, View::Rays] {
        renderer.set_view(view, 1.0);
        renderer.draw().expect("a frame");
        assert_eq!(renderer.pixel_aovs().expect("pixel_aovs"), pixel_aovs, "{view} sums over all rays");
        for pixel in [uvec2(0, 0), uvec2(31, 0), uvec2(7, 23)] {
            let expected = pixel_aovs[(pixel.y * 32 + pixel.x) as usize];
            assert_eq!(renderer.aovs_at(pixel).expect("an AOV"), Some(expected), "{pixel}");
        }
    }
    assert_silent(&context);
}
