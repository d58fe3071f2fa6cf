//! The frame on the CPU: the order of passes, batch by batch.

use bytemuck::Zeroable;

use super::{
    accumulate,
    bindings::Bindings,
    compact::{self, Parents},
    costs, denoise, features, primary_hit,
    queue::Queue,
    resolve,
    shade::{self, LitRays},
    shadow,
    timing::Clock,
    tonemap, trace, visibility,
};
use crate::{
    accel::kdtree::Extras,
    frame::{BounceStats, Picture, Primary, Profile, RenderOptions, frame_constants},
    layout::{Bounce, Feature, Frame, Hit, Ray, SCAN_GROUP_SIZE},
    scene::Camera,
    world::World,
};

/// How a frame is cut into pieces. The picture does not depend on it.
#[derive(Clone, Copy, Debug)]
pub struct Batching {
    /// Pixels whose rays are traced together.
    pub n_pixels: u32,
    /// Rays of all bounces beyond which a batch of more than one pixel is halved.
    pub queue_capacity: u32,
}

impl Default for Batching {
    /// Some 15 MB of rays and what belongs to them as a rule, and 110 MB at the most.
    fn default() -> Self {
        Self { n_pixels: 1 << 16, queue_capacity: 1 << 20 }
    }
}

/// A scene, and its picture in the making, sample by sample.
pub struct Renderer {
    world: World,
    camera: Camera,
    options: RenderOptions,
    batching: Batching,
    extras: Extras,
    frame: Frame,
    /// Like `pixel_radiance`: `width * height` of the window, rows from the top.
    triangle_ids: Vec<u32>,
    /// The sample, then the mean of all.
    pixel_radiance: Vec<[f32; 4]>,
    /// Sums of samples; empty before there is a second one.
    pixel_accumulated: Vec<[f32; 4]>,
    pixel_filtered: Vec<[f32; 4]>,
    pixel_display: Vec<[u8; 4]>,
    /// Empty where the options do not ask for them.
    pixel_features: Vec<Feature>,
    queue: Queue,
    /// Samples a pixel that the picture holds.
    n_samples: u32,
    clock: Clock,
    bounces: Vec<BounceStats>,
    n_batches: u32,
}

impl Renderer {
    /// Makes room for a picture of a world.
    pub fn new(world: &World, options: &RenderOptions, batching: Batching) -> Self {
        let frame = frame_constants(world.scene(), world.tree(), options);
        let n_pixels = frame.width as usize * frame.height as usize;
        Self {
            camera: world.scene().camera,
            world: world.clone(),
            options: options.clone(),
            batching,
            extras: Extras::new(world.tree(), options.traversal),
            frame,
            triangle_ids: vec![0; n_pixels],
            pixel_radiance: vec![[0.0; 4]; n_pixels],
            pixel_accumulated: Vec::new(),
            pixel_filtered: vec![[0.0; 4]; n_pixels],
            pixel_display: vec![[0; 4]; n_pixels],
            pixel_features: vec![Feature::default(); if options.features { n_pixels } else { 0 }],
            queue: Queue::default(),
            n_samples: 0,
            clock: Clock::start(),
            bounces: Vec::new(),
            n_batches: 0,
        }
    }

    /// Draws the frame by one sample more a pixel on the current rayon pool, the first at its centre; the picture is the
    /// mean of all.
    pub fn draw_sample(&mut self) -> Profile {
        self.draw_sample_with(|_| ())
    }

    /// Draws as [`Renderer::draw_sample`] does, and tells the share of the sample's pixels that are drawn, 0 to 1, after each
    /// batch.
    pub fn draw_sample_with(&mut self, mut progress: impl FnMut(f32)) -> Profile {
        self.clock = Clock::start();
        self.bounces.clear();
        self.n_batches = 0;
        self.frame.set_view(&self.camera, self.n_samples);
        if self.n_samples == 1 {
            self.pixel_accumulated.clone_from(&self.pixel_radiance);
        }
        self.pixel_features.fill(Feature::default());
        if self.options.primary != Primary::Trace {
            self.visibility();
        }
        let n_pixels = self.pixel_radiance.len() as u32;
        for first_pixel in (0..n_pixels).step_by(self.batching.n_pixels as usize) {
            let n_pixels_of_batch = self.batching.n_pixels.min(n_pixels - first_pixel);
            self.batch(first_pixel, n_pixels_of_batch);
            progress((first_pixel + n_pixels_of_batch) as f32 / n_pixels as f32);
        }
        self.finish();
        self.n_samples += 1;
        self.profile()
    }

    /// Looks from elsewhere from the next sample on, which is the first of a new picture.
    pub fn set_camera(&mut self, camera: &Camera) {
        self.camera = *camera;
        self.reset_samples();
    }

    pub fn options(&self) -> &RenderOptions {
        &self.options
    }

    /// The next sample is the first of a new picture.
    pub fn reset_samples(&mut self) {
        self.n_samples = 0;
    }

    /// The mean of the samples so far, filtered.
    pub fn picture(&self) -> Picture {
        let (window, crop) = (self.options.window(), self.options.crop_or_whole());
        Picture {
            width: crop.width(),
            height: crop.height(),
            radiance: window.part(&self.pixel_filtered, &crop),
            display: window.part(&self.pixel_display, &crop),
        }
    }

    /// What the rays of each of the picture's pixels met and cost, of the sample drawn last.
    ///
    /// # Panics
    /// The options do not ask for features.
    pub fn features(&self) -> Vec<Feature> {
        assert!(self.options.features, "the options ask for features");
        self.options.window().part(&self.pixel_features, &self.options.crop_or_whole())
    }

    fn visibility(&mut self) {
        let bindings = Bindings::new(self.world.scene(), self.world.tree(), &self.frame).with_extras(&self.extras);
        let (traversal, ids) = (self.options.traversal, &mut self.triangle_ids);
        self.clock.time("visibility", None, || visibility::visibility(&bindings, traversal, ids));
    }

    /// Algorithm 1 for a batch of pixels: all bounces and their light, or those of its halves where there are more rays than the
    /// queue is meant to hold.
    fn batch(&mut self, first_pixel: u32, n_pixels: u32) {
        let capacity = if n_pixels == 1 { u32::MAX } else { self.batching.queue_capacity };
        let mut stats = Vec::new();
        self.primary_rays(first_pixel, n_pixels);
        for depth in 0..self.options.max_depth {
            stats.push(self.closest_hits(depth));
            if depth == 0 && self.options.features {
                self.note_features();
            }
            if depth + 1 == self.options.max_depth {
                break;
            }
            let next = self.next_rays(depth, capacity);
            if next.overflow != 0 {
                self.clock.end_batch(&stats);
                self.batch(first_pixel, n_pixels / 2);
                self.batch(first_pixel + n_pixels / 2, n_pixels - n_pixels / 2);
                return;
            }
            if next.n_rays == 0 {
                break;
            }
        }
        if self.options.features {
            self.note_costs();
        }
        self.light(&mut stats);
        self.count(&stats);
    }

    fn primary_rays(&mut self, first_pixel: u32, n_pixels: u32) {
        let Queue { rays, bounces, .. } = &mut self.queue;
        *bounces = vec![Bounce::of(n_pixels, &self.frame)];
        rays.resize(n_pixels as usize, Ray::zeroed());
        let of_pass = if self.options.primary != Primary::Trace { "primary_hit" } else { "trace" };
        self.clock.time(of_pass, Some(0), || primary_hit::primary_rays(&self.frame, first_pixel, rays));
    }

    /// Fills the bounce's `hits`, and counts them.
    fn closest_hits(&mut self, depth: u32) -> BounceStats {
        let bindings = Bindings::new(self.world.scene(), self.world.tree(), &self.frame).with_extras(&self.extras);
        let Queue { rays, bounces, hits, .. } = &mut self.queue;
        hits.resize(rays.len(), Hit::zeroed());
        let places = bounces[depth as usize].rays();
        let (rays, hits) = (&rays[places.clone()], &mut hits[places]);
        let n_hits = if depth == 0 && self.options.primary != Primary::Trace {
            let ids = &self.triangle_ids;
            self.clock.time("primary_hit", Some(0), || primary_hit::primary_hit(&bindings, ids, rays, hits))
        } else {
            let traversal = self.options.traversal;
            self.clock.time("trace", Some(depth), || trace::trace(&bindings, traversal, rays, hits))
        };
        BounceStats { n_rays: rays.len() as u64, n_hits: n_hits.into(), n_shadow_rays: 0 }
    }

    /// What primary rays meet.
    fn note_features(&mut self) {
        let bindings = Bindings::new(self.world.scene(), self.world.tree(), &self.frame).with_extras(&self.extras);
        let (Queue { rays, hits, .. }, pixels) = (&self.queue, &mut self.pixel_features);
        self.clock.time("features", Some(0), || features::features(&bindings, rays, hits, pixels));
    }

    /// What the rays of all bounces cost.
    fn note_costs(&mut self) {
        let bindings = Bindings::new(self.world.scene(), self.world.tree(), &self.frame).with_extras(&self.extras);
        let (traversal, pixels) = (self.options.traversal, &mut self.pixel_features);
        let Queue { rays, bounces, hits, .. } = &self.queue;
        let n_rasterized = if self.options.primary != Primary::Trace { bounces[0].n_rays as usize } else { 0 };
        let (rasterized, traced) = rays.split_at(n_rasterized);
        costs::count_rasterized(rasterized, hits, pixels);
        costs::count_closest(&bindings, traversal, traced, pixels);
        costs::count_shadow(&bindings, traversal, rays, hits, pixels);
    }

    /// Compacts the rays that go on from the bounce's hits, behind it; returns what the spine says of them.
    fn next_rays(&mut self, depth: u32, capacity: u32) -> Bounce {
        let constants = Frame { queue_capacity: capacity, ..self.frame };
        let bindings = Bindings::new(self.world.scene(), self.world.tree(), &self.frame).with_extras(&self.extras);
        let Queue { rays, bounces, hits, child_kinds, first_children, scan_blocks, .. } = &mut self.queue;
        let (this, mut next) = (bounces[depth as usize], Bounce::of(0, &self.frame));
        let places = this.rays();
        child_kinds.resize(rays.len(), 0);
        first_children.resize(rays.len(), 0);
        scan_blocks.resize(places.len().div_ceil(SCAN_GROUP_SIZE as usize), 0);
        let (kinds, first_children) = (&mut child_kinds[places.clone()], &mut first_children[places.clone()]);
        let parents = Parents { rays: &rays[places.clone()], hits: &hits[places.clone()] };
        self.clock.time("compact_reduce", Some(depth), || compact::reduce(&bindings, parents, kinds, scan_blocks));
        self.clock.time("compact_spine", Some(depth), || compact::spine(scan_blocks, &constants, &this, &mut next));
        rays.resize(next.rays().end, Ray::zeroed());
        let (so_far, next_rays) = rays.split_at_mut(next.rays().start);
        let parents = Parents { rays: &so_far[places.clone()], hits: &hits[places] };
        if next.overflow == 0 {
            self.clock.time("compact_scatter", Some(depth), || {
                compact::scatter(&bindings, parents, kinds, scan_blocks, next.first_ray, first_children, next_rays);
            });
        }
        bounces.push(next);
        next
    }

    /// Shadows and shading of all bounces, resolved to pixels; notes how many shadow segments were tested.
    fn light(&mut self, stats: &mut [BounceStats]) {
        let Queue { rays, bounces, hits, first_children, ray_radiance, light_visibility, .. } = &mut self.queue;
        self.frame.queue_capacity = rays.len() as u32;
        let bindings = Bindings::new(self.world.scene(), self.world.tree(), &self.frame).with_extras(&self.extras);
        let traversal = self.options.traversal;
        light_visibility.resize(rays.len() * bindings.lights.len(), 0);
        ray_radiance.resize(rays.len(), [0.0; 4]);
        for (bounce, stats) in bounces.iter().zip(stats) {
            let of_bounce =
                || shadow::shadow(&bindings, traversal, &bounce.rays(), (rays.as_slice(), hits), light_visibility);
            stats.n_shadow_rays = self.clock.time("shadow", None, of_bounce).into();
        }
        let lit = LitRays { rays, hits, light_visibility };
        self.clock.time("shade", None, || shade::shade(&bindings, lit, ray_radiance));
        let pixels = &mut self.pixel_radiance;
        self.clock.time("resolve", None, || resolve::resolve(bounces, rays, ray_radiance, first_children, pixels));
    }

    fn count(&mut self, stats: &[BounceStats]) {
        self.n_batches += 1;
        self.bounces.resize(self.bounces.len().max(stats.len()), BounceStats::default());
        self.bounces.iter_mut().zip(stats).for_each(|(sum, bounce)| sum.add(bounce));
        self.clock.end_batch(stats);
    }

    /// The mean of the samples, and the post processes.
    fn finish(&mut self) {
        let (frame, radiance) = (&self.frame, &mut self.pixel_radiance);
        if frame.n_samples > 1 {
            let sums = &mut self.pixel_accumulated;
            self.clock.time("accumulate", None, || accumulate::accumulate(frame, &[], radiance, sums));
        }
        let (filtered, display) = (&mut self.pixel_filtered, &mut self.pixel_display);
        let curve = self.options.tonemap;
        self.clock.time("denoise", None, || denoise::denoise(frame, radiance, filtered));
        self.clock.time("tonemap", None, || tonemap::tonemap(frame, curve, filtered, display));
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
