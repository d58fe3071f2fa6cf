//! The reference: every pass again over slices, without Vulkan. For the tests, and for the paper's CPU column.
//!
//! A file here is the twin of the kernel or shared file of its name: the same operations in the same order, so that
//! hits agree to the last bits. Rays are handled in tasks of a fixed size, whatever the number of threads: so is the
//! picture.

pub mod bindings;
pub mod brute;
pub mod camera;
pub mod cast;
pub mod compact;
pub mod denoise;
pub mod display;
pub mod kd_boxes;
pub mod kdtree;
pub mod light;
pub mod material;
pub mod pending_backtrack;
pub mod pending_mask;
pub mod pending_mask_boxes;
pub mod pending_restart;
pub mod pending_short_stack;
pub mod pending_stack;
pub mod primary_hit;
mod queues;
pub mod resolve;
pub mod ropes;
pub mod shade;
pub mod shadow;
pub mod steps;
pub mod surface;
pub mod table;
mod timing;
pub mod tonemap;
pub mod trace;
pub mod triangle;
pub mod visibility;

use std::mem::swap;

use bytemuck::Zeroable;

use self::{
    bindings::Bindings,
    queues::Queues,
    shade::{LitRays, Shaded},
    timing::Clock,
};
use crate::{
    camera::frame_constants,
    frame::{BounceStats, Picture, Primary, Profile, RenderOptions},
    kdtree::{Extras, KdTree},
    layout::{Bounce, Frame, Hit, Ray, SCAN_BLOCK_SIZE},
    scene::Scene,
};

/// Rays that one thread handles at a time: enough to pay for handing them out, few enough to balance.
const RAYS_PER_TASK: usize = 512;

/// How a frame is cut into pieces. The picture does not depend on it.
#[derive(Clone, Copy, Debug)]
pub struct Batching {
    /// Pixels whose rays are traced together.
    pub n_pixels: u32,
    /// Rays of a bounce beyond which a batch of more than one pixel is halved.
    pub queue_capacity: u32,
}

impl Default for Batching {
    /// Some 30 MB of queues as a rule, and 270 MB at the most.
    fn default() -> Self {
        Self { n_pixels: 1 << 16, queue_capacity: 1 << 20 }
    }
}

/// Renders a frame on the current rayon pool.
pub fn render(scene: &Scene, tree: &KdTree, options: &RenderOptions) -> (Picture, Profile) {
    render_in_batches(scene, tree, options, Batching::default())
}

/// Renders a frame on the current rayon pool, in batches of a given size.
pub fn render_in_batches(
    scene: &Scene,
    tree: &KdTree,
    options: &RenderOptions,
    batching: Batching,
) -> (Picture, Profile) {
    let n_pixels = options.width * options.height;
    let mut renderer = Renderer {
        scene,
        tree,
        options,
        batching,
        extras: Extras::new(tree, options.traversal),
        frame: frame_constants(scene, tree, options),
        triangle_ids: vec![0; n_pixels as usize],
        pixel_radiance: vec![[0.0; 4]; n_pixels as usize],
        queues: Queues::default(),
        clock: Clock::start(),
        bounces: Vec::new(),
        n_batches: 0,
    };
    if options.primary == Primary::Raster {
        renderer.visibility();
    }
    for first_pixel in (0..n_pixels).step_by(batching.n_pixels as usize) {
        renderer.batch(first_pixel, batching.n_pixels.min(n_pixels - first_pixel));
    }
    renderer.finish()
}

/// A frame in the making.
struct Renderer<'a> {
    scene: &'a Scene,
    tree: &'a KdTree,
    options: &'a RenderOptions,
    batching: Batching,
    extras: Extras,
    frame: Frame,
    /// Like `pixel_radiance`: `width * height`, rows from the top.
    triangle_ids: Vec<u32>,
    pixel_radiance: Vec<[f32; 4]>,
    queues: Queues,
    clock: Clock,
    bounces: Vec<BounceStats>,
    n_batches: u32,
}

impl Renderer<'_> {
    fn visibility(&mut self) {
        let bindings = Bindings::new(self.scene, self.tree, &self.frame).with_extras(&self.extras);
        let (traversal, ids) = (self.options.traversal, &mut self.triangle_ids);
        self.clock.time("visibility", None, || visibility::visibility(&bindings, traversal, ids));
    }

    /// Algorithm 1 for a batch of pixels: all bounces, or those of its halves where a bounce makes more rays than the
    /// queue is meant to hold. Starting over is harmless: bounce 0 sets its pixels.
    fn batch(&mut self, first_pixel: u32, n_pixels: u32) {
        let capacity = if n_pixels == 1 { u32::MAX } else { self.batching.queue_capacity };
        let mut stats = Vec::new();
        self.primary_rays(first_pixel, n_pixels);
        for depth in 0..self.options.max_depth {
            let n_hits = self.closest_hits(depth);
            let n_shadow_rays = self.light(depth);
            stats.push(BounceStats { n_rays: self.queues.rays.len() as u64, n_hits, n_shadow_rays });
            if depth + 1 == self.options.max_depth {
                break;
            }
            let next = self.next_rays(depth, capacity);
            if next.overflow != 0 {
                self.clock.end_batch(&stats, self.options.primary);
                self.batch(first_pixel, n_pixels / 2);
                self.batch(first_pixel + n_pixels / 2, n_pixels - n_pixels / 2);
                return;
            }
            if self.queues.rays.is_empty() {
                break;
            }
        }
        self.count(&stats);
    }

    fn primary_rays(&mut self, first_pixel: u32, n_pixels: u32) {
        let rays = &mut self.queues.rays;
        rays.resize(n_pixels as usize, Ray::zeroed());
        self.clock.time("primary_hit", Some(0), || primary_hit::primary_rays(&self.frame, first_pixel, rays));
    }

    /// Fills `hits`; returns how many are hits.
    fn closest_hits(&mut self, depth: u32) -> u64 {
        let bindings = Bindings::new(self.scene, self.tree, &self.frame).with_extras(&self.extras);
        let Queues { rays, hits, .. } = &mut self.queues;
        hits.resize(rays.len(), Hit::zeroed());
        let n_hits = if depth == 0 && self.options.primary == Primary::Raster {
            let ids = &self.triangle_ids;
            self.clock.time("primary_hit", Some(0), || primary_hit::primary_hit(&bindings, ids, rays, hits))
        } else {
            let traversal = self.options.traversal;
            self.clock.time("trace", Some(depth), || trace::trace(&bindings, traversal, rays, hits))
        };
        n_hits.into()
    }

    /// Shadows, shading and the children, resolved to pixels; returns how many shadow segments were tested.
    fn light(&mut self, depth: u32) -> u64 {
        let Queues { rays, hits, light_visibility, shaded, .. } = &mut self.queues;
        self.frame.queue_capacity = rays.len() as u32;
        let bindings = Bindings::new(self.scene, self.tree, &self.frame).with_extras(&self.extras);
        let traversal = self.options.traversal;
        light_visibility.resize(rays.len() * bindings.lights.len(), 0);
        shaded.resize(rays.len());
        let n_shadow_rays = self
            .clock
            .time("shadow", Some(depth), || shadow::shadow(&bindings, traversal, rays, hits, light_visibility));
        let lit = LitRays { rays, hits, light_visibility };
        self.clock.time("shade", Some(depth), || shade::shade(&bindings, depth, lit, shaded));
        let (radiance, pixels) = (&shaded.ray_radiance, &mut self.pixel_radiance);
        self.clock.time("resolve", Some(depth), || resolve::resolve(depth, rays, radiance, pixels));
        n_shadow_rays.into()
    }

    /// Compacts the children to the queue of the next bounce; returns what the spine says of that.
    fn next_rays(&mut self, depth: u32, capacity: u32) -> Bounce {
        let Queues { rays, next_rays, scan_blocks, shaded, .. } = &mut self.queues;
        let Shaded { child_rays, child_counts, .. } = shaded;
        let mut next = Bounce::zeroed();
        scan_blocks.resize(rays.len().div_ceil(SCAN_BLOCK_SIZE as usize), 0);
        self.clock.time("compact_reduce", Some(depth), || compact::reduce(child_counts, scan_blocks));
        self.clock.time("compact_spine", Some(depth), || compact::spine(scan_blocks, capacity, &mut next));
        next_rays.resize(next.n_rays as usize, Ray::zeroed());
        if next.overflow == 0 {
            self.clock.time("compact_scatter", Some(depth), || {
                compact::scatter(child_rays, child_counts, scan_blocks, next_rays);
            });
        }
        swap(rays, next_rays);
        next
    }

    fn count(&mut self, stats: &[BounceStats]) {
        self.n_batches += 1;
        self.bounces.resize(self.bounces.len().max(stats.len()), BounceStats::default());
        self.bounces.iter_mut().zip(stats).for_each(|(sum, bounce)| sum.add(bounce));
        self.clock.end_batch(stats, self.options.primary);
    }

    /// The post processes, and the finished frame.
    fn finish(mut self) -> (Picture, Profile) {
        let mut radiance = vec![[0.0; 4]; self.pixel_radiance.len()];
        let mut display = vec![[0; 4]; radiance.len()];
        let (frame, pixels) = (&self.frame, &self.pixel_radiance);
        self.clock.time("denoise", None, || denoise::denoise(frame, pixels, &mut radiance));
        self.clock.time("tonemap", None, || tonemap::tonemap(frame, &radiance, &mut display));
        let picture = Picture { width: self.options.width, height: self.options.height, radiance, display };
        let profile = Profile {
            device: format!("CPU, {} threads", rayon::current_num_threads()),
            frame_ms: Some(self.clock.elapsed_ms()),
            begun_at: Some(self.clock.begun_at()),
            passes: self.clock.into_passes(),
            bounces: self.bounces,
            n_batches: self.n_batches,
        };
        (picture, profile)
    }
}
