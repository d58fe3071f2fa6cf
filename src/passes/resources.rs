//! What a frame needs on the device, and the descriptor set over it.

use std::{mem::offset_of, sync::Arc};

use super::{Pixels, Queue, Raster, Tree, binding, pixels::n_pixels, provoking::vertex_indices, tree};
use crate::{
    frame::{RenderOptions, Traversal},
    gpu::{Access, Binding, BindingSet, Bindings, Buffer, BufferUse, Commands, Context, Dispatch, GpuError},
    kdtree::KdTree,
    layout::{self, Batch, Bounce, COUNTER_PLACES, COUNTER_STRIDE, Counters, Frame, Light, Material},
    scene::Scene,
};

/// Of the longest push constants.
const PUSH_BYTES: u32 = {
    let (batch, present) = (size_of::<Batch>(), size_of::<layout::Present>());
    if batch > present { batch as u32 } else { present as u32 }
};

/// Of a batch and bounce, those between the places included.
const COUNTERS_A_ROW: usize = (COUNTER_PLACES * COUNTER_STRIDE) as usize;

/// What the kernels read and write. A name is the same here, in the kernels, as debug label and as allocation.
pub struct Resources {
    pub tree: Tree,
    /// Three a triangle, or none.
    pub vertex_indices: Buffer<u32>,
    pub materials: Buffer<Material>,
    /// `n_lights`.
    pub lights: Buffer<Light>,
    pub queue: Queue,
    pub pixels: Pixels,
    pub raster: Raster,
    /// One a batch and bounce.
    pub bounces: Buffer<Bounce>,
    counters: Buffer<Counters>,
    pub bindings: Arc<Bindings>,
    /// None while all else is made.
    set: Option<BindingSet>,
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
        options: &RenderOptions,
        n_bounces: usize,
    ) -> Result<Self, GpuError> {
        let storage = BufferUse::Storage;
        let mut tree = Tree::new(context, &scene.triangles, tree, constants)?;
        tree.add_materials(context, &scene.triangle_materials)?;
        let kinds: Vec<_> = (0..layout::N_BINDINGS).chain(tree::texel_bindings()).map(binding).collect();
        let indices = vertex_indices(&scene.triangles);
        let mut resources = Self {
            vertex_indices: Buffer::with(context, "vertex_indices", &indices, BufferUse::Index)?,
            materials: Buffer::with(context, "materials", &scene.materials, storage)?,
            lights: Buffer::with(context, "lights", &scene.lights, storage)?,
            queue: Queue::new(context, constants.queue_capacity, constants.n_lights)?,
            pixels: Pixels::new(context, constants, options)?,
            raster: Raster::new(context, constants.n_triangles, options)?,
            bounces: Buffer::new(context, "bounces", n_bounces, BufferUse::Indirect)?,
            counters: new_counters(context, n_bounces)?,
            bindings: Bindings::with_constants(context, &kinds, PUSH_BYTES, &tree.constants())?,
            tree,
            set: None,
            constants: *constants,
        };
        resources.set = Some(resources.make_set()?);
        Ok(resources)
    }

    fn make_set(&self) -> Result<BindingSet, GpuError> {
        let (queue, pixels) = (&self.queue, &self.pixels);
        let own = [
            (layout::BIND_MATERIALS, Binding::Buffer(self.materials.any())),
            (layout::BIND_LIGHTS, Binding::Buffer(self.lights.any())),
            (layout::BIND_RAYS, Binding::Buffer(queue.rays.any())),
            (layout::BIND_CHILD_KINDS, Binding::Buffer(queue.child_kinds.any())),
            (layout::BIND_FIRST_CHILDREN, Binding::Buffer(queue.first_children.any())),
            (layout::BIND_SCAN_BLOCKS, Binding::Buffer(queue.scan_blocks.any())),
            (layout::BIND_BOUNCES, Binding::Buffer(self.bounces.any())),
            (layout::BIND_HITS, Binding::Buffer(queue.hits.any())),
            (layout::BIND_LIGHT_VISIBILITY, Binding::Buffer(queue.light_visibility.any())),
            (layout::BIND_RAY_RADIANCE, Binding::Buffer(queue.ray_radiance.any())),
            (layout::BIND_PIXEL_RADIANCE, Binding::Buffer(pixels.pixel_radiance.any())),
            (layout::BIND_PIXEL_ACCUMULATED, Binding::Buffer(pixels.accumulated().any())),
            (layout::BIND_PIXEL_FILTERED, Binding::Buffer(pixels.filtered().any())),
            (layout::BIND_PIXEL_DISPLAY, Binding::Buffer(pixels.pixel_display.any())),
            (layout::BIND_PIXEL_FEATURES, Binding::Buffer(pixels.pixel_features.any())),
            (layout::BIND_COUNTERS, Binding::Buffer(self.counters.any())),
            (layout::BIND_PIXEL_NEAREST, Binding::Buffer(pixels.pixel_nearest.any())),
            (layout::BIND_RASTER_GROUPS, Binding::Buffer(self.raster.groups.any())),
            (layout::BIND_RASTER_COUNT, Binding::Buffer(self.raster.count.any())),
            (layout::BIND_LARGE_TRIANGLES, Binding::Buffer(self.raster.large_triangles.any())),
            (layout::BIND_TRIANGLE_IDS, Binding::Image(&pixels.triangle_ids)),
        ];
        BindingSet::new(&self.bindings, "frame", &[&self.tree.objects(), &own[..]].concat())
    }

    /// The kernels' constants from now on, with room for their picture, with or without features, and for `constants.queue_capacity` rays, or for as
    /// many as there was room for. What they hold is undefined. Where there is no room, all is as before. True where the
    /// buffers of pixels are the same, and hold what they held.
    ///
    /// # Errors
    /// Beyond the device's limits, out of memory.
    pub fn fit(
        &mut self,
        context: &Arc<Context>,
        constants: &Frame,
        options: &RenderOptions,
    ) -> Result<bool, GpuError> {
        let grows = self.queue.capacity() < constants.queue_capacity;
        let queue = grows.then(|| Queue::new(context, constants.queue_capacity, constants.n_lights)).transpose()?;
        let pixels =
            (!self.pixels.fit(constants, options)).then(|| Pixels::new(context, constants, options)).transpose()?;
        let n_triangles = constants.n_triangles;
        let raster = (!self.raster.fits(n_triangles, options))
            .then(|| Raster::new(context, n_triangles, options))
            .transpose()?;
        let keeps_pixels = pixels.is_none();
        let has_room = queue.is_none() && keeps_pixels && raster.is_none();
        if let Some(queue) = queue {
            self.queue = queue;
        }
        if let Some(pixels) = pixels {
            self.pixels = pixels;
        }
        if let Some(raster) = raster {
            self.raster = raster;
        }
        self.constants = Frame { queue_capacity: self.queue.capacity(), ..*constants };
        if !has_room {
            self.set = Some(self.make_set()?);
        }
        Ok(keeps_pixels)
    }

    /// Other constants for as many pixels and rays; the next frame brings them to the device.
    pub fn set_constants(&mut self, constants: &Frame) {
        self.constants = *constants;
    }

    /// Uploads what the traversal reads beside the tree.
    ///
    /// # Errors
    /// Too many triangles for brute force; beyond the device's limits, out of memory.
    pub fn add_extras(&mut self, context: &Arc<Context>, tree: &KdTree, traversal: Traversal) -> Result<(), GpuError> {
        self.tree.add_extras(context, tree, traversal)?;
        self.set = Some(self.make_set()?);
        Ok(())
    }

    /// Makes room for another number of batches and bounces; contents are undefined.
    ///
    /// # Errors
    /// Out of memory.
    pub fn resize_bounces(&mut self, context: &Arc<Context>, n_bounces: usize) -> Result<(), GpuError> {
        self.bounces = Buffer::new(context, "bounces", n_bounces, BufferUse::Indirect)?;
        self.counters = new_counters(context, n_bounces)?;
        self.set = Some(self.make_set()?);
        Ok(())
    }

    /// Makes the first sample the sum of samples.
    ///
    /// # Errors
    /// Out of memory, a failed copy.
    pub fn begin_sums(&mut self, context: &Arc<Context>) -> Result<(), GpuError> {
        if self.pixels.pixel_accumulated.is_none() {
            let n_pixels = self.pixels.pixel_radiance.len();
            let sums = Buffer::new(context, "pixel_accumulated", n_pixels, BufferUse::Storage)?;
            self.pixels.pixel_accumulated = Some(sums);
            self.set = Some(self.make_set()?);
        }
        let (sample, sums) = (self.pixels.pixel_radiance.any(), self.pixels.accumulated().any());
        context.run("first sample", |commands| {
            commands.barrier(Access::ComputeWrite, Access::TransferRead); // pixel_radiance
            commands.barrier(Access::ComputeUpdate, Access::TransferWrite); // pixel_accumulated
            commands.copy_buffer(sample, sums, sample.bytes());
            commands.barrier(Access::TransferWrite, Access::AllReads); // pixel_accumulated
        })
    }

    /// Sets all counters to 0.
    pub fn clear_counters(&self, commands: &Commands) {
        commands.clear_buffer(self.counters.any());
    }

    /// What the kernels counted, a row a batch and bounce.
    ///
    /// # Errors
    /// A failed copy.
    pub fn counters(&self) -> Result<Vec<Counters>, GpuError> {
        let sum = |row: &[Counters]| {
            row.iter().step_by(COUNTER_STRIDE as usize).fold(Counters::default(), |sum, place| Counters {
                n_hits: sum.n_hits + place.n_hits,
                n_shadow_rays: sum.n_shadow_rays + place.n_shadow_rays,
            })
        };
        Ok(self.counters.download()?.chunks_exact(COUNTERS_A_ROW).map(sum).collect())
    }

    /// Pixels of the window.
    pub fn n_pixels(&self) -> usize {
        n_pixels(&self.constants)
    }

    /// The constants that the kernels read.
    pub fn constants(&self) -> &Frame {
        &self.constants
    }

    /// The lanes of each of the bounce's rays.
    pub fn trace_dispatch(&self, batch: &Batch) -> Dispatch<'_> {
        self.indirect(batch.bounce_ix, offset_of!(Bounce, trace_groups_x))
    }

    /// One invocation a ray of the bounce.
    pub fn scan_dispatch(&self, batch: &Batch) -> Dispatch<'_> {
        self.indirect(batch.bounce_ix, offset_of!(Bounce, scan_groups_x))
    }

    /// The lanes of each of the batch's rays, of all bounces, for each light.
    pub fn shadow_dispatch(&self, batch: &Batch) -> Dispatch<'_> {
        self.indirect(self.last_bounce(batch), offset_of!(Bounce, shadow_groups_x))
    }

    /// One invocation a ray of the batch, of all bounces.
    pub fn shade_dispatch(&self, batch: &Batch) -> Dispatch<'_> {
        self.indirect(self.last_bounce(batch), offset_of!(Bounce, shade_groups_x))
    }

    /// The last row of a batch whose first one is given.
    fn last_bounce(&self, batch: &Batch) -> u32 {
        batch.bounce_ix + self.constants.max_depth - 1
    }

    fn indirect(&self, bounce_ix: u32, member: usize) -> Dispatch<'_> {
        Dispatch::Indirect(self.bounces.any(), (bounce_ix as usize * size_of::<Bounce>() + member) as u64)
    }

    /// One invocation a pixel.
    pub fn pixel_dispatch(&self) -> Dispatch<'_> {
        let tile = layout::TILE_SIZE;
        Dispatch::Threads([self.constants.width, self.constants.height, 1], [tile, tile, 1])
    }

    /// Binds all that the kernels read and write.
    pub fn bind(&self, commands: &Commands) {
        commands.bind(self.set());
    }

    pub(super) fn set(&self) -> &BindingSet {
        self.set.as_ref().expect("made with the resources")
    }
}

fn new_counters(context: &Arc<Context>, n_bounces: usize) -> Result<Buffer<Counters>, GpuError> {
    Buffer::new(context, "counters", n_bounces * COUNTERS_A_ROW, BufferUse::Storage)
}
