//! The passes of a batch of paths, with the buffers of the paths.

use bytemuck::Zeroable;
use fearless_simd::Level;

use super::{
    lambertian_surfaces::lambertian_materials,
    path_begin::{PixelOfBatch, path_begin, pixels_of_batch},
    path_scatter::{BounceOfPaths, path_scatter},
    queue::Queue,
    tracer::{CpuSearch, FastTracer},
};
use crate::{
    accel::kdtree::Traversal,
    layout::{Batch, Bounce, Frame, Hit, PathRay, PathState, PixelAovs, SCAN_GROUP_SIZE, ShadowRay},
    reference::{
        counting::costs,
        inputs::KernelInputs,
        path_compact,
        path_layers::path_layers,
        path_scatter::PathBuffers,
        path_trace::{closest_hits_by, ray_of, search_ray_of, shadow_rays_by},
        paths::sample_of_path,
    },
};

/// What the paths of a batch have beside their rays and hits, which are in a [`Queue`]. The buffers grow with the
/// number of paths.
#[derive(Default)]
pub struct Paths {
    pixels: Vec<PixelOfBatch>,
    /// Whether each material is Lambertian.
    are_lambertian: Vec<bool>,
    pub states: Vec<PathState>,
    shadow_rays: Vec<ShadowRay>,
    /// The radiance of each path when the last layer of light was complete.
    snapshots: Vec<[f32; 4]>,
    /// The indices of the paths that are alive, for bounces of even depth and for those of odd depth.
    live: [Vec<u32>; 2],
    /// The indices of the paths with a shadow ray to a light.
    with_shadow_ray: Vec<u32>,
    /// For each block of `SCAN_GROUP_SIZE` paths of a bounce, the numbers of those that go on and of those with a
    /// shadow ray, and after the prefix sum the numbers in all blocks before.
    scan_blocks: Vec<[u32; 2]>,
}

impl Paths {
    /// Makes the camera rays of `n_paths` paths.
    pub fn begin(&mut self, inputs: &KernelInputs, batch: &Batch, n_paths: u32, queue: &mut Queue) {
        let n = n_paths as usize;
        queue.bounces = vec![Bounce::of_paths(n_paths, inputs.frame())];
        queue.rays.resize(n, PathRay::zeroed());
        queue.hits.resize(n, Hit::zeroed());
        self.states.clear();
        self.states.resize(n, PathState::zeroed());
        self.shadow_rays.clear();
        self.shadow_rays.resize(n, ShadowRay::zeroed());
        self.live[0] = (0..n_paths).collect();
        self.with_shadow_ray.clear();
        self.pixels = pixels_of_batch(inputs, batch);
        path_begin(inputs, &self.pixels, &mut queue.rays);
    }

    /// Finds the hits of the paths that are alive, and tests the shadow rays of the bounce before. Returns the numbers
    /// of hits and of shadow rays.
    pub fn trace(&mut self, inputs: &KernelInputs, batch: &Batch, search: CpuSearch, queue: &mut Queue) -> (u32, u32) {
        let new_tracer = || FastTracer::new(inputs, search);
        let Self { states, shadow_rays, live, with_shadow_ray, .. } = self;
        let live = &live[batch.depth as usize % 2];
        let of_camera = if batch.depth == 0 { inputs.of_camera() } else { *inputs };
        let n_hits = closest_hits_by(&of_camera, batch, new_tracer, (live, &queue.rays), &mut queue.hits);
        shadow_rays_by(inputs, batch, new_tracer, with_shadow_ray, (shadow_rays, states));
        (n_hits, with_shadow_ray.len() as u32)
    }

    /// Adds the costs of the rays that [`Self::trace`] traces, of each pixel's first sample.
    pub fn note_costs(
        &self,
        inputs: &KernelInputs,
        batch: &Batch,
        traversal: Traversal,
        queue: &Queue,
        pixel_aovs: &mut [PixelAovs],
    ) {
        let is_first = |path_ix: &&u32| sample_of_path(inputs.frame(), **path_ix) == 0;
        let inputs = &inputs.with_stochastic_alpha();
        let in_pixel = |path_ix: u32, ray: &PathRay, is_shadow_ray| {
            let search_ray = search_ray_of(inputs, batch, path_ix, ray, is_shadow_ray);
            (queue.rays[path_ix as usize].pixel_ix, search_ray)
        };
        let ray = |&path_ix: &u32| in_pixel(path_ix, &queue.rays[path_ix as usize], false);
        let shadow_ray = |&path_ix: &u32| in_pixel(path_ix, &ray_of(&self.shadow_rays[path_ix as usize]), true);
        let live = &self.live[batch.depth as usize % 2];
        let rays: Vec<_> = live.iter().filter(is_first).map(ray).collect();
        let shadow_rays: Vec<_> = self.with_shadow_ray.iter().filter(is_first).map(shadow_ray).collect();
        let of_camera = if batch.depth == 0 { inputs.of_camera() } else { *inputs };
        costs::count_rays::<false>(&of_camera, traversal, &rays, pixel_aovs);
        costs::count_rays::<true>(inputs, traversal, &shadow_rays, pixel_aovs);
    }

    /// Adds the light at the hits, and replaces the rays by those with which the paths go on.
    pub fn scatter(&mut self, inputs: &KernelInputs, batch: &Batch, queue: &mut Queue) {
        let live = &self.live[batch.depth as usize % 2];
        queue.child_flags.resize(live.len(), 0);
        self.scan_blocks.resize(live.len().div_ceil(SCAN_GROUP_SIZE as usize), [0; 2]);
        let Queue { rays, hits, child_flags, .. } = queue;
        let paths = PathBuffers { rays, states: &mut self.states, shadow_rays: &mut self.shadow_rays };
        if batch.depth == 0 {
            self.are_lambertian = lambertian_materials(inputs);
        }
        let (pixels, are_lambertian) = (&self.pixels, &self.are_lambertian);
        let bounce = BounceOfPaths { inputs, batch, pixels, are_lambertian, hits, simd_level: Level::new() };
        path_scatter(&bounce, live, paths, (child_flags, &mut self.scan_blocks));
    }

    /// Adds up the layer of light that is complete after the batch's bounce.
    pub fn layers(&mut self, frame: &Frame, batch: &Batch, pixel_layers: &mut [[f32; 4]]) {
        self.snapshots.resize(self.states.len(), [0.0; 4]);
        path_layers(frame, batch, &self.states, &mut self.snapshots, pixel_layers);
    }

    /// Computes the prefix sums of the numbers of paths that go on and of shadow rays, and the row of the next bounce.
    pub fn spine(&mut self, frame: &Frame, depth: u32, queue: &mut Queue) {
        let mut next = Bounce::of_paths(0, frame);
        path_compact::spine(&mut self.scan_blocks, frame, &mut queue.bounces[depth as usize], &mut next);
        queue.bounces.push(next);
    }

    /// Lists the paths that go on, and those with a shadow ray.
    pub fn compact(&mut self, depth: u32, queue: &Queue) {
        let [even, odd] = &mut self.live;
        let (live, next) = if depth.is_multiple_of(2) { (even, odd) } else { (odd, even) };
        next.resize(queue.bounces[depth as usize + 1].n_rays as usize, 0);
        self.with_shadow_ray.resize(queue.bounces[depth as usize].n_shadow_rays as usize, 0);
        path_compact::path_compact(live, &queue.child_flags, &self.scan_blocks, next, &mut self.with_shadow_ray);
    }
}
