//! Functions that render pictures in tests, and compare them.

use kdray::{
    cpu::{self, Batching},
    frame::{Denoise, Picture, RenderOptions},
    render::GpuRenderer,
    world::FlatScene,
};

pub use crate::support::{assert_silent, device, world_of};

/// Returns options without a noise filter.
pub fn options(width: u32, height: u32, max_depth: u32) -> RenderOptions {
    RenderOptions { width, height, max_depth, denoise: Denoise::Off, ..RenderOptions::default() }
}

pub fn on_device(scene: &FlatScene, options: &RenderOptions) -> Picture {
    let context = device();
    let mut renderer = GpuRenderer::new(context.clone(), &world_of(scene), options).expect("a renderer");
    let picture = renderer.render().expect("a frame").0;
    assert_silent(&context);
    picture
}

pub fn on_cpu(scene: &FlatScene, options: &RenderOptions) -> Picture {
    cpu::render(&world_of(scene), options).0
}

/// Renders the mean of `n_samples` samples per pixel on the device.
pub fn samples_on_device(scene: &FlatScene, options: &RenderOptions, n_samples: u32) -> Picture {
    let context = device();
    let mut renderer = GpuRenderer::new(context.clone(), &world_of(scene), options).expect("a renderer");
    (0..n_samples).for_each(|_| drop(renderer.draw_sample().expect("a sample")));
    assert_silent(&context);
    renderer.picture().expect("a picture")
}

/// Renders the mean of `n_samples` samples per pixel on the CPU.
pub fn samples_on_cpu(scene: &FlatScene, options: &RenderOptions, n_samples: u32) -> Picture {
    let world = world_of(scene);
    let mut renderer = cpu::CpuRenderer::new(&world, options, Batching::default());
    (0..n_samples).for_each(|_| drop(renderer.draw_sample()));
    renderer.picture()
}

/// Renders the picture on the device and on the CPU, for properties that both must have.
pub fn on_both(scene: &FlatScene, options: &RenderOptions) -> [Picture; 2] {
    [on_device(scene, options), on_cpu(scene, options)]
}

/// Returns the indices of the pixels in which a channel's radiance differs by more than `tolerance`.
pub fn differing(a: &Picture, b: &Picture, tolerance: f32) -> Vec<usize> {
    assert_eq!((a.width, a.height, a.radiance.len()), (b.width, b.height, b.radiance.len()));
    // The condition is not `>`, so that NaN differs.
    let differs = |a: &[f32; 4], b: &[f32; 4]| (0..4).any(|i| !((a[i] - b[i]).abs() <= tolerance));
    (0..a.radiance.len()).filter(|&i| differs(&a.radiance[i], &b.radiance[i])).collect()
}

/// Returns whether radiance and displayed pixels agree in every bit.
pub fn identical(a: &Picture, b: &Picture) -> bool {
    let bits = |picture: &Picture| -> Vec<_> { picture.radiance.iter().map(|p| p.map(f32::to_bits)).collect() };
    bits(a) == bits(b) && a.display == b.display && (a.width, a.height) == (b.width, b.height)
}

#[test]
fn one_changed_pixel_is_noticed() {
    let scene = crate::support::scenes::mixed();
    let picture = on_cpu(&scene, &options(16, 12, 3));
    assert!(differing(&picture, &picture, 0.0).is_empty() && identical(&picture, &picture));
    let mut changed = picture.clone();
    changed.radiance[77][1] += 0.01;
    assert_eq!(differing(&picture, &changed, 1e-3), [77]);
    changed.radiance[77][1] = f32::NAN;
    assert_eq!(differing(&picture, &changed, 1e-3), [77]);
    let mut changed = picture.clone();
    changed.radiance[5][0] = f32::from_bits(changed.radiance[5][0].to_bits() ^ 1);
    assert!(!identical(&picture, &changed));
    let mut changed = picture.clone();
    changed.display[5][2] ^= 1;
    assert!(!identical(&picture, &changed));
}
