//! Tests that a change that the device refuses at any step changes nothing: the picture remains, and the next picture
//! has the same bits as that of a renderer without the attempted change.

use std::sync::Arc;

use glam::Vec3;
use kdray::{
    accel::kdtree::Traversal,
    buffers::SceneAccess,
    cpu::{Batching, CpuRenderer},
    frame::{Crop, Denoise, FrameRenderer, Goal, Integrator, PathOptions, Picture, Primary, RenderOptions, Tonemap},
    gpu::{Context, DeviceOverrides, GpuError},
    render::GpuRenderer,
    scene::{Camera, Projection},
    world::World,
};

use super::studio::{assert_silent, device, identical, options, world_of};
use crate::support::{pretended, scenes, without_wide_atomics};

/// Camera of all pictures here, which is not the scene's own.
const CAMERA: Camera = Camera {
    eye: Vec3::new(0.4, 0.3, 3.9),
    target: Vec3::ZERO,
    up: Vec3::Y,
    projection: Projection::Perspective { vertical_fov_degrees: 50.0 },
};

/// Returns options of a picture with few pixels, since each refused step draws two samples.
fn small() -> RenderOptions {
    options(15, 10, 2)
}

/// Number of pixels of a batch, chosen so that a sample has several batches.
const BATCH: u32 = 30;

/// Draws one sample and a part of the second one.
fn begin(renderer: &mut GpuRenderer) {
    renderer.draw().expect("a sample");
    assert_eq!(renderer.draw_batch().expect("a batch"), None, "the sample has more batches");
}

/// Draws the rest of the second sample.
fn finish(renderer: &mut GpuRenderer) -> Picture {
    renderer.draw_sample().expect("a sample");
    assert_eq!(renderer.n_samples(), 2);
    renderer.picture().expect("a picture")
}

/// The state of a renderer that a user can see.
#[derive(Debug, PartialEq)]
struct State {
    options: RenderOptions,
    camera: Camera,
    n_samples: u32,
    progress: Option<f32>,
    most_pixels: Option<u32>,
    displayed: Option<(u32, u32)>,
}

fn state(renderer: &GpuRenderer) -> State {
    State {
        options: renderer.options().clone(),
        camera: *renderer.camera(),
        n_samples: renderer.n_samples(),
        progress: renderer.is_pending().then(|| renderer.progress()),
        most_pixels: renderer.most_pixels(),
        displayed: renderer.displayed().map(|displayed| displayed.size),
    }
}

/// A renderer that is changed repeatedly.
struct Trial {
    context: Arc<Context>,
    world: World,
    renderer: GpuRenderer,
    /// Pictures of two samples by new renderers, one for each of the options so far.
    untouched: Vec<(RenderOptions, Picture)>,
}

impl Trial {
    fn new(context: Arc<Context>, start: &RenderOptions) -> Self {
        let mut scene = scenes::mixed_outdoors();
        // Bounces of blended surfaces would make the counters larger than some of the pretended devices allow.
        scene.materials.iter_mut().for_each(|material| material.d = 1.0);
        let world = world_of(&scene);
        let renderer = Self::renderer(&context, &world, start);
        Self { context, world, renderer, untouched: Vec::new() }
    }

    fn renderer(context: &Arc<Context>, world: &World, options: &RenderOptions) -> GpuRenderer {
        let mut renderer = GpuRenderer::new(context.clone(), world, options).expect("a renderer");
        renderer.set_camera(&CAMERA);
        renderer.limit_batches(Some(BATCH)).expect("batches");
        renderer
    }

    /// Returns the picture that a new renderer draws with the options of the changed one.
    fn untouched(&mut self) -> Picture {
        let options = self.renderer.options();
        if let Some((_, picture)) = self.untouched.iter().find(|(known, _)| known == options) {
            return picture.clone();
        }
        let mut renderer = Self::renderer(&self.context, &self.world, options);
        begin(&mut renderer);
        let picture = finish(&mut renderer);
        self.untouched.push((options.clone(), picture.clone()));
        picture
    }

    /// Makes the change repeatedly. The device refuses first its first creation of an object, then its second, and so
    /// on, until the change succeeds. It must have at least `least_creations` creations.
    fn refuse(&mut self, name: &str, least_creations: u32, change: &Change) {
        let untouched = self.untouched();
        let renderer = &mut self.renderer;
        for n_creations in 0.. {
            begin(renderer);
            let (before, picture) = (state(renderer), renderer.picture().expect("a picture"));
            self.context.fail_creations_after(Some(n_creations));
            let changed = change(renderer);
            self.context.fail_creations_after(None);
            let Err(error) = changed else {
                assert!(n_creations >= least_creations, "{name}: {n_creations} creations");
                break;
            };
            assert!(matches!(error, GpuError::Call { .. }), "{name}, {n_creations}: {error}");
            assert_eq!(state(renderer), before, "{name}, {n_creations}: {error}");
            assert!(identical(&renderer.picture().expect("a picture"), &picture), "{name}, {n_creations}: {error}");
            assert!(identical(&finish(renderer), &untouched), "{name}, {n_creations}: {error}");
        }
        self.renderer.draw().expect("a sample");
        assert!(identical(&finish(&mut self.renderer), &self.untouched()), "{name}");
    }

    /// Changes to each of the options in turn. The device refuses each change first.
    fn walk(&mut self, steps: &[(RenderOptions, u32)]) {
        for (to, least_creations) in steps {
            let name = format!("{:?} to {to:?}", self.renderer.options());
            self.refuse(&name, *least_creations, &|renderer| renderer.set_options(to));
        }
        assert_silent(&self.context);
    }
}

type Change<'a> = dyn Fn(&mut GpuRenderer) -> Result<(), GpuError> + 'a;

#[test]
fn another_traversal() {
    let traversal = |traversal| (RenderOptions { traversal, ..small() }, 10);
    let ways = [Traversal::Ropes, Traversal::MaskBoxes].map(traversal);
    Trial::new(device(), &small()).walk(&ways);
}

/// Kernels that read by address find boxes and ropes in a buffer of addresses, which changes with the traversal.
#[test]
fn another_traversal_of_arrays_that_are_read_by_address() {
    let overrides = DeviceOverrides { storage_range: Some(48 << 10), n_texels: Some(1), ..DeviceOverrides::default() };
    let ropes = RenderOptions { traversal: Traversal::Ropes, ..small() };
    let mut trial = Trial::new(pretended(overrides), &ropes);
    assert_eq!(trial.renderer.resources().accel.access(), SceneAccess::Address);
    trial.walk(&[(small(), 10), (ropes, 10)]);
}

#[test]
fn other_primary_rays() {
    let primary = |primary| (RenderOptions { primary, ..small() }, 10);
    let mut ways = vec![Primary::Trace, Primary::Raster];
    if device().has_int64_atomics() {
        ways.extend([Primary::SoftwareRaster, Primary::Trace]);
    }
    Trial::new(device(), &small()).walk(&ways.into_iter().map(primary).collect::<Vec<_>>());
}

#[test]
fn another_size() {
    let size = |width, height| RenderOptions { width, height, ..small() };
    let mut trial = Trial::new(device(), &small());
    trial.walk(&[(size(23, 17), 20), (size(9, 8), 8)]);
    trial.refuse("resize", 20, &|renderer| renderer.resize(30, 20));
    let crop = Crop { x0: 2, y0: 3, x1: 9, y1: 12 };
    trial.refuse("crop", 8, &|renderer| renderer.set_crop(crop));
    assert_silent(&trial.context);
}

#[test]
fn other_outputs_and_counts() {
    let with_aovs = RenderOptions { pixel_aovs: true, ..small() };
    let filtered = RenderOptions { denoise: Denoise::Paper { threshold: 0.3 }, ..small() };
    let deeper = RenderOptions { max_depth: 4, ..small() };
    let unprofiled = RenderOptions { profile: false, ..small() };
    Trial::new(device(), &small()).walk(&[(with_aovs, 15), (filtered, 15), (deeper, 10), (unprofiled, 10)]);
}

#[test]
fn other_views_of_the_same_samples() {
    let to = RenderOptions { tonemap: Tonemap::Agx, exposure: 2.0, ..small() };
    Trial::new(device(), &small()).walk(&[(to, 1)]);
}

#[test]
fn other_batches() {
    let mut trial = Trial::new(device(), &small());
    trial.refuse("batches", 6, &|renderer| renderer.limit_batches(Some(7)));
    assert_silent(&trial.context);
}

/// The second sample begins with the allocation of the sums of samples.
#[test]
fn a_sample_that_cannot_begin_leaves_those_before() {
    let mut trial = Trial::new(device(), &small());
    let both = trial.untouched();
    let (renderer, context) = (&mut trial.renderer, &trial.context);
    renderer.draw().expect("a sample");
    let first = renderer.picture().expect("a picture");
    let begins = (0..).take_while(|&n_creations| {
        context.fail_creations_after(Some(n_creations));
        let begun = renderer.draw_batch();
        context.fail_creations_after(None);
        let is_refused = begun.is_err() && renderer.n_samples() == 1;
        assert!(!is_refused || identical(&renderer.picture().expect("a picture"), &first), "{n_creations}");
        is_refused
    });
    let n_creations = begins.count();
    assert!(n_creations >= 5, "{n_creations} creations");
    renderer.draw().expect("a sample");
    assert!(identical(&finish(renderer), &both));
    assert_silent(context);
}

/// Samples are added in a tree of aligned blocks, so only such a block can be drawn from any place on.
#[test]
fn samples_that_are_no_block() {
    let (context, world) = (device(), world_of(&scenes::mixed_outdoors()));
    let of = |first_sample| {
        let paths = PathOptions { first_sample, ..PathOptions::default() };
        RenderOptions { integrator: Integrator::Path, denoise: Denoise::Off, paths, ..small() }
    };
    assert!(GpuRenderer::new(context.clone(), &world, &of(8)).is_err(), "how many samples follow is not known");
    let mut on_device = GpuRenderer::new(context.clone(), &world, &of(0)).expect("a renderer");
    let mut on_cpu = CpuRenderer::new(&world, &of(0), Batching::default());
    on_device.set_options(&of(8)).expect("options");
    on_cpu.set_first_sample(8);
    for (n_samples, is_block) in [(1, true), (8, true), (9, false), (32, false), (4, true)] {
        let goal = Goal::Samples(n_samples);
        let drawn = [on_device.draw_window(goal, &mut || ()), on_cpu.draw_window(goal, &mut || ())];
        for error in drawn.into_iter().map(Result::err) {
            let expected = (!is_block).then(|| "first_sample is 8, not a multiple of 16 up to 2147483648".to_owned());
            assert_eq!(error.map(|error| error.to_string()), expected, "{n_samples}");
        }
    }
    assert_silent(&context);
}

#[test]
fn what_the_device_lacks() {
    for primary in [Primary::Trace, Primary::Raster] {
        let mut trial = Trial::new(without_wide_atomics(), &RenderOptions { primary, ..small() });
        let untouched = trial.untouched();
        begin(&mut trial.renderer);
        let before = state(&trial.renderer);
        let refused = trial.renderer.set_options(&RenderOptions { primary: Primary::SoftwareRaster, ..small() });
        assert!(matches!(refused, Err(GpuError::Lacks { .. })), "{:?}", refused.err());
        assert_eq!(state(&trial.renderer), before);
        assert!(identical(&finish(&mut trial.renderer), &untouched), "{primary}");
        assert_silent(&trial.context);
    }
}
