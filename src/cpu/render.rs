//! Renders a frame on the CPU: runs the passes of its [`Plan`], batch by batch.

use bytemuck::Zeroable;
use tracing::info_span;

use super::{
    paths::Paths,
    queue::Queue,
    timing::Clock,
    wide_traverser::{are_scattered, search_for},
};
use crate::{
    accel::kdtree::TraversalLinks,
    frame::{
        BounceStats, Denoise, FrameProperties, FrameRenderer, Integrator, MeanLayers, NoiseTiles, Pass, Picture, Plan,
        Primary, Profile, RenderOptions, Scope, Watcher, opaque, plan::passes,
    },
    gpu::GpuError,
    layout::{
        AtrousIteration, Auxiliary, Batch, Bounce, FILTER_CENTRE, Frame, Hit, LIGHT_LAYERS, Material, PathRay,
        PixelAovs, SAMPLE_BLOCK_LOG2, SCAN_GROUP_SIZE, SURFACE_LAYERS,
    },
    reference::{
        accumulate, atrous_filter, auxiliary,
        compact::{self, Parents},
        counting::costs,
        demodulate, denoise,
        inputs::KernelInputs,
        path_accumulate, path_resolve, pixel_aovs, primary_hit, resolve,
        shade::{self, LitRays},
        surface_layers, tonemap,
    },
    scene::Camera,
    world::{World, path_materials},
};

/// How a frame is cut into batches. The picture does not depend on it.
#[derive(Clone, Copy, Debug)]
pub struct Batching {
    /// Number of pixels in a batch. The rays of a batch are traced together.
    pub n_pixels: u32,
    /// Greatest number of rays of a batch, summed over its bounces. A batch with more rays is halved, unless it is
    /// one pixel.
    pub queue_capacity: u32,
}

impl Default for Batching {
    /// With these sizes the buffers of a batch take some 15 MB in most scenes, and at most 110 MB.
    fn default() -> Self {
        Self { n_pixels: 1 << 16, queue_capacity: 1 << 20 }
    }
}

/// The least number of triangles with which scattered rays of a whitted bounce go through the wide hierarchy. With
/// fewer, packets of these rays are faster (docs/experiments.md).
const LEAST_TRIANGLES_OF_BOUNCES: usize = 1 << 16;

/// A renderer of one world on the CPU, which accumulates a picture sample by sample.
pub struct CpuRenderer {
    world: World,
    camera: Camera,
    options: RenderOptions,
    batching: Batching,
    links: TraversalLinks,
    frame: Frame,
    /// The visibility buffer: `width * height` pixels, rows from the top, of the window, which is the crop with the
    /// border that the noise filter reads. The buffers `pixel_*` have the same layout.
    triangle_ids: Vec<u32>,
    /// Radiances of the current sample; after the pass `accumulate`, the means of all samples.
    pixel_radiance: Vec<[f32; 4]>,
    /// Sums of the samples. Not in use before the second sample of a picture.
    pixel_accumulated: Vec<[f32; 4]>,
    /// The layers of light and of surfaces, one after the other, as in `pixel_radiance`. Empty unless the options
    /// request them.
    pixel_layers: Vec<[f32; 4]>,
    /// Sums of the samples of the layers.
    layers_accumulated: Vec<[f32; 4]>,
    /// Radiances after the noise filter. Empty if there is no filter.
    pixel_filtered: Vec<[f32; 4]>,
    pixel_display: Vec<[u8; 4]>,
    /// Empty unless the options request AOVs.
    pixel_aovs: Vec<PixelAovs>,
    /// Empty unless the noise filter `edge` runs.
    pixel_aux: Vec<Auxiliary>,
    /// The next iteration of that filter.
    atrous_iteration: u32,
    queue: Queue,
    paths: Paths,
    /// The materials of paths. Empty for ray trees.
    path_materials: Vec<Material>,
    /// The batch that is drawn.
    batch: Batch,
    /// Number of rays beyond which the current batch is halved: `queue_capacity`, or no limit for one pixel.
    most_rays: u32,
    /// Counts of the current batch, one row for each bounce.
    batch_stats: Vec<BounceStats>,
    /// Number of samples of each pixel in the picture.
    n_samples: u32,
    /// Number of pixels of the pending sample that are drawn; 0 if no sample is pending.
    n_drawn: u32,
    clock: Clock,
    /// Counts of all batches of the sample, one row for each bounce.
    bounces: Vec<BounceStats>,
    n_batches: u32,
}

impl CpuRenderer {
    /// Creates a renderer with buffers for a picture of a world.
    pub fn new(world: &World, options: &RenderOptions, batching: Batching) -> Self {
        let frame = world.frame_constants(options);
        let n_pixels = frame.width as usize * frame.height as usize;
        let n_layers = options.mean_layers().len();
        if options.integrator == Integrator::Path {
            // Makes the hierarchy now, so that the time of the first frame is that of drawing alone.
            search_for(world, options.traversal, true);
        }
        Self {
            camera: world.scene().camera,
            world: world.clone(),
            options: options.clone(),
            batching,
            links: TraversalLinks::of(world.accel(), &world.scene().triangles, options.traversal),
            frame,
            triangle_ids: vec![0; n_pixels],
            pixel_radiance: vec![[0.0; 4]; n_pixels],
            pixel_accumulated: Vec::new(),
            pixel_layers: vec![[0.0; 4]; n_layers * n_pixels],
            layers_accumulated: Vec::new(),
            pixel_filtered: Vec::new(),
            pixel_display: vec![[0; 4]; n_pixels],
            pixel_aovs: vec![PixelAovs::default(); if options.pixel_aovs { n_pixels } else { 0 }],
            pixel_aux: vec![Auxiliary::default(); if options.noise_filter() == Denoise::Edge { n_pixels } else { 0 }],
            atrous_iteration: 0,
            queue: Queue::default(),
            paths: Paths::default(),
            path_materials: if options.integrator == Integrator::Path {
                path_materials(world.scene())
            } else {
                Vec::new()
            },
            batch: Batch::default(),
            most_rays: 0,
            batch_stats: Vec::new(),
            n_samples: 0,
            n_drawn: 0,
            clock: Clock::start(),
            bounces: Vec::new(),
            n_batches: 0,
        }
    }

    /// Returns a renderer of the same world by other options, with the same camera and batches.
    #[cfg(feature = "view")]
    pub fn with_options(&self, options: &RenderOptions) -> Self {
        self.remade(&self.world, options)
    }

    fn remade(&self, world: &World, options: &RenderOptions) -> Self {
        Self { camera: self.camera, ..Self::new(world, options, self.batching) }
    }

    /// Draws another world from now on. The next sample is the first of a new picture.
    pub fn set_world(&mut self, world: &World) {
        if !world.shares_geometries(&self.world) {
            *self = self.remade(world, &self.options);
            return;
        }
        self.frame.set_light_of(&world.frame_constants(&self.options));
        self.world = world.clone();
        self.reset_samples();
    }

    /// Draws one more sample of each pixel on the current rayon pool. The first sample is at the pixel's centre. Of
    /// paths, as many samples are drawn as [`FrameRenderer::set_samples_per_frame`] says. The picture is the mean of
    /// all samples.
    pub fn draw_sample(&mut self) -> Profile {
        self.draw_sample_with(|_| ())
    }

    /// Draws as [`CpuRenderer::draw_sample`] does. After each batch it calls `progress` with the share of the sample's
    /// pixels that are drawn, 0 to 1.
    pub fn draw_sample_with(&mut self, mut progress: impl FnMut(f32)) -> Profile {
        loop {
            let drawn = self.draw_batch();
            match drawn {
                Some(profile) => {
                    progress(1.0);
                    return profile;
                }
                None => progress(self.progress()),
            }
        }
    }

    /// Draws one batch of the pending sample, or of the next sample if none is pending. Returns the whole sample's
    /// profile after its last batch, and None before that. Only the last batch changes the displayed picture. A pending
    /// sample is dropped by [`FrameRenderer::reset_samples`] alone.
    pub fn draw_batch(&mut self) -> Option<Profile> {
        let of_paths = self.options.integrator == Integrator::Path;
        let is_new = self.n_drawn == 0;
        if is_new {
            self.clock = Clock::start();
            self.bounces.clear();
            self.n_batches = 0;
            self.frame.set_view(&self.camera, self.world.bounds(), self.n_samples);
            if self.n_samples == 1 && !of_paths {
                self.pixel_accumulated.clone_from(&self.pixel_radiance);
                self.layers_accumulated.clone_from(&self.pixel_layers);
            }
            self.pixel_aovs.fill(PixelAovs::default());
        }
        let plan = Plan::new(&self.frame_properties());
        if is_new {
            passes(&plan.visibility).for_each(|pass| self.run(pass, 0));
        }
        let n_pixels = self.pixel_radiance.len() as u32;
        let most_pixels = (self.batching.n_pixels >> self.frame.samples_log2).max(1);
        let (first_pixel, n_pixels_of_batch) = (self.n_drawn, most_pixels.min(n_pixels - self.n_drawn));
        if of_paths {
            self.batch_of_paths(&plan, first_pixel, n_pixels_of_batch);
        } else {
            self.batch(&plan, first_pixel, n_pixels_of_batch);
        }
        self.n_drawn += n_pixels_of_batch;
        if self.n_drawn < n_pixels {
            return None;
        }
        self.n_drawn = 0;
        passes(&plan.image).for_each(|pass| self.run(pass, 0));
        self.n_samples = self.frame.n_samples;
        Some(self.profile())
    }

    /// Returns the share of the pending sample that is drawn; 0 if no sample is pending.
    pub fn progress(&self) -> f32 {
        self.n_drawn as f32 / self.pixel_radiance.len() as f32
    }

    /// Sets the most pixels of a batch, from the next batch on; none for the default.
    #[cfg(feature = "view")]
    pub fn limit_batches(&mut self, most_pixels: Option<u32>) {
        let Batching { n_pixels, .. } = Batching::default();
        self.batching.n_pixels = most_pixels.map_or(n_pixels, |most| most.clamp(1, n_pixels));
    }

    /// Sets the index of the picture's first sample: any index if the picture has a single sample, else that of an
    /// aligned block of its samples. Only frames of paths know it. The next sample is the first of a new picture.
    pub fn set_first_sample(&mut self, first_sample: u32) {
        self.options.paths.first_sample = first_sample;
        self.frame.set_options(&self.options);
        self.reset_samples();
    }

    /// Sets the random numbers of the next pictures ([`PathOptions::seed`](crate::frame::PathOptions::seed)). The next
    /// sample is the first of a new picture.
    pub fn set_seed(&mut self, seed: u32) {
        self.options.paths.seed = seed;
        self.frame.set_options(&self.options);
        self.reset_samples();
    }

    /// Sets the part of the picture that is drawn next: noise tiles or, without them, the crop of the options. The next
    /// sample is the first of a new picture, and has the index `first_sample`.
    pub(crate) fn set_window(&mut self, noise_tiles: Option<NoiseTiles>, first_sample: u32) {
        self.options.noise_tiles = noise_tiles;
        self.set_first_sample(first_sample);
        let n_pixels = self.frame.width as usize * self.frame.height as usize;
        let n_layers = self.options.mean_layers().len();
        self.pixel_radiance.resize(n_pixels, [0.0; 4]);
        self.pixel_layers.resize(n_layers * n_pixels, [0.0; 4]);
        self.pixel_display.resize(n_pixels, [0; 4]);
        self.pixel_aovs.resize(if self.options.pixel_aovs { n_pixels } else { 0 }, PixelAovs::default());
    }

    #[cfg(feature = "view")]
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Moves the camera. The next sample is the first of a new picture.
    pub fn set_camera(&mut self, camera: &Camera) {
        self.camera = *camera;
        self.reset_samples();
    }

    /// Returns the mean of the samples so far, after the noise filter if there is one.
    pub fn picture(&self) -> Picture {
        let (window, crop) = (self.options.window(), self.options.crop_or_whole());
        // The filter `edge` has a second half of `pixel_filtered` for its iterations.
        let filtered = if self.filters() { &self.pixel_filtered } else { &self.pixel_radiance };
        Picture {
            width: crop.width(),
            height: crop.height(),
            radiance: opaque(window.cut(&filtered[..self.pixel_radiance.len()], &crop)),
            display: window.cut(&self.pixel_display, &crop),
        }
    }

    /// Returns the AOVs of each pixel of the picture: the first hit, and the costs of the pixel's rays, in the
    /// sample that was drawn last. Of paths, they are those of the first sample of the frame that was drawn last, and
    /// only the first frame of a picture has costs.
    ///
    /// # Panics
    /// The options do not request AOVs.
    pub fn pixel_aovs(&self) -> Vec<PixelAovs> {
        assert!(self.options.pixel_aovs, "the options ask for AOVs");
        self.options.window().cut(&self.pixel_aovs, &self.options.crop_or_whole())
    }

    /// Returns the properties that decide the passes of the next sample. The CPU does not rasterize: for both kinds
    /// of rasterization it runs the pass `visibility` of `Primary::Raster`, which here traces a ray for each pixel.
    fn frame_properties(&self) -> FrameProperties {
        let properties = FrameProperties::new(&self.options, &self.frame);
        let primary = if properties.primary == Primary::Trace { Primary::Trace } else { Primary::Raster };
        FrameProperties { primary, adds_samples: self.n_samples > 0, ..properties }
    }

    /// Draws a batch of pixels: first all bounces are traced, then their hits are lit. If there are more rays than
    /// the queue may hold, the two halves of the batch are drawn instead.
    fn batch(&mut self, plan: &Plan, first_pixel: u32, n_pixels: u32) {
        self.batch = Batch { first_pixel, n_pixels, ..Batch::default() };
        self.most_rays = if n_pixels == 1 { u32::MAX } else { self.batching.queue_capacity };
        self.batch_stats.clear();
        for (depth, bounce) in (0..).zip(&plan.bounces) {
            passes(bounce).for_each(|pass| self.run(pass, depth));
            match self.queue.bounces.get(depth as usize + 1) {
                Some(next) if next.overflow != 0 => {
                    self.clock.end_batch(&self.batch_stats);
                    self.batch(plan, first_pixel, n_pixels / 2);
                    self.batch(plan, first_pixel + n_pixels / 2, n_pixels - n_pixels / 2);
                    return;
                }
                Some(next) if next.n_rays > 0 => (),
                _ => break,
            }
        }
        if self.options.pixel_aovs {
            self.note_costs();
        }
        passes(&plan.light).for_each(|pass| self.run(pass, 0));
        self.count();
    }

    /// Draws a batch of paths: all samples of the frame, of some pixels.
    fn batch_of_paths(&mut self, plan: &Plan, first_pixel: u32, n_pixels: u32) {
        self.batch = Batch { first_pixel, n_pixels, ..Batch::default() };
        self.batch_stats.clear();
        for (depth, bounce) in (0..).zip(&plan.bounces) {
            self.batch.depth = depth;
            passes(bounce).for_each(|pass| self.run(pass, depth));
            // After a bounce that ends all paths, its shadow rays are still to be traced.
            if self.queue.bounces[depth as usize].n_rays == 0 {
                break;
            }
        }
        let after_bounces = plan.bounces.len() as u32;
        self.batch.depth = after_bounces;
        passes(&plan.light).for_each(|pass| self.run(pass, after_bounces));
        self.count();
    }

    /// Runs a pass, and times it. `depth` is its bounce, and is ignored by a pass that belongs to no bounce.
    fn run(&mut self, pass: Pass, depth: u32) {
        if pass == Pass::PathTrace && self.options.pixel_aovs && self.n_samples == 0 {
            self.note_costs_of_paths(depth);
        }
        let start_ms = self.clock.elapsed_ms();
        match pass {
            Pass::Visibility => self.visibility(),
            Pass::PrimaryHit | Pass::Trace => self.closest_hits(pass, depth),
            Pass::PixelAovs => self.note_aovs(),
            Pass::SurfaceLayers => self.surface_layers(),
            Pass::CompactReduce => self.compact_reduce(depth),
            Pass::CompactSpine if self.options.integrator == Integrator::Path => {
                self.paths.spine(&self.frame, depth, &mut self.queue);
            }
            Pass::CompactSpine => self.compact_spine(depth),
            // The queue has no room for the next bounce.
            Pass::CompactScatter if self.queue.bounces[depth as usize + 1].overflow != 0 => return,
            Pass::CompactScatter => self.compact_scatter(depth),
            Pass::Shadow => self.shadow(),
            Pass::Shade => self.shade(),
            Pass::Resolve => self.resolve(),
            Pass::Accumulate => self.accumulate(),
            Pass::Denoise => self.denoise(),
            Pass::Tonemap => self.tonemap(),
            Pass::PathBegin => self.path_begin(),
            Pass::PathTrace => self.path_trace(depth),
            Pass::PathScatter => self.path_scatter(),
            Pass::PathCompact => self.paths.compact(depth, &self.queue),
            Pass::PathLayers => self.path_layers(),
            Pass::PathResolve => self.path_resolve(),
            Pass::PathAccumulate => self.path_accumulate(),
            Pass::Auxiliary => self.auxiliary(),
            Pass::Demodulate => self.demodulate(),
            Pass::AtrousFilter => self.atrous_filter(),
            Pass::RasterizeTriangles | Pass::RasterizeBlocks | Pass::FalseColor => {
                unreachable!("the CPU's plan has no `{}`", pass.name())
            }
        }
        let of_bounce = match pass {
            Pass::PathLayers => depth + 1 < LIGHT_LAYERS,
            _ => pass.scope() == Scope::Bounce,
        };
        self.clock.record(pass, of_bounce.then_some(depth), start_ms);
    }

    fn path_begin(&mut self) {
        let Self { world, options, frame, batch, paths, queue, .. } = self;
        let n_paths = batch.n_pixels << frame.samples_log2;
        let inputs = KernelInputs::new(world, frame).with_noise_tiles(tiles_of(options));
        paths.begin(&inputs, batch, n_paths, queue);
    }

    /// Adds the costs of the rays that the pass `path_trace` is about to trace to the AOVs. They are traced a second
    /// time to be counted, so later frames, whose counts nobody reads, go without.
    fn note_costs_of_paths(&mut self, depth: u32) {
        let Self { world, options, frame, links, paths, queue, path_materials, pixel_aovs, .. } = self;
        let inputs = KernelInputs::new(world, frame).with_links(links).of_paths(path_materials, world.emitters());
        paths.note_costs(&inputs, &Batch { depth, ..self.batch }, options.traversal, queue, pixel_aovs);
    }

    /// Finds the closest hits of the bounce's paths, tests the shadow rays of the bounce before, and counts both.
    fn path_trace(&mut self, depth: u32) {
        let Self { world, frame, links, paths, queue, path_materials, .. } = self;
        let inputs = KernelInputs::new(world, frame).with_links(links).of_paths(path_materials, world.emitters());
        let (batch, traversal) = (&Batch { depth, ..self.batch }, self.options.traversal);
        let search = search_for(world, traversal, depth > 0);
        let (n_hits, n_shadow_rays) = paths.trace(&inputs, batch, search, queue);
        if let Some(before) = self.batch_stats.last_mut() {
            before.n_shadow_rays = n_shadow_rays.into();
        }
        let n_rays = self.queue.bounces[depth as usize].n_rays.into();
        self.batch_stats.push(BounceStats { n_rays, n_hits: n_hits.into(), n_shadow_rays: 0 });
    }

    fn path_scatter(&mut self) {
        let Self { world, options, frame, links, batch, paths, queue, path_materials, .. } = self;
        let inputs = KernelInputs::new(world, frame).with_links(links).of_paths(path_materials, world.emitters());
        let inputs = inputs.with_noise_tiles(tiles_of(options));
        paths.scatter(&inputs, batch, queue);
    }

    fn auxiliary(&mut self) {
        let Self { world, frame, batch, paths, queue, path_materials, pixel_aux, .. } = self;
        let inputs = KernelInputs::new(world, frame).of_paths(path_materials, world.emitters());
        auxiliary::auxiliary(&inputs, batch, &queue.hits, &paths.states, pixel_aux);
    }

    fn demodulate(&mut self) {
        let Self { frame, pixel_radiance, pixel_aux, pixel_filtered, .. } = self;
        pixel_filtered.resize(2 * pixel_radiance.len(), [0.0; 4]);
        demodulate::demodulate(frame, pixel_radiance, pixel_aux, pixel_filtered);
        self.atrous_iteration = 0;
    }

    fn atrous_filter(&mut self) {
        let iteration = AtrousIteration { iteration_ix: self.atrous_iteration };
        atrous_filter::atrous_filter(&self.frame, &iteration, &self.pixel_aux, &mut self.pixel_filtered);
        self.atrous_iteration += 1;
    }

    fn path_layers(&mut self) {
        let Self { frame, batch, paths, pixel_radiance, pixel_layers, .. } = self;
        let of_light = &mut pixel_layers[..LIGHT_LAYERS as usize * pixel_radiance.len()];
        paths.layers(frame, batch, of_light);
    }

    fn path_resolve(&mut self) {
        let Self { frame, batch, paths, pixel_radiance, .. } = self;
        path_resolve::path_resolve(frame, batch, &paths.states, pixel_radiance);
    }

    fn path_accumulate(&mut self) {
        let Self { frame, pixel_radiance, pixel_accumulated, pixel_layers, layers_accumulated, .. } = self;
        path_accumulate::path_accumulate(frame, pixel_radiance, pixel_accumulated);
        path_accumulate::path_accumulate(frame, pixel_layers, layers_accumulated);
    }

    fn visibility(&mut self) {
        let inputs = KernelInputs::new(&self.world, &self.frame).with_links(&self.links);
        super::visibility(&inputs, self.options.traversal.into(), &mut self.triangle_ids);
    }

    /// Writes the primary rays to the queue.
    fn primary_rays(&mut self) {
        let Queue { rays, bounces, .. } = &mut self.queue;
        *bounces = vec![Bounce::of(self.batch.n_pixels, &self.frame)];
        rays.resize(self.batch.n_pixels as usize, PathRay::zeroed());
        primary_hit::primary_rays(&self.frame, self.batch.first_pixel, rays);
    }

    /// Finds the closest hits of the bounce's rays, and counts them. As on a device, the first pass makes the primary
    /// rays.
    fn closest_hits(&mut self, pass: Pass, depth: u32) {
        if depth == 0 {
            self.primary_rays();
        }
        let inputs = KernelInputs::new(&self.world, &self.frame).with_links(&self.links);
        let inputs = if depth == 0 { inputs.of_camera() } else { inputs };
        let Queue { rays, bounces, hits, .. } = &mut self.queue;
        hits.resize(rays.len(), Hit::zeroed());
        let places = bounces[depth as usize].rays();
        let (rays, hits) = (&rays[places.clone()], &mut hits[places]);
        let is_scattered = depth > 0
            && self.world.scene().triangles.len() >= LEAST_TRIANGLES_OF_BOUNCES
            && are_scattered(rays, self.world.bounds(), |ray| (ray.origin, ray.direction));
        let (ids, search) = (&self.triangle_ids, search_for(&self.world, self.options.traversal, is_scattered));
        let n_hits = match pass {
            Pass::PrimaryHit => primary_hit::primary_hit(&inputs, ids, rays, hits),
            _ => super::trace(&inputs, search, rays, hits),
        };
        self.batch_stats.push(BounceStats { n_rays: rays.len() as u64, n_hits: n_hits.into(), n_shadow_rays: 0 });
    }

    /// Records the AOVs of the primary rays' hits.
    fn note_aovs(&mut self) {
        let inputs = KernelInputs::new(&self.world, &self.frame).with_links(&self.links);
        let Queue { rays, hits, .. } = &self.queue;
        let of_paths = self.options.integrator == Integrator::Path;
        let rays_per_pixel = if of_paths { 1 << self.frame.samples_log2 } else { 1 };
        let first_hits = rays.iter().zip(hits).step_by(rays_per_pixel);
        pixel_aovs::pixel_aovs(&inputs, first_hits, &mut self.pixel_aovs);
    }

    /// Adds up what the camera rays hit.
    fn surface_layers(&mut self) {
        let Self { world, frame, queue, path_materials, pixel_layers, pixel_radiance, options, .. } = self;
        let inputs = KernelInputs::new(world, frame);
        let (inputs, samples_log2) = match options.integrator {
            Integrator::Path => (inputs.of_paths(path_materials, world.emitters()), frame.samples_log2),
            Integrator::Whitted => (inputs, 0),
        };
        let begin = pixel_layers.len() - SURFACE_LAYERS as usize * pixel_radiance.len();
        let (of_camera, layers) = ((&queue.rays[..], &queue.hits[..]), &mut pixel_layers[begin..]);
        surface_layers::surface_layers(&inputs, samples_log2, of_camera, layers);
    }

    /// Adds the traversal costs of the rays of all bounces to the AOVs.
    fn note_costs(&mut self) {
        let inputs = KernelInputs::new(&self.world, &self.frame).with_links(&self.links);
        let (traversal, pixels) = (self.options.traversal, &mut self.pixel_aovs);
        let Queue { rays, bounces, hits, .. } = &self.queue;
        let in_pixel = |ray: &PathRay| (ray.pixel_ix, ray.into());
        let (of_camera, of_bounces) = rays.split_at(bounces[0].n_rays as usize);
        match self.options.primary {
            Primary::Trace => {
                let of_camera: Vec<_> = of_camera.iter().map(in_pixel).collect();
                costs::count_rays::<false>(&inputs.of_camera(), traversal, &of_camera, pixels);
            }
            _ => costs::count_rasterized(of_camera, hits, pixels),
        }
        let of_bounces: Vec<_> = of_bounces.iter().map(in_pixel).collect();
        costs::count_rays::<false>(&inputs, traversal, &of_bounces, pixels);
        costs::count_shadow(&inputs, traversal, rays, hits, pixels);
    }

    /// Determines which rays continue from the bounce's hits, and counts them.
    fn compact_reduce(&mut self, depth: u32) {
        let inputs = KernelInputs::new(&self.world, &self.frame).with_links(&self.links);
        let Queue { rays, bounces, hits, child_flags, scan_blocks, .. } = &mut self.queue;
        let places = bounces[depth as usize].rays();
        child_flags.resize(rays.len(), 0);
        scan_blocks.resize(places.len().div_ceil(SCAN_GROUP_SIZE as usize), 0);
        let parents = Parents { rays: &rays[places.clone()], hits: &hits[places.clone()] };
        compact::reduce(&inputs, parents, &mut child_flags[places], scan_blocks);
    }

    /// Computes the prefix sums of the counts, and from them the size of the next bounce.
    fn compact_spine(&mut self, depth: u32) {
        let constants = Frame { queue_capacity: self.most_rays, ..self.frame };
        let Queue { bounces, scan_blocks, .. } = &mut self.queue;
        let (this, mut next) = (bounces[depth as usize], Bounce::of(0, &self.frame));
        compact::spine(scan_blocks, &constants, &this, &mut next);
        bounces.push(next);
    }

    /// Writes the next bounce's rays behind those of this bounce.
    fn compact_scatter(&mut self, depth: u32) {
        let inputs = KernelInputs::new(&self.world, &self.frame).with_links(&self.links);
        let Queue { rays, bounces, hits, child_flags, first_children, scan_blocks, .. } = &mut self.queue;
        let (this, next) = (bounces[depth as usize], bounces[depth as usize + 1]);
        let places = this.rays();
        first_children.resize(rays.len(), 0);
        rays.resize(next.rays().end, PathRay::zeroed());
        let (so_far, next_rays) = rays.split_at_mut(next.rays().start);
        let parents = Parents { rays: &so_far[places.clone()], hits: &hits[places.clone()] };
        let (flags, first_children) = (&child_flags[places.clone()], &mut first_children[places]);
        compact::scatter(&inputs, parents, flags, scan_blocks, next.first_ray, first_children, next_rays);
    }

    /// Traces the shadow rays of all bounces, and counts them.
    fn shadow(&mut self) {
        let inputs = KernelInputs::new(&self.world, &self.frame).with_links(&self.links);
        let Queue { rays, bounces, hits, light_visibility, .. } = &mut self.queue;
        light_visibility.resize(rays.len() * inputs.lights.len(), 0);
        let search = self.options.traversal.into();
        for (bounce, stats) in bounces.iter().zip(&mut self.batch_stats) {
            let n_shadow_rays = super::shadow(&inputs, search, &bounce.rays(), (rays, hits), light_visibility);
            stats.n_shadow_rays = n_shadow_rays.into();
        }
    }

    fn shade(&mut self) {
        let inputs = KernelInputs::new(&self.world, &self.frame).with_links(&self.links);
        let Queue { rays, bounces, hits, ray_radiance, light_visibility, .. } = &mut self.queue;
        ray_radiance.resize(rays.len(), [0.0; 4]);
        let n_of_camera = bounces[0].rays().end;
        let lit = LitRays { rays, hits, n_of_camera, light_visibility };
        shade::shade(&inputs, lit, ray_radiance);
    }

    fn resolve(&mut self) {
        let Queue { rays, bounces, first_children, ray_radiance, .. } = &self.queue;
        resolve::resolve(bounces, rays, ray_radiance, first_children, &mut self.pixel_radiance);
    }

    fn count(&mut self) {
        let stats = &self.batch_stats;
        self.n_batches += 1;
        self.bounces.resize(self.bounces.len().max(stats.len()), BounceStats::default());
        self.bounces.iter_mut().zip(stats).for_each(|(sum, bounce)| sum.add(bounce));
        self.clock.end_batch(stats);
    }

    fn accumulate(&mut self) {
        let Self { frame, pixel_radiance, pixel_accumulated, pixel_layers, layers_accumulated, .. } = self;
        accumulate::accumulate(frame, &[], pixel_radiance, pixel_accumulated);
        accumulate::accumulate(frame, &[], pixel_layers, layers_accumulated);
    }

    fn denoise(&mut self) {
        self.pixel_filtered.resize(self.pixel_radiance.len(), [0.0; 4]);
        denoise::denoise(&self.frame, &self.pixel_radiance, &mut self.pixel_filtered);
    }

    fn tonemap(&mut self) {
        let filtered = if self.filters() { &self.pixel_filtered } else { &self.pixel_radiance };
        tonemap::tonemap(&self.frame, self.options.tonemap, filtered, &mut self.pixel_display);
    }

    fn filters(&self) -> bool {
        self.options.noise_filter() != Denoise::Off
    }

    fn profile(&self) -> Profile {
        Profile {
            device: format!("CPU, {} threads", rayon::current_num_threads()),
            frame_ms: Some(self.clock.elapsed_ms()),
            begun_at: Some(self.clock.begun_at()),
            passes: self.clock.passes().to_vec(),
            bounces: self.bounces.clone(),
            n_batches: self.n_batches,
        }
    }
}

impl FrameRenderer for CpuRenderer {
    fn options(&self) -> &RenderOptions {
        &self.options
    }

    fn n_samples(&self) -> u32 {
        self.n_samples
    }

    fn reset_samples(&mut self) {
        (self.n_samples, self.n_drawn) = (0, 0);
    }

    fn most_samples_log2(&self) -> u32 {
        SAMPLE_BLOCK_LOG2
    }

    fn samples_log2(&mut self) -> &mut u32 {
        &mut self.frame.samples_log2
    }

    fn draw_frame(&mut self, watcher: &mut impl Watcher) -> Result<Profile, GpuError> {
        Ok(info_span!("render").in_scope(|| self.draw_sample_with(|share| watcher.sample_progress(share))))
    }

    fn set_noise_tiles(&mut self, tiles: NoiseTiles) -> Result<(), GpuError> {
        let first_sample = tiles.first_sample();
        self.set_window(Some(tiles), first_sample);
        Ok(())
    }

    fn window_mean(&self) -> Result<Vec<[f32; 4]>, GpuError> {
        Ok(self.pixel_radiance.clone())
    }

    fn pixel_aovs(&self) -> Result<Vec<PixelAovs>, GpuError> {
        Ok(self.pixel_aovs())
    }

    fn centre_aovs(&mut self) -> Result<Vec<PixelAovs>, GpuError> {
        self.frame.set_view(&self.camera, self.world.bounds(), 0);
        let Self { world, options, batching, links, frame, queue, paths, path_materials, pixel_aovs, .. } = self;
        let frame = Frame { samples_log2: 0, pixel_filter: FILTER_CENTRE, aperture: 0.0, ..*frame };
        let scene = KernelInputs::new(world, &frame).with_links(links);
        let inputs = scene.of_paths(path_materials, world.emitters()).with_noise_tiles(tiles_of(options));
        let search = search_for(world, options.traversal, false);
        for first_pixel in (0..pixel_aovs.len() as u32).step_by(batching.n_pixels as usize) {
            let n_pixels = batching.n_pixels.min(pixel_aovs.len() as u32 - first_pixel);
            let batch = Batch { first_pixel, n_pixels, ..Batch::default() };
            paths.begin(&inputs, &batch, n_pixels, queue);
            paths.trace(&inputs, &batch, search, queue);
            pixel_aovs::pixel_aovs(&scene, queue.rays.iter().zip(&queue.hits), pixel_aovs);
        }
        self.reset_samples();
        Ok(self.pixel_aovs())
    }

    fn mean_layers(&self) -> Result<MeanLayers, GpuError> {
        let (window, crop) = (self.options.window(), self.options.crop_or_whole());
        let mut layers = MeanLayers::default();
        let pixels = self.pixel_layers.chunks_exact(self.pixel_radiance.len());
        layers.0[self.options.mean_layers()]
            .iter_mut()
            .zip(pixels)
            .for_each(|(layer, pixels)| *layer = window.cut(pixels, &crop));
        Ok(layers)
    }
}

/// Returns the places of the noise tiles that are drawn, none for a rectangle of the picture.
fn tiles_of(options: &RenderOptions) -> &[u32] {
    options.noise_tiles.as_ref().map_or(&[], NoiseTiles::words)
}
