//! A scene on a device with the passes of paths, of which tests run one at a time.

use std::{sync::Arc, thread};

use kdray::{
    accel::kdtree::TraversalLinks,
    buffers::{Needs, PathQueue, Resources},
    frame::{Denoise, Integrator, RenderOptions},
    gpu::{Commands, Context},
    layout::{Batch, Bounce, Frame, Hit, Material, PathRay},
    passes::PathPasses,
    reference::{inputs::KernelInputs, path_begin::path_begin, path_trace},
    world::{FlatScene, World, path_materials},
};

use super::stage::FIRST;
use crate::support::{device, world_of};

pub struct PathStage {
    pub world: World,
    pub materials: Vec<Material>,
    pub links: TraversalLinks,
    pub options: RenderOptions,
    pub resources: Resources,
    pub passes: PathPasses,
    pub context: Arc<Context>,
}

impl PathStage {
    /// Makes a stage for a picture of 40 x 30 pixels, of which a frame draws `2^samples_log2` samples.
    pub fn new(scene: FlatScene, samples_log2: u32) -> Self {
        Self::with_filter(scene, samples_log2, Denoise::Off)
    }

    /// Makes the same stage with a noise filter.
    pub fn with_filter(scene: FlatScene, samples_log2: u32, denoise: Denoise) -> Self {
        Self::with_options(scene, samples_log2, &RenderOptions { denoise, ..RenderOptions::default() })
    }

    /// Makes the same stage for a picture with the layers of some options.
    pub fn with_layers(scene: FlatScene, samples_log2: u32, options: &RenderOptions) -> Self {
        Self::with_options(scene, samples_log2, &RenderOptions { denoise: Denoise::Off, ..options.clone() })
    }

    /// Makes the same stage on another device.
    pub fn on(context: Arc<Context>, scene: FlatScene, samples_log2: u32) -> Self {
        let options = RenderOptions { denoise: Denoise::Off, ..RenderOptions::default() };
        Self::on_with_options(context, scene, samples_log2, &options)
    }

    fn with_options(scene: FlatScene, samples_log2: u32, options: &RenderOptions) -> Self {
        Self::on_with_options(device(), scene, samples_log2, options)
    }

    fn on_with_options(context: Arc<Context>, scene: FlatScene, samples_log2: u32, options: &RenderOptions) -> Self {
        let (integrator, max_depth) = (Integrator::Path, 3);
        let options = RenderOptions { width: 40, height: 30, integrator, max_depth, ..options.clone() };
        let world = world_of(&scene);
        let mut constants = Frame { queue_capacity: 1200 << samples_log2, ..world.frame_constants(&options) };
        constants.samples_log2 = samples_log2;
        constants.set_view(&world.scene().camera, world.bounds(), 0);
        let needs = Needs { constants: &constants, options: &options, n_bounces: constants.max_depth as usize };
        let resources = Resources::new(&context, &world, &needs).expect("resources");
        let links = TraversalLinks::of(world.accel(), &world.scene().triangles, options.traversal);
        let passes = PathPasses::new(&context, &resources.bindings, &options).expect("passes");
        let materials = path_materials(world.scene());
        Self { world, materials, links, options, resources, passes, context }
    }

    /// Returns the twin's inputs for the same scene.
    pub fn inputs(&self) -> KernelInputs<'_> {
        KernelInputs::new(&self.world, self.frame())
            .with_links(&self.links)
            .of_paths(&self.materials, self.world.emitters())
    }

    pub fn frame(&self) -> &Frame {
        self.resources.constants()
    }

    pub fn paths(&self) -> &PathQueue {
        self.resources.paths.as_ref().expect("the frame traces paths")
    }

    /// Sets the number of samples before the frame, and uploads the constants.
    pub fn set_n_earlier(&mut self, n_earlier: u32) {
        let mut frame = *self.frame();
        frame.first_sample = n_earlier;
        frame.n_samples = n_earlier + (1 << frame.samples_log2);
        self.resources.set_constants(&frame);
        self.resources.frame.upload(&[frame]).expect("constants");
    }

    /// Binds the descriptor set, records the commands and runs them.
    pub fn run(&self, record: impl FnOnce(&Commands)) {
        let body = |commands: &Commands| {
            self.resources.bind(commands);
            record(commands);
        };
        self.context.run("test", body).expect("the commands run");
    }

    /// Does what [`PathStage::run`] does for a kernel whose rays can be suspended: repeats it until all have ended.
    pub fn trace(&self, batch: &Batch) {
        let suspended_rays = &self.resources.accel.suspended_rays;
        self.run(|commands| {
            suspended_rays.reset(commands);
            self.passes.path_trace.record(commands, &self.resources, batch);
        });
        let resumed = suspended_rays.finish(&self.context, |commands, resume_pass| {
            self.resources.bind(commands);
            let batch = Batch { resume_pass: resume_pass.constant(), ..*batch };
            self.passes.path_trace.record(commands, &self.resources, &batch);
        });
        resumed.expect("all rays end");
    }

    /// Uploads rows of bounces with these numbers of paths and of shadow rays, and clears the counters.
    pub fn set_n_paths(&self, n_paths_and_shadow_rays: &[(u32, u32)]) {
        let mut rows = vec![Bounce::of_paths(0, self.frame()); self.frame().max_depth as usize];
        let mut before = 0;
        for (row, &(n_paths, n_shadow_rays)) in rows.iter_mut().zip(n_paths_and_shadow_rays) {
            row.set_paths(n_paths, before, self.frame());
            row.n_shadow_rays = n_shadow_rays;
            before = n_shadow_rays;
        }
        self.resources.bounces.upload(&rows).expect("bounces");
        self.context.run("clear", |commands| self.resources.clear_counters(commands)).expect("cleared counters");
    }

    /// The batch of all pixels.
    pub fn batch(&self) -> Batch {
        Batch { n_pixels: 1200, ..FIRST }
    }

    /// Returns the twin's camera rays of all paths, and their hits.
    pub fn rays_and_hits(&self) -> (Vec<PathRay>, Vec<Hit>) {
        let n = 1200 << self.frame().samples_log2;
        let mut rays = vec![PathRay { pixel_ix: 0, ..super::stage::UNTOUCHED_RAY }; n];
        path_begin(&self.inputs(), &self.batch(), &mut rays);
        let all: Vec<u32> = (0..n as u32).collect();
        let mut hits = vec![super::stage::UNTOUCHED_HIT; n];
        path_trace::closest_hits(&self.inputs(), &self.batch(), self.options.traversal, (&all, &rays), &mut hits);
        (rays, hits)
    }
}

/// Fails the test if the validation layer reported messages.
impl Drop for PathStage {
    fn drop(&mut self) {
        let messages = self.context.validation_messages();
        assert!(messages.is_empty() || thread::panicking(), "{} messages: {}", messages.len(), messages.join("\n"));
    }
}
