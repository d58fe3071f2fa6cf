//! Tests of frames of paths with the noise filter `edge`: the same bits however the frame is cut, less noise, and what
//! pictures say of their noise.

use glam::{Vec3, vec3};
use kdray::{
    cpu::{self, Batching},
    frame::{Crop, Denoise, FrameRenderer, Goal, Integrator, Picture, RenderOptions, sampling::samples_log2},
    gpu::DeviceOverrides,
    layout::MOST_SAMPLES_LOG2,
    render::{BandedRenderer, GpuRenderer},
    world::FlatScene,
};

use super::studio::{assert_silent, device, identical, world_of};
use crate::support::{pretended, scenes};

fn options(width: u32, height: u32) -> RenderOptions {
    let (integrator, denoise) = (Integrator::Path, Denoise::Edge);
    RenderOptions { width, height, max_depth: 4, integrator, denoise, ..RenderOptions::default() }
}

fn on_device(scene: &FlatScene, options: &RenderOptions, n_samples: u32) -> Picture {
    let context = device();
    let mut renderer = GpuRenderer::new(context.clone(), &world_of(scene), options).expect("a renderer");
    while renderer.n_samples() < n_samples {
        renderer.set_samples_per_frame(samples_log2(renderer.n_samples(), n_samples, MOST_SAMPLES_LOG2));
        renderer.draw_sample().expect("samples");
    }
    assert_silent(&context);
    renderer.picture().expect("a picture")
}

fn on_cpu(scene: &FlatScene, options: &RenderOptions, n_samples: u32) -> Picture {
    let mut renderer = cpu::CpuRenderer::new(&world_of(scene), options, Batching::default());
    while renderer.n_samples() < n_samples {
        renderer.set_samples_per_frame(samples_log2(renderer.n_samples(), n_samples, MOST_SAMPLES_LOG2));
        renderer.draw_sample();
    }
    renderer.picture()
}

/// Returns the root of the mean squared difference of two pictures, divided by that of their radiance.
fn difference(a: &Picture, b: &Picture) -> f32 {
    let [a, b] = [a, b].map(|picture| picture.radiance.iter().map(|&[r, g, b, _]| vec3(r, g, b)));
    let squares = a.clone().zip(b).map(|(a, b)| (a - b).length_squared()).sum::<f32>();
    (squares / a.map(Vec3::length_squared).sum::<f32>()).sqrt()
}

#[test]
fn device_and_cpu_agree() {
    let scene = scenes::mixed_outdoors();
    for n_samples in [1, 3] {
        let (found, expected) =
            (on_device(&scene, &options(40, 30), n_samples), on_cpu(&scene, &options(40, 30), n_samples));
        // A path that takes another way also changes the pixels around, all of them a little. There are more such paths
        // on drivers whose sines are rough.
        let same = difference(&found, &expected);
        assert!(same < 0.1, "{same} with {n_samples} samples");
        let unfiltered = RenderOptions { denoise: Denoise::Off, ..options(40, 30) };
        let others = difference(&found, &on_cpu(&scene, &unfiltered, n_samples));
        assert!(others > 0.3, "{others} with {n_samples} samples");
    }
}

#[test]
fn the_number_of_samples_in_a_frame_changes_no_bit() {
    let (scene, context) = (scenes::mixed_outdoors(), device());
    let world = world_of(&scene);
    let render = |frames: &[u32]| {
        let mut renderer = GpuRenderer::new(context.clone(), &world, &options(17, 13)).expect("a renderer");
        for log2 in frames {
            renderer.set_samples_per_frame(*log2);
            renderer.draw_sample().expect("samples");
        }
        renderer.picture().expect("a picture")
    };
    let one_by_one = render(&[0; 21]);
    for frames in [&[4, 2, 0][..], &[0, 0, 1, 2, 3, 2, 0]] {
        assert!(identical(&one_by_one, &render(frames)), "{frames:?}");
    }
    assert_silent(&context);
}

/// A sample of which a part is drawn, and that is then drawn again.
#[test]
fn a_dropped_sample_changes_no_bit() {
    let (scene, context) = (scenes::mixed_outdoors(), device());
    let world = world_of(&scene);
    let make = || {
        let mut renderer = GpuRenderer::new(context.clone(), &world, &options(40, 30)).expect("a renderer");
        renderer.limit_batches(Some(400)).expect("batches");
        renderer.draw_sample().expect("a sample");
        renderer
    };
    let (mut whole, mut dropped) = (make(), make());
    assert!(dropped.draw_batch().expect("a batch").is_none());
    dropped.limit_batches(None).expect("batches");
    let pictures = [&mut whole, &mut dropped].map(|renderer| {
        renderer.draw_sample().expect("a sample");
        renderer.picture().expect("a picture")
    });
    assert!(identical(&pictures[0], &pictures[1]));
    assert_silent(&context);
}

#[test]
fn a_crop_is_a_part_of_the_whole() {
    let (scene, options) = (scenes::mixed_outdoors(), options(190, 150));
    let crop = Crop { x0: 80, y0: 69, x1: 110, y1: 80 };
    for render in [on_device as fn(&_, &_, _) -> Picture, on_cpu] {
        let whole = render(&scene, &options, 2);
        let part = render(&scene, &RenderOptions { crop: Some(crop), ..options.clone() }, 2);
        let pixels = (crop.y0..crop.y1).flat_map(|y| (crop.x0..crop.x1).map(move |x| (y * 190 + x) as usize));
        let (radiance, display) = pixels.map(|i| (whole.radiance[i], whole.display[i])).unzip();
        assert!(identical(&Picture { width: 30, height: 11, radiance, display }, &part));
    }
}

#[test]
fn batches_and_bands_change_no_bit() {
    let (scene, options, context) = (scenes::mixed(), options(31, 200), device());
    let world = world_of(&scene);
    let whole = on_device(&scene, &options, 3);
    let mut batched = GpuRenderer::with_queue_capacity(context.clone(), &world, &options, 1000).expect("a renderer");
    (0..3).for_each(|_| drop(batched.draw_sample().expect("a sample")));
    assert!(identical(&whole, &batched.picture().expect("a picture")));
    let narrow = pretended(DeviceOverrides { storage_range: Some(31 * 180 * 128), ..DeviceOverrides::default() });
    let mut renderer = BandedRenderer::new(narrow.clone(), &world, &options).expect("a renderer");
    assert!(renderer.n_bands() > 1);
    renderer.draw(Goal::Samples(3), &mut || ()).expect("a picture");
    assert!(identical(&whole, &renderer.picture().expect("a picture")));
    [&context, &narrow].into_iter().for_each(|context| assert_silent(context));
}

/// A device that cannot bind full rows with their border draws parts of rows, with layers of all kinds.
#[test]
fn bands_of_parts_of_rows_change_no_bit() {
    let (scene, context) = (scenes::mixed_outdoors(), device());
    let layers = RenderOptions { pixel_aovs: true, light_layers: true, surface_layers: true, ..options(300, 150) };
    let options = RenderOptions { max_depth: 2, ..layers };
    let world = world_of(&scene);
    // Rows of the border alone take 300 * 130 pixels.
    let range = Some(150 * 140 * 512);
    let narrow = pretended(DeviceOverrides { storage_range: range, ..DeviceOverrides::default() });
    let draw = |context| {
        let mut renderer = BandedRenderer::new(context, &world, &options).expect("a renderer");
        let drawn = renderer.draw(Goal::Samples(1), &mut || ()).expect("a picture");
        (renderer.n_bands(), renderer.picture().expect("a picture").into_owned(), drawn)
    };
    let ((n_whole, whole, expected), (n_bands, joined, found)) = (draw(context.clone()), draw(narrow.clone()));
    assert!(n_whole == 1 && n_bands > 3, "{n_whole}, {n_bands}");
    assert!(identical(&whole, &joined) && expected.layers == found.layers);
    assert!(bytemuck::cast_slice::<_, u8>(&expected.pixel_aovs) == bytemuck::cast_slice::<_, u8>(&found.pixel_aovs));
    [&context, &narrow].into_iter().for_each(|context| assert_silent(context));
}

/// Returns the mean of the squared errors of two pictures' luminance.
fn squared_error(a: &Picture, b: &Picture) -> f32 {
    let luminance = |&[r, g, b, _]: &[f32; 4]| Vec3::new(r, g, b).dot(vec3(0.2126, 0.7152, 0.0722));
    let errors = a.radiance.iter().zip(&b.radiance).map(|(a, b)| (luminance(a) - luminance(b)).powi(2));
    errors.sum::<f32>() / a.radiance.len() as f32
}

#[test]
fn the_filter_reduces_the_error() {
    let scene = scenes::mixed_outdoors();
    let unfiltered = RenderOptions { denoise: Denoise::Off, ..options(80, 60) };
    let truth = on_cpu(&scene, &unfiltered, 1024);
    for n_samples in [1, 4, 16] {
        let [before, after] =
            [&unfiltered, &options(80, 60)].map(|options| squared_error(&on_cpu(&scene, options, n_samples), &truth));
        assert!(after < 0.6 * before, "{n_samples} samples: {before} without the filter, {after} with it");
    }
}

/// The variances that the samples show add up to the error that the picture has, and the filter changes neither them
/// nor the fourth component of the picture.
#[test]
fn pictures_know_their_noise() {
    let scene = scenes::mixed_outdoors();
    let noisy = RenderOptions { denoise: Denoise::Off, pixel_aovs: true, ..options(80, 60) };
    let truth = on_cpu(&scene, &RenderOptions { pixel_aovs: false, ..noisy.clone() }, 1024);
    let context = device();
    for (denoise, n_samples) in [(Denoise::Off, 16), (Denoise::Edge, 20), (Denoise::Paper { threshold: 0.1 }, 1)] {
        let with_filter = RenderOptions { denoise, ..noisy.clone() };
        let mut renderer = BandedRenderer::new(context.clone(), &world_of(&scene), &with_filter).expect("a renderer");
        let pixel_aovs = renderer.draw(Goal::Samples(n_samples), &mut || ()).expect("a picture").pixel_aovs;
        assert!(pixel_aovs.iter().all(|aovs| aovs.n_samples == n_samples));
        assert!(renderer.picture().expect("a picture").radiance.iter().all(|pixel| pixel[3] == 1.0));
        let variance = pixel_aovs.iter().map(|aovs| aovs.variance).sum::<f32>() / pixel_aovs.len() as f32;
        let error =
            squared_error(&on_cpu(&scene, &RenderOptions { pixel_aovs: false, ..noisy.clone() }, n_samples), &truth);
        if n_samples == 1 {
            assert!(variance.is_infinite());
        } else {
            // Samples are spread evenly, so that the error is less than independent samples would have.
            assert!((0.8..4.0).contains(&(variance / error)), "{variance}, {error}");
        }
    }
    assert_silent(&context);
}
