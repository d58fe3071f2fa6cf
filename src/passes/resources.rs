//! The frame's buffers and images, and the two descriptor sets over them.

use std::{mem::offset_of, sync::Arc};

use super::{Tree, binding};
use crate::{
    frame::Traversal,
    gpu::{
        Binding, BindingSet, Bindings, Buffer, BufferUse, Commands, Context, Dispatch, GpuError, Target, TargetKind,
    },
    kdtree::KdTree,
    layout::{self, Batch, Bounce, Counters, Frame, Hit, Light, Material, RAY_GROUP_SIZE, Ray, SCAN_BLOCK_SIZE},
    scene::Scene,
};

/// What the kernels read and write. A name is the same here, in the kernels, as debug label and as allocation.
pub struct Resources {
    pub tree: Tree,
    /// `n_triangles`.
    pub triangle_materials: Buffer<u32>,
    pub materials: Buffer<Material>,
    /// `n_lights`.
    pub lights: Buffer<Light>,
    /// Even bounces read the first queue and fill the second, odd ones the other way round; `queue_capacity` each.
    pub ray_queues: [Buffer<Ray>; 2],
    /// Two places a ray: `2 * queue_capacity`.
    pub child_rays: Buffer<Ray>,
    /// `queue_capacity`, like hits and ray_radiance.
    pub child_counts: Buffer<u32>,
    pub hits: Buffer<Hit>,
    pub ray_radiance: Buffer<[f32; 4]>,
    /// `n_lights * queue_capacity`, lights outermost.
    pub light_visibility: Buffer<u32>,
    /// `queue_capacity / SCAN_BLOCK_SIZE`, rounded up.
    pub scan_blocks: Buffer<u32>,
    /// One a batch and bounce, like counters.
    pub bounces: Buffer<Bounce>,
    pub counters: Buffer<Counters>,
    /// `width * height`, like the next two.
    pub pixel_radiance: Buffer<[f32; 4]>,
    /// None without a noise filter: what follows it then reads pixel_radiance.
    pub pixel_filtered: Option<Buffer<[f32; 4]>>,
    pub pixel_display: Buffer<u32>,
    pub triangle_ids: Target,
    pub depth: Target,
    pub bindings: Arc<Bindings>,
    /// For even and for odd bounces.
    pub sets: Vec<BindingSet>,
    constants: Frame,
}

impl Resources {
    /// Uploads the scene and makes room for `constants.queue_capacity` rays and `n_bounces` rows of `bounces`.
    ///
    /// # Errors
    /// Beyond the device's limits, out of memory.
    pub fn new(
        context: &Arc<Context>,
        scene: &Scene,
        tree: &KdTree,
        constants: &Frame,
        n_bounces: usize,
    ) -> Result<Self, GpuError> {
        let storage = BufferUse::Storage;
        let capacity = constants.queue_capacity as usize;
        let n_pixels = constants.width as usize * constants.height as usize;
        let size = (constants.width, constants.height);
        let queue = |name| Buffer::new(context, name, capacity, storage);

        let tree = Tree::new(context, &scene.triangles, tree, constants)?;
        let triangle_materials = Buffer::with(context, "triangle_materials", &scene.triangle_materials, storage)?;
        let materials = Buffer::with(context, "materials", &scene.materials, storage)?;
        let lights = Buffer::with(context, "lights", &scene.lights, storage)?;
        let ray_queues = [queue("ray_queues[0]")?, queue("ray_queues[1]")?];
        let child_rays = Buffer::new(context, "child_rays", 2 * capacity, storage)?;
        let child_counts = Buffer::new(context, "child_counts", capacity, storage)?;
        let hits = Buffer::new(context, "hits", capacity, storage)?;
        let ray_radiance = Buffer::new(context, "ray_radiance", capacity, storage)?;
        let n_visibility = capacity * constants.n_lights as usize;
        let light_visibility = Buffer::new(context, "light_visibility", n_visibility, storage)?;
        let n_blocks = capacity.div_ceil(SCAN_BLOCK_SIZE as usize);
        let scan_blocks = Buffer::new(context, "scan_blocks", n_blocks, storage)?;
        let bounces = Buffer::new(context, "bounces", n_bounces, BufferUse::Indirect)?;
        let counters = Buffer::new(context, "counters", n_bounces, storage)?;
        let pixel_radiance = Buffer::new(context, "pixel_radiance", n_pixels, storage)?;
        let filters = constants.denoise_threshold.is_finite();
        let pixel_filtered = filters.then(|| Buffer::new(context, "pixel_filtered", n_pixels, storage)).transpose()?;
        let pixel_display = Buffer::new(context, "pixel_display", n_pixels, storage)?;
        let triangle_ids = Target::new(context, "triangle_ids", TargetKind::Id, size)?;
        let depth = Target::new(context, "depth", TargetKind::Depth, size)?;

        let kinds: Vec<_> = (0..layout::N_BINDINGS).map(binding).collect();
        let bindings = Bindings::new(context, &kinds, size_of::<Batch>() as u32)?;
        let mut resources = Self {
            tree,
            triangle_materials,
            materials,
            lights,
            ray_queues,
            child_rays,
            child_counts,
            hits,
            ray_radiance,
            light_visibility,
            scan_blocks,
            bounces,
            counters,
            pixel_radiance,
            pixel_filtered,
            pixel_display,
            triangle_ids,
            depth,
            bindings,
            sets: Vec::new(),
            constants: *constants,
        };
        resources.sets = resources.make_sets()?;
        Ok(resources)
    }

    fn make_sets(&self) -> Result<Vec<BindingSet>, GpuError> {
        let [even, odd] = &self.ray_queues;
        Ok(vec![self.make_set("even bounces", even, odd)?, self.make_set("odd bounces", odd, even)?])
    }

    fn make_set(&self, name: &str, rays: &Buffer<Ray>, next_rays: &Buffer<Ray>) -> Result<BindingSet, GpuError> {
        let own = [
            (layout::BIND_TRIANGLE_MATERIALS, Binding::Buffer(self.triangle_materials.any())),
            (layout::BIND_MATERIALS, Binding::Buffer(self.materials.any())),
            (layout::BIND_LIGHTS, Binding::Buffer(self.lights.any())),
            (layout::BIND_RAYS, Binding::Buffer(rays.any())),
            (layout::BIND_NEXT_RAYS, Binding::Buffer(next_rays.any())),
            (layout::BIND_CHILD_RAYS, Binding::Buffer(self.child_rays.any())),
            (layout::BIND_CHILD_COUNTS, Binding::Buffer(self.child_counts.any())),
            (layout::BIND_SCAN_BLOCKS, Binding::Buffer(self.scan_blocks.any())),
            (layout::BIND_BOUNCES, Binding::Buffer(self.bounces.any())),
            (layout::BIND_HITS, Binding::Buffer(self.hits.any())),
            (layout::BIND_LIGHT_VISIBILITY, Binding::Buffer(self.light_visibility.any())),
            (layout::BIND_RAY_RADIANCE, Binding::Buffer(self.ray_radiance.any())),
            (layout::BIND_PIXEL_RADIANCE, Binding::Buffer(self.pixel_radiance.any())),
            (layout::BIND_PIXEL_FILTERED, Binding::Buffer(self.filtered().any())),
            (layout::BIND_PIXEL_DISPLAY, Binding::Buffer(self.pixel_display.any())),
            (layout::BIND_COUNTERS, Binding::Buffer(self.counters.any())),
            (layout::BIND_TRIANGLE_IDS, Binding::Image(&self.triangle_ids)),
        ];
        BindingSet::new(&self.bindings, name, &[&self.tree.objects()[..], &own].concat())
    }

    /// Uploads what the traversal reads beside the tree.
    ///
    /// # Errors
    /// Too many triangles for brute force; beyond the device's limits, out of memory.
    pub fn add_extras(&mut self, context: &Arc<Context>, tree: &KdTree, traversal: Traversal) -> Result<(), GpuError> {
        self.tree.add_extras(context, tree, traversal)?;
        self.sets = self.make_sets()?;
        Ok(())
    }

    /// Makes room for another number of batches and bounces; contents are undefined.
    ///
    /// # Errors
    /// Out of memory.
    pub fn resize_bounces(&mut self, context: &Arc<Context>, n_bounces: usize) -> Result<(), GpuError> {
        self.bounces = Buffer::new(context, "bounces", n_bounces, BufferUse::Indirect)?;
        self.counters = Buffer::new(context, "counters", n_bounces, BufferUse::Storage)?;
        self.sets = self.make_sets()?;
        Ok(())
    }

    /// The image after the noise filter, or the one without it.
    pub fn filtered(&self) -> &Buffer<[f32; 4]> {
        self.pixel_filtered.as_ref().unwrap_or(&self.pixel_radiance)
    }

    /// The constants that the kernels read.
    pub fn constants(&self) -> &Frame {
        &self.constants
    }

    /// One invocation a ray of the bounce.
    pub fn ray_dispatch(&self, batch: &Batch) -> Dispatch<'_> {
        self.indirect(batch, offset_of!(Bounce, ray_groups_x))
    }

    /// One invocation a ray of the bounce and light.
    pub fn shadow_dispatch(&self, batch: &Batch) -> Dispatch<'_> {
        self.indirect(batch, offset_of!(Bounce, shadow_groups_x))
    }

    /// One workgroup a scan block of the bounce's rays.
    pub fn scan_dispatch(&self, batch: &Batch) -> Dispatch<'_> {
        self.indirect(batch, offset_of!(Bounce, scan_groups_x))
    }

    fn indirect(&self, batch: &Batch, member: usize) -> Dispatch<'_> {
        Dispatch::Indirect(self.bounces.any(), (batch.bounce_ix as usize * size_of::<Bounce>() + member) as u64)
    }

    /// One invocation a pixel.
    pub fn pixel_dispatch(&self) -> Dispatch<'_> {
        let tile = layout::TILE_SIZE;
        Dispatch::Threads([self.constants.width, self.constants.height, 1], [tile, tile, 1])
    }

    /// Binds the set in which the batch's bounce reads its queue.
    pub fn bind(&self, commands: &Commands, batch: &Batch) {
        commands.bind(&self.sets[batch.depth as usize % 2]);
    }
}

/// A row of `bounces` for `n_rays` rays.
pub fn bounce_row(n_rays: u32, n_lights: u32) -> Bounce {
    let ray_groups = n_rays.div_ceil(RAY_GROUP_SIZE);
    Bounce {
        n_rays,
        n_wanted: n_rays,
        ray_groups_x: ray_groups,
        ray_groups_y: 1,
        ray_groups_z: 1,
        shadow_groups_x: ray_groups,
        shadow_groups_y: n_lights,
        shadow_groups_z: 1,
        scan_groups_x: n_rays.div_ceil(SCAN_BLOCK_SIZE),
        scan_groups_y: 1,
        scan_groups_z: 1,
        ..Bounce::default()
    }
}
