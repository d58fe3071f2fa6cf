//! Tests of the layers that are means of all samples, of light and of surfaces: closed forms, the sum of light, and
//! the same bits however the picture is cut into frames, batches, crops and bands.

use glam::{Vec3, vec3};
use kdray::{
    cpu::{self, Batching},
    frame::{
        Crop, Denoise, FrameRenderer, Goal, Integrator, MeanLayers, PathOptions, Picture, RenderOptions,
        sampling::samples_log2,
    },
    gpu::DeviceOverrides,
    layout::{MATERIAL_MICROFACET, MOST_SAMPLES_LOG2, Material},
    render::{BandedRenderer, GpuRenderer},
    world::FlatScene,
};

use super::studio::{assert_silent, device, identical, world_of};
use crate::support::{meshes, pretended, scenes};

fn options(width: u32, height: u32, max_depth: u32) -> RenderOptions {
    let (integrator, denoise) = (Integrator::Path, Denoise::Off);
    let (light_layers, surface_layers) = (true, true);
    let size = RenderOptions { width, height, max_depth, ..RenderOptions::default() };
    RenderOptions { integrator, denoise, light_layers, surface_layers, ..size }
}

type Layered = (Picture, MeanLayers);

fn finish(renderer: &mut GpuRenderer, n_samples: u32) -> Layered {
    while renderer.n_samples() < n_samples {
        renderer.set_samples_per_frame(samples_log2(renderer.n_samples(), n_samples, MOST_SAMPLES_LOG2));
        renderer.draw_sample().expect("samples");
    }
    (renderer.picture().expect("a picture"), renderer.mean_layers().expect("layers"))
}

fn on_device(scene: &FlatScene, options: &RenderOptions, n_samples: u32) -> Layered {
    let context = device();
    let mut renderer = GpuRenderer::new(context.clone(), &world_of(scene), options).expect("a renderer");
    let layered = finish(&mut renderer, n_samples);
    assert_silent(&context);
    layered
}

fn on_cpu(scene: &FlatScene, options: &RenderOptions, n_samples: u32) -> Layered {
    on_cpu_in_batches(scene, options, n_samples, Batching::default())
}

fn on_cpu_in_batches(scene: &FlatScene, options: &RenderOptions, n_samples: u32, batching: Batching) -> Layered {
    let mut renderer = cpu::CpuRenderer::new(&world_of(scene), options, batching);
    while renderer.n_samples() < n_samples {
        // Frames of ray trees have one sample.
        let most = if options.integrator == Integrator::Path { MOST_SAMPLES_LOG2 } else { 0 };
        renderer.set_samples_per_frame(samples_log2(renderer.n_samples(), n_samples, most));
        renderer.draw_sample();
    }
    (renderer.picture(), renderer.mean_layers().expect("layers"))
}

/// A scene of all kinds of materials with a lamp that shines into the camera.
fn lit() -> FlatScene {
    let mut scene = scenes::mixed_outdoors();
    scenes::add(&mut scene, meshes::torus(6, 5), scenes::emissive(vec3(3.0, 2.0, 1.0)));
    scene
}

fn bits(layers: &MeanLayers) -> Vec<[u32; 4]> {
    layers.0.iter().flatten().map(|pixel| pixel.map(f32::to_bits)).collect()
}

fn same(a: &Layered, b: &Layered) -> bool {
    identical(&a.0, &b.0) && bits(&a.1) == bits(&b.1)
}

/// Returns the mean of a layer in red.
fn mean(layer: &[[f32; 4]]) -> f32 {
    layer.iter().map(|pixel| pixel[0]).sum::<f32>() / layer.len() as f32
}

/// Each layer has light, no light is negative, and their sum is the picture: the difference is below 2^-20 of the
/// colour, since a path adds its light in a dozen steps and 24 bits.
#[test]
fn layers_add_up_to_the_picture_which_they_do_not_change() {
    let scene = lit();
    for clamp in [f32::INFINITY, 0.5] {
        let paths = PathOptions { clamp, ..PathOptions::default() };
        let options = RenderOptions { paths, ..options(40, 30, 6) };
        for render in [on_device as fn(&_, &_, _) -> Layered, on_cpu] {
            let (picture, layers) = render(&scene, &options, 37);
            let without = &RenderOptions { light_layers: false, surface_layers: false, ..options.clone() };
            let without = render(&scene, without, 37);
            assert!(identical(&picture, &without.0), "layers change the picture");
            assert!(without.1.is_empty());
            for (pixel_ix, colour) in picture.radiance.iter().enumerate() {
                let of_pixel: Vec<_> = layers.0[..3].iter().map(|layer| layer[pixel_ix]).collect();
                for i in 0..3 {
                    let sum: f32 = of_pixel.iter().map(|layer| layer[i]).sum();
                    assert!((sum - colour[i]).abs() <= colour[i] * 2_f32.powi(-20), "{pixel_ix}: {sum}, {colour:?}");
                    assert!(of_pixel.iter().all(|layer| layer[i] >= 0.0), "{of_pixel:?}");
                }
            }
            assert!(layers.0[..3].iter().all(|layer| mean(layer) > 0.01), "each layer of light has light");
        }
    }
}

/// A bound of the light after the first hit leaves what is seen directly as it is, and bounds what any path adds.
#[test]
fn a_bound_leaves_emission_as_it_is() {
    let scene = lit();
    let with = |clamp| RenderOptions { paths: PathOptions { clamp, ..PathOptions::default() }, ..options(24, 18, 4) };
    let [free, bounded] = [f32::INFINITY, 0.05].map(|clamp| on_cpu(&scene, &with(clamp), 8).1.0);
    assert_eq!(free[0], bounded[0]);
    assert!(free[0].iter().any(|pixel| pixel[0] > 0.1));
    for layer_ix in [1, 2] {
        assert!(mean(&bounded[layer_ix]) < mean(&free[layer_ix]));
    }
    // A path adds direct light by a shadow ray to a light, and by the ray that goes on.
    assert!(bounded[1].iter().all(|pixel| pixel[0] <= 2.0 * 0.05 * 1.0001));
}

/// A closed box whose walls give off 1 - r and reflect r of the light: the camera sees 1 - r, each bounce brings the
/// share r of the one before, and all together are 1.
#[test]
fn layers_of_a_closed_box_are_terms_of_a_geometric_series() {
    let r = 0.75_f32;
    let mut scene = scenes::empty();
    let walls = Material { ke: Vec3::splat(1.0 - r), ..scenes::diffuse(Vec3::splat(r)) };
    scenes::add(&mut scene, scenes::room(1.0), walls);
    scene.camera.eye = vec3(0.1, 0.2, 0.3);
    scene.camera.target = vec3(0.7, -0.4, 0.5);
    for max_depth in [1, 2, 5, 64] {
        for render in [on_device as fn(&_, &_, _) -> Layered, on_cpu] {
            let (_, MeanLayers(layers)) = render(&scene, &options(32, 32, max_depth), 64);
            let expected = [1.0 - r, r * (1.0 - r), r * r - r.powi(max_depth as i32 + 1)];
            for (layer, expected) in layers.iter().zip(expected) {
                let n = layer.len() as f32;
                let variance = layer.iter().map(|pixel| (pixel[0] - mean(layer)).powi(2)).sum::<f32>() / (n - 1.0);
                let error = (variance / n).sqrt();
                let found = mean(layer);
                assert!((found - expected).abs() < (4.0 * error).max(2e-6), "{max_depth}: {found}, {expected}");
                assert!(error < 0.005, "{max_depth}: {error}");
            }
        }
    }
}

#[test]
fn device_and_cpu_agree() {
    let (scene, options) = (lit(), options(40, 30, 5));
    let (found, expected) = (on_device(&scene, &options, 3), on_cpu(&scene, &options, 3));
    for (layer_ix, (found, expected)) in found.1.0.iter().zip(&expected.1.0).enumerate() {
        let differs = |a: &[f32; 4], b: &[f32; 4]| (0..4).any(|i| !((a[i] - b[i]).abs() <= 1e-3));
        let n_differing = found.iter().zip(expected).filter(|(a, b)| differs(a, b)).count();
        // Sines and cosines are rounded differently, so a few paths take another way.
        assert!(n_differing <= 1200 / 20, "layer {layer_ix}: {n_differing} of 1200 pixels differ");
    }
}

#[test]
fn frames_batches_and_bands_change_no_bit() {
    let (scene, options, context) = (lit(), options(31, 80, 5), device());
    let world = world_of(&scene);
    let whole = on_device(&scene, &options, 20);
    for capacity in [100, 1000] {
        let renderer = GpuRenderer::with_queue_capacity(context.clone(), &world, &options, capacity);
        assert!(same(&whole, &finish(&mut renderer.expect("a renderer"), 20)), "a queue for {capacity} paths");
    }
    let mut renderer = GpuRenderer::new(context.clone(), &world, &options).expect("a renderer");
    for log2 in [0, 0, 1, 2, 3, 2] {
        renderer.set_samples_per_frame(log2);
        renderer.draw_sample().expect("samples");
    }
    assert!(same(&whole, &finish(&mut renderer, 20)), "frames of few samples");
    // Layers take as much memory as four pictures, so there are as many bands.
    let narrow = pretended(DeviceOverrides { storage_range: Some(31 * 25 * 128 * 4), ..DeviceOverrides::default() });
    let mut renderer = BandedRenderer::new(narrow.clone(), &world, &options).expect("a renderer");
    assert!(renderer.n_bands() > 3);
    let drawn = renderer.draw(Goal::Samples(20), &mut || ()).expect("a picture");
    assert!(same(&whole, &(renderer.picture().expect("a picture").into_owned(), drawn.layers)), "bands");
    let whole = on_cpu(&scene, &options, 20);
    for n_pixels in [1, 100] {
        let batching = Batching { n_pixels, ..Batching::default() };
        assert!(same(&whole, &on_cpu_in_batches(&scene, &options, 20, batching)), "batches of {n_pixels} pixels");
    }
    [&context, &narrow].into_iter().for_each(|context| assert_silent(context));
}

#[test]
fn a_crop_is_a_part_of_the_whole() {
    let (scene, options) = (lit(), options(61, 47, 4));
    let crop = Crop { x0: 13, y0: 9, x1: 50, y1: 31 };
    for render in [on_device as fn(&_, &_, _) -> Layered, on_cpu] {
        let whole = render(&scene, &options, 5);
        let part = render(&scene, &RenderOptions { crop: Some(crop), ..options.clone() }, 5);
        let pixels: Vec<_> = (crop.y0..crop.y1).flat_map(|y| (crop.x0..crop.x1).map(move |x| y * 61 + x)).collect();
        let expected = whole.1.0.each_ref().map(|layer| pixels.iter().map(|&i| layer[i as usize]).collect());
        assert_eq!(bits(&part.1), bits(&MeanLayers(expected)));
    }
}

/// A renderer gets layers and loses them again without a trace.
#[test]
fn layers_can_be_switched() {
    let (scene, with, context) = (lit(), options(24, 18, 4), device());
    let without = RenderOptions { light_layers: false, surface_layers: false, ..with.clone() };
    let of_surfaces = RenderOptions { light_layers: false, ..with.clone() };
    let mut renderer = GpuRenderer::new(context.clone(), &world_of(&scene), &without).expect("a renderer");
    let plain = finish(&mut renderer, 5);
    let expected = on_device(&scene, &with, 5);
    for _ in 0..2 {
        renderer.set_options(&with).expect("options");
        assert!(same(&expected, &finish(&mut renderer, 5)));
        renderer.set_options(&of_surfaces).expect("options");
        let mut of_some = expected.clone();
        of_some.1.0[..3].fill(Vec::new());
        assert!(same(&of_some, &finish(&mut renderer, 5)));
        renderer.set_options(&without).expect("options");
        assert!(same(&plain, &finish(&mut renderer, 5)));
    }
    assert_silent(&context);
}

/// Between two walls of known materials, every sample has their albedo and their normal: what a metal reflects, the
/// tint of glass with what it reflects. Both integrators agree, with any number of samples.
#[test]
fn surfaces_of_known_materials_have_their_albedos() {
    let tint = vec3(0.9, 0.5, 0.25);
    let microfacets = |metallic, transmission, roughness| Material {
        flags: MATERIAL_MICROFACET,
        ks: Vec3::ONE,
        ni: 1.5,
        tf: Vec3::ONE,
        metallic,
        transmission,
        roughness,
        ..scenes::diffuse(tint)
    };
    for (material, expected) in [
        (scenes::diffuse(tint), tint),
        (scenes::mirror(tint), tint),
        // Its index of refraction is 1.4.
        (scenes::plain_glass(Vec3::ONE, tint, true), tint + 1.0 / 36.0),
        (scenes::glass(1.5), Vec3::ONE),
        (microfacets(1.0, 0.0, 0.3), tint),
        (microfacets(1.0, 0.0, 0.0), tint),
        (microfacets(0.0, 0.0, 0.5), (tint + 0.04).min(Vec3::ONE)),
    ] {
        let mut scene = scenes::empty();
        scenes::add(&mut scene, scenes::room(5.0), material);
        (scene.camera.eye, scene.camera.target) = (Vec3::ZERO, vec3(0.0, 0.0, -1.0));
        for (integrator, n_samples) in [(Integrator::Path, 20), (Integrator::Whitted, 3), (Integrator::Whitted, 1)] {
            let options = RenderOptions { integrator, light_layers: false, ..options(12, 10, 2) };
            for render in [on_device as fn(&_, &_, _) -> Layered, on_cpu] {
                let MeanLayers([.., albedo, normal]) = render(&scene, &options, n_samples).1;
                let vector = |pixel: &[f32; 4]| vec3(pixel[0], pixel[1], pixel[2]);
                for (albedo, normal) in albedo.iter().zip(&normal) {
                    assert!(vector(albedo).abs_diff_eq(expected, 1e-5), "{integrator}: {albedo:?}, {expected}");
                    assert!(vector(normal).abs_diff_eq(Vec3::Z, 1e-5), "{integrator}: {normal:?}");
                }
            }
        }
    }
}

/// A pixel at the edge of a surface has a part of its albedo and of its normal: the share of its samples that hit it.
#[test]
fn a_pixel_has_the_mean_of_its_samples() {
    let mut scene = scenes::empty();
    let triangle = meshes::triangle(vec3(-0.6, -0.6, -2.0), vec3(0.6, -0.5, -2.0), vec3(0.1, 0.6, -2.0));
    scenes::add(&mut scene, vec![triangle], scenes::diffuse(Vec3::splat(0.5)));
    (scene.camera.eye, scene.camera.target) = (Vec3::ZERO, vec3(0.0, 0.0, -1.0));
    for (integrator, n_samples) in [(Integrator::Path, 64), (Integrator::Whitted, 16)] {
        let options = RenderOptions { integrator, light_layers: false, ..options(24, 18, 2) };
        for render in [on_device as fn(&_, &_, _) -> Layered, on_cpu] {
            let MeanLayers([.., albedo, normal]) = render(&scene, &options, n_samples).1;
            let n_between = normal.iter().filter(|normal| (0.05..0.95).contains(&normal[2])).count();
            assert!(n_between > 9, "{integrator}: {n_between} pixels on edges");
            assert!(albedo.iter().zip(&normal).all(|(albedo, normal)| (2.0 * albedo[0] - normal[2]).abs() < 1e-6));
        }
    }
}
