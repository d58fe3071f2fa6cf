//! A scene on a device with all passes, of which tests run one at a time.

use std::{cell::Cell, sync::Arc, thread};

use kdray::{
    accel::kdtree::TraversalLinks,
    buffers::{Needs, Resources},
    frame::{Denoise, RenderOptions},
    gpu::{Commands, Context},
    layout::{Batch, Bounce, Counters, Frame, Hit, NO_TRIANGLE, PathRay, RAY_GROUP_SIZE},
    passes::Passes,
    reference::inputs::KernelInputs,
    world::{FlatScene, World},
};

use crate::support::{device, world_of};

/// Numbers of rays around a workgroup's size.
pub const RAY_COUNTS: [u32; 7] =
    [0, 1, RAY_GROUP_SIZE - 1, RAY_GROUP_SIZE, RAY_GROUP_SIZE + 1, 5 * RAY_GROUP_SIZE + 7, 2000];

/// Contents of buffers before a kernel runs. They remain where nothing is written.
pub const UNTOUCHED_RAY: PathRay = PathRay {
    origin: glam::Vec3::splat(-7.0),
    pixel_ix: 0xdead,
    direction: glam::Vec3::splat(-7.0),
    source_triangle: 0xdead,
    throughput: glam::Vec3::splat(-7.0),
    t_max: -7.0,
};
pub const UNTOUCHED_HIT: Hit = Hit { t: -7.0, triangle_ix: 0xdead, u: -7.0, v: -7.0 };
pub const UNTOUCHED_WORD: u32 = 0xdead_beef;
pub const UNTOUCHED_PIXEL: [f32; 4] = [-7.0; 4];

pub struct Stage {
    pub world: World,
    pub links: TraversalLinks,
    pub options: RenderOptions,
    pub resources: Resources,
    pub passes: Passes,
    pub context: Arc<Context>,
    /// True in a test that provokes messages of the validation layer.
    pub expects_messages: Cell<bool>,
}

/// Returns options with the noise filter.
pub fn options(width: u32, height: u32) -> RenderOptions {
    RenderOptions { width, height, denoise: Denoise::Paper { threshold: 0.5 }, ..RenderOptions::default() }
}

impl Stage {
    /// Makes a stage with a queue for `capacity` rays.
    pub fn new(scene: FlatScene, options: RenderOptions, capacity: u32) -> Self {
        let context = device();
        let world = world_of(&scene);
        let constants = Frame { queue_capacity: capacity, ..world.frame_constants(&options) };
        let needs = Needs { constants: &constants, options: &options, n_bounces: constants.max_depth as usize };
        let resources = Resources::new(&context, &world, &needs).expect("resources");
        let links = TraversalLinks::of(world.accel(), &world.scene().triangles, options.traversal);
        let passes = Passes::new(&context, &resources.bindings, &options).expect("passes");
        Self { world, links, options, resources, passes, context, expects_messages: Cell::new(false) }
    }

    /// Returns the twin's inputs for the same scene.
    pub fn inputs(&self) -> KernelInputs<'_> {
        KernelInputs::new(&self.world, self.resources.constants()).with_links(&self.links)
    }

    /// Binds the descriptor set, records the commands and runs them.
    pub fn run(&self, record: impl FnOnce(&Commands)) {
        let body = |commands: &Commands| {
            self.resources.bind(commands);
            record(commands);
        };
        self.context.run("test", body).expect("the commands run");
    }

    /// Does what [`Stage::run`] does for kernels whose rays can be suspended: repeats the dispatch until all rays have
    /// ended. `record` receives the batch of a resume pass.
    pub fn trace(&self, batch: &Batch, record: impl Fn(&Commands, &Batch)) {
        let suspended_rays = &self.resources.accel.suspended_rays;
        self.run(|commands| {
            suspended_rays.reset(commands);
            record(commands, batch);
        });
        let resumed = suspended_rays.finish(&self.context, |commands, resume_pass| {
            self.resources.bind(commands);
            record(commands, &Batch { resume_pass: resume_pass.constant(), ..*batch });
        });
        resumed.expect("all rays end");
    }

    /// Records the pass visibility, which the stage's options must need.
    pub fn draw_triangles(&self, commands: &Commands) {
        self.passes.visibility.as_ref().expect("the options ask for it").record(commands, &self.resources);
    }

    /// Uploads the rows of a batch's bounces, which have `n_rays` rays one after the other; later bounces have none.
    /// Sets all counters to 0. Returns the rows.
    pub fn set_n_rays(&self, n_rays: &[u32]) -> Vec<Bounce> {
        let constants = self.resources.constants();
        let mut first_ray = 0;
        let mut rows = vec![Bounce::of(0, constants); constants.max_depth as usize];
        for (depth, row) in rows.iter_mut().enumerate() {
            let n_rays = n_rays.get(depth).copied().unwrap_or(0);
            row.set_rays(first_ray, n_rays, constants);
            row.n_wanted = n_rays;
            first_ray += n_rays;
        }
        self.resources.bounces.upload(&rows).expect("bounces");
        self.context.run("clear", |commands| self.resources.clear_counters(commands)).expect("cleared counters");
        rows
    }

    /// Uploads the first rays of the queue. The rays after them become [`UNTOUCHED_RAY`].
    pub fn set_rays(&self, rays: &[PathRay]) {
        let mut queue = vec![UNTOUCHED_RAY; self.resources.queue.rays.len()];
        queue[..rays.len()].copy_from_slice(rays);
        self.resources.queue.rays.upload(&queue).expect("rays");
    }

    /// Uploads the first hits of the queue. The hits after them become [`UNTOUCHED_HIT`].
    pub fn set_hits(&self, hits: &[Hit]) {
        let mut all = vec![UNTOUCHED_HIT; self.resources.queue.hits.len()];
        all[..hits.len()].copy_from_slice(hits);
        self.resources.queue.hits.upload(&all).expect("hits");
    }

    /// Returns the number of `n` rays that may differ from the twin's. It is 0 on software drivers, whose arithmetic
    /// is exactly the CPU's. Elsewhere divisions are 2.5 units in the last place off (Vulkan's precision of OpFDiv),
    /// so a few rays at corners take another path.
    pub fn n_outliers(&self, n: u32) -> usize {
        if self.context.is_software() { 0 } else { n as usize / 500 }
    }

    /// Returns the kernels' counters, one row per bounce.
    pub fn counters(&self) -> Vec<Counters> {
        self.resources.counters().expect("counters")
    }
}

/// Fails the test if the validation layer reported messages that were not expected, or none where they were expected.
impl Drop for Stage {
    fn drop(&mut self) {
        let messages = self.context.validation_messages();
        let as_expected = messages.is_empty() != self.expects_messages.get();
        assert!(as_expected || thread::panicking(), "{} messages: {}", messages.len(), messages.join("\n"));
    }
}

/// The first batch at its bounce of depth 0.
pub const FIRST: Batch = Batch { first_pixel: 0, n_pixels: 0, bounce_ix: 0, depth: 0, resume_pass: 0 };

/// Returns `n` rays of every nasty kind at the stage's scene, each with its own pixel and throughput.
pub fn some_rays(stage: &Stage, n: u32) -> Vec<PathRay> {
    use crate::support::{MeshWithTree, random::Random, rays::nasty_ray};
    let world = MeshWithTree::new(stage.world.scene().triangles.to_vec());
    (0..n)
        .map(|i| {
            let mut random = Random(u64::from(i));
            let mut ray = nasty_ray(&mut random, &world, i as usize);
            ray.pixel_ix = i % (stage.options.width * stage.options.height);
            ray.throughput = random.in_box(glam::Vec3::ZERO, glam::Vec3::ONE);
            ray
        })
        .collect()
}

/// Returns rays twice. In the first list, the batch's camera rays replace the first rays of `some_rays`. The second
/// list is the content of the queue, in which camera rays are not stored.
pub fn rays_of(stage: &Stage, batch: &Batch, n: u32) -> (Vec<PathRay>, Vec<PathRay>) {
    let mut rays = some_rays(stage, n);
    let mut stored = rays.clone();
    let n_camera = batch.n_pixels as usize;
    kdray::reference::primary_hit::primary_rays(stage.resources.constants(), batch.first_pixel, &mut rays[..n_camera]);
    stored[..n_camera].fill(UNTOUCHED_RAY);
    (rays, stored)
}

/// Returns the twin's hits of `rays`.
pub fn hits_of(stage: &Stage, rays: &[PathRay]) -> Vec<Hit> {
    let mut hits = vec![Hit { triangle_ix: NO_TRIANGLE, ..UNTOUCHED_HIT }; rays.len()];
    kdray::reference::trace::trace(&stage.inputs(), stage.options.traversal, rays, &mut hits);
    hits
}
