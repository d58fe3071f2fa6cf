//! Measures the time that each method takes on a device, in a scene.
//!
//! Traversals are timed on coherent rays from the scene's own camera and on scattered rays: one diffuse ray from each
//! hit of a camera ray. The traversals run in turn, and the shortest time of each counts, so that a clock frequency
//! that rises during the measurement favours none.

use std::{rc::Rc, sync::Arc};

use bytemuck::Zeroable;

use super::Timings;
use crate::{
    accel::{Query, kdtree::Traversal},
    buffers::{AccelBuffers, CastResources},
    cast::{Contender, Kernel, cast_ray, leaving::diffuse_rays, time_in_turn},
    cpu::trace,
    frame::{Denoise, Primary, RenderOptions},
    gpu::{Context, GpuError},
    layout::{Frame, Hit, PathRay, Ray},
    reference::{inputs::KernelInputs, primary_hit::primary_rays},
    render::GpuRenderer,
    world::{FlatScene, World},
};

/// Bounds of the number of camera rays, which is the number of lanes that the device runs at once, clamped to them.
/// With fewer rays the device would idle, and more rays only take longer.
const FEWEST_RAYS: u32 = 1 << 12;
const MOST_RAYS: u32 = 1 << 18;
/// Number of timed casts of all rays by each traversal.
const N_ROUNDS: u16 = 5;
/// Number of timed frames of each kind of primary visibility. The same number of frames runs before, untimed.
const N_FRAMES: usize = 5;

/// Times each traversal, in nanoseconds per ray. Returns none where the device has no timestamps. The traversals must
/// not read any links except ropes, because only ropes are uploaded beside the tree.
///
/// # Errors
/// The buffers are beyond the device's limits or memory, or a call fails.
pub fn measure_traversals(
    context: &Arc<Context>,
    world: &World,
    traversals: &[Traversal],
) -> Result<Option<Timings>, GpuError> {
    if !context.has_timestamps() {
        return Ok(None);
    }
    let scene = world.scene();
    let n_pixels = context.n_lanes()?.clamp(FEWEST_RAYS, MOST_RAYS);
    let frame = world.frame_constants(&picture_of(scene, n_pixels));
    let rays = some_rays(world, &frame);
    let mut buffers = AccelBuffers::new(context, world.geometry())?;
    if traversals.contains(&Traversal::Ropes) {
        buffers.add_links(context, world.geometry(), Traversal::Ropes)?;
    }
    let bindings = CastResources::bindings(context, &buffers)?;
    let resources = Rc::new(CastResources::new(context, &bindings, &buffers, rays.len())?);
    resources.cast_rays.upload(&rays)?;
    let kernel = |&traversal| -> Result<Box<dyn Contender>, GpuError> {
        Ok(Box::new(Kernel::new(context, &bindings, &resources, (traversal, Query::Closest))?))
    };
    let kernels = traversals.iter().map(kernel).collect::<Result<Vec<_>, _>>()?;
    let ms = time_in_turn(context, &kernels, N_ROUNDS)?;
    let ns_a_ray = |kernel_ix: usize| {
        let own = ms.iter().skip(kernel_ix).step_by(kernels.len()).copied().collect::<Option<Vec<f64>>>()?;
        let least = own.into_iter().min_by(f64::total_cmp)?;
        Some((traversals[kernel_ix], least * 1e6 / rays.len() as f64))
    };
    Ok((0..kernels.len()).map(ns_a_ray).collect())
}

/// Returns the rays of the scene's camera, then one diffuse ray from each of their hits. The CPU finds the hits, so
/// the rays of a frame are the same for every device.
fn some_rays(world: &World, frame: &Frame) -> Vec<Ray> {
    let mut from_camera = vec![PathRay::zeroed(); (frame.width * frame.height) as usize];
    primary_rays(frame, 0, &mut from_camera);
    let mut hits = vec![Hit::zeroed(); from_camera.len()];
    trace(&KernelInputs::new(world, frame), Traversal::OF_CPU.into(), &from_camera, &mut hits);
    let bounced = diffuse_rays(|ix| world.scene().triangle(ix as usize), &from_camera, &hits);
    from_camera.iter().chain(&bounced).map(cast_ray).collect()
}

/// Returns options for a picture of about `n_pixels` pixels, with the shape of the scene's own picture.
fn picture_of(scene: &FlatScene, n_pixels: u32) -> RenderOptions {
    let (width, height) = (f64::from(scene.defaults.width), f64::from(scene.defaults.height));
    let scale = (f64::from(n_pixels) / (width * height)).sqrt();
    let side = |pixels: f64| (pixels * scale).round().max(1.0) as u32;
    RenderOptions { width: side(width), height: side(height), ..RenderOptions::default() }
}

/// Times whole pictures of primary rays and their shadow rays by each kind of primary visibility, in nanoseconds per
/// pixel. Returns none where the device has no timestamps. `options` gives the picture's size and the traversal.
///
/// # Errors
/// The buffers are beyond the device's limits or memory, or a call fails.
pub fn measure_primaries(
    context: &Arc<Context>,
    world: &World,
    options: &RenderOptions,
    primaries: &[Primary],
) -> Result<Option<Timings>, GpuError> {
    let n_pixels = f64::from(options.width) * f64::from(options.height);
    let options = RenderOptions { max_depth: 1, denoise: Denoise::Off, profile: true, ..options.clone() };
    let mut renderer = GpuRenderer::new(Arc::clone(context), world, &options)?;
    let mut times = Vec::new();
    for &primary in primaries {
        renderer.set_options(&RenderOptions { primary, ..options.clone() })?;
        let frames = (0..2 * N_FRAMES).map(|_| Ok(renderer.draw()?.frame_ms)).collect::<Result<Vec<_>, GpuError>>()?;
        let timed = frames.into_iter().skip(N_FRAMES).collect::<Option<Vec<f64>>>();
        let least = timed.and_then(|ms| ms.into_iter().min_by(f64::total_cmp));
        times.push(least.map(|ms| (primary, ms * 1e6 / n_pixels)));
    }
    Ok(times.into_iter().collect())
}
