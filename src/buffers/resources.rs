//! Resources of a frame on the device, and the descriptor set over them.

use std::{mem::offset_of, sync::Arc};

use super::{
    AccelBuffers, PathQueue, Pixels, Queue, RasterQueue, accel, binding,
    pixels::{n_pixels, uses_graphics_pipeline},
    vertex_indices::{has_indices, vertex_indices},
};
use crate::{
    accel::kdtree::Traversal,
    frame::{Integrator, RenderOptions, for_resources},
    gpu::{Access, Binding, BindingLayout, BindingSet, Buffer, BufferUse, Commands, Context, Dispatch, GpuError},
    layout::{self, Batch, Bounce, COUNTER_COPIES, COUNTER_STRIDE, Counters, Frame, Light, Material},
    world::{Geometry, World, path_materials},
};

/// The size of the longest push constants, bytes.
const PUSH_BYTES: u32 = {
    let (batch, present) = (size_of::<Batch>(), size_of::<layout::Present>());
    if batch > present { batch as u32 } else { present as u32 }
};

/// A binding of the frame's descriptor set, and the buffer or image that is bound to it.
type Row = (u32, fn(&Resources) -> Binding<'_>);

macro_rules! rows {
    ($($(#[doc = $doc:literal])* $name:ident($binding:ident, $($place:tt)+),)*) => {
        &[$((layout::$binding, |resources| resources.$($place)+.as_binding())),*]
    };
}

macro_rules! declare {
    (all { $($all:tt)* } whitted { $($whitted:tt)* } paths { $($paths:tt)* } accel { $($accel:tt)* }) => {
        /// The bindings of all frames beside those of the acceleration structure.
        const OF_ALL: &[Row] = rows! {
            Frame(BIND_FRAME, frame), Materials(BIND_MATERIALS, materials), Lights(BIND_LIGHTS, lights), $($all)*
        };
        /// Further bindings, for ray trees.
        const OF_WHITTED: &[Row] = rows! { $($whitted)* };
        /// Further bindings, for paths.
        const OF_PATHS: &[Row] = rows! { NoiseTiles(BIND_NOISE_TILES, paths().noise_tiles), $($paths)* };
    };
}

for_resources!(declare);

/// Returns the bindings of a frame beside those of the acceleration structure.
fn rows(is_of_paths: bool) -> impl Iterator<Item = &'static Row> {
    OF_ALL.iter().chain(if is_of_paths { OF_PATHS } else { OF_WHITTED })
}

/// The number of elements of `counters` for each bounce of each batch, including the unused elements between the
/// copies of a counter.
const COUNTERS_PER_BOUNCE: usize = (COUNTER_COPIES * COUNTER_STRIDE) as usize;

/// Resources that the frame's kernels read and write. Each has the same name here, in the kernels, as debug label and
/// as allocation.
///
/// A clone is a second handle to the same buffers. A change makes a successor, which shares with its predecessor all
/// that it does not replace. If the change fails, the predecessor can still be used.
#[derive(Clone)]
pub struct Resources {
    /// The constants: one element.
    pub frame: Buffer<Frame>,
    pub accel: AccelBuffers,
    /// Three indices for each triangle, or empty if triangles are drawn without indices. None if the options do not
    /// use the graphics pipeline.
    pub vertex_indices: Option<Buffer<u32>>,
    pub materials: Buffer<Material>,
    /// `n_lights` elements.
    pub lights: Buffer<Light>,
    pub queue: Queue,
    /// None unless the frame traces paths.
    pub paths: Option<PathQueue>,
    pub pixels: Pixels,
    pub raster: RasterQueue,
    /// A row for each bounce of each batch.
    pub bounces: Buffer<Bounce>,
    counters: Buffer<Counters>,
    pub bindings: Arc<BindingLayout>,
    /// None until everything else is made.
    set: Option<Arc<BindingSet>>,
    /// The constants that the next frame uploads.
    constants: Frame,
}

/// Requirements of a frame.
pub struct Needs<'a> {
    /// The frame's constants. Their `queue_capacity` is the number of rays for which the queue has room.
    pub constants: &'a Frame,
    pub options: &'a RenderOptions,
    /// The number of rows of `bounces`: one for each bounce of each batch.
    pub n_bounces: usize,
}

impl Resources {
    /// Uploads the scene with its acceleration structure, and makes the buffers and images that a frame needs.
    ///
    /// # Errors
    /// There are too many triangles for brute force, a buffer is beyond the device's limits, or memory runs out.
    pub fn new(context: &Arc<Context>, world: &World, needs: &Needs) -> Result<Self, GpuError> {
        let is_of_paths = needs.options.integrator == Integrator::Path;
        let mut accel = AccelBuffers::of_world(context, world, is_of_paths)?;
        accel.add_links(context, world.geometry(), needs.options.traversal)?;
        Self::with_accel(context, world, needs, accel)
    }

    /// Makes the buffers and images of a frame of the same scene by another integrator. The scene's arrays are shared.
    /// `traversal`: that of these resources. `world`: that of these resources.
    ///
    /// # Errors
    /// Fails as [`Resources::new`] does.
    pub fn for_integrator(
        &self,
        context: &Arc<Context>,
        (world, traversal): (&World, Traversal),
        needs: &Needs,
    ) -> Result<Self, GpuError> {
        let is_of_paths = needs.options.integrator == Integrator::Path;
        let mut accel = self.accel.for_integrator(context, world, is_of_paths)?;
        if needs.options.traversal != traversal {
            accel.add_links(context, world.geometry(), needs.options.traversal)?;
        }
        Self::with_accel(context, world, needs, accel)
    }

    /// Makes the buffers and images that a frame needs beside the scene's arrays.
    fn with_accel(context: &Arc<Context>, world: &World, needs: &Needs, accel: AccelBuffers) -> Result<Self, GpuError> {
        let scene = world.scene();
        let storage = BufferUse::Storage;
        let &Needs { constants, options, n_bounces } = needs;
        let is_of_paths = options.integrator == Integrator::Path;
        let kinds: Vec<_> = rows(is_of_paths).map(|row| row.0).chain(accel::bindings()).map(binding).collect();
        let (queue, paths) = new_queues(context, constants, options)?;
        check_drawn(constants, options)?;
        // The triangles of instances have no vertices in common.
        let drawn = if scene.instances.is_some() { Vec::new() } else { vertex_indices(&scene.triangles) };
        let upload_indices = || new_vertex_indices(context, &drawn);
        let mut resources = Self {
            frame: Buffer::with(context, "frame", &[*constants], BufferUse::Uniform)?,
            vertex_indices: uses_graphics_pipeline(options).then(upload_indices).transpose()?,
            materials: if is_of_paths {
                Buffer::with(context, "materials", &path_materials(scene), storage)?
            } else {
                Buffer::with(context, "materials", &scene.materials, storage)?
            },
            lights: Buffer::with(context, "lights", &scene.lights, storage)?,
            queue,
            paths,
            pixels: Pixels::new(context, constants, options)?,
            raster: RasterQueue::new(context, constants.n_triangles, options)?,
            bounces: new_bounces(context, n_bounces)?,
            counters: new_counters(context, n_bounces)?,
            bindings: BindingLayout::with_constants(
                context,
                &kinds,
                PUSH_BYTES,
                (accel.constants(is_of_paths))
                    .set(layout::constants::ORTHOGRAPHIC, constants.is_orthographic == 1)
                    .set(layout::constants::PATHS, is_of_paths)
                    .set(layout::constants::EMITTERS, if is_of_paths { world.emitters().kinds() } else { 0 }),
            )?,
            accel,
            set: None,
            constants: *constants,
        };
        resources.set = Some(Arc::new(resources.make_set()?));
        Ok(resources)
    }

    fn make_set(&self) -> Result<BindingSet, GpuError> {
        let own: Vec<_> = rows(self.paths.is_some()).map(|(number, object)| (*number, object(self))).collect();
        BindingSet::new(&self.bindings, "frame", &[self.accel.objects(), own].concat())
    }

    fn paths(&self) -> &PathQueue {
        self.paths.as_ref().expect("a frame of paths")
    }

    /// Makes the resources for another frame of the same scene. The scene keeps its contents, and so do the pixels if
    /// their buffers fit the frame. All other contents are undefined. `links`: the scene's geometry if the traversal
    /// changes, else none.
    ///
    /// # Errors
    /// There are too many triangles for brute force, a buffer is beyond the device's limits, or memory runs out.
    pub fn for_frame(&self, context: &Arc<Context>, links: Option<Geometry>, needs: &Needs) -> Result<Self, GpuError> {
        let &Needs { constants, options, n_bounces } = needs;
        check_drawn(constants, options)?;
        self.changed(|next| {
            if let Some(geometry) = links {
                next.accel.add_links(context, geometry, options.traversal)?;
            }
            if uses_graphics_pipeline(options) != next.vertex_indices.is_some() {
                next.vertex_indices =
                    uses_graphics_pipeline(options).then(|| next.make_vertex_indices(context)).transpose()?;
            }
            let has_layers = next.paths.as_ref().is_some_and(|paths| !paths.path_snapshots.is_empty());
            if next.queue.capacity() < constants.queue_capacity || has_layers != options.has_light_layers() {
                (next.queue, next.paths) = new_queues(context, constants, options)?;
            }
            if !next.pixels.fit(constants, options) {
                next.pixels = Pixels::new(context, constants, options)?;
            }
            if !next.raster.fits(constants.n_triangles, options) {
                next.raster = RasterQueue::new(context, constants.n_triangles, options)?;
            }
            next.bounces = new_bounces(context, n_bounces)?;
            next.counters = new_counters(context, n_bounces)?;
            next.constants = Frame { queue_capacity: next.queue.capacity(), ..*constants };
            Ok(())
        })
    }

    /// Makes the resources for a world that differs in its instances, and in the places of as many lights.
    /// `differs`: whether it differs in its lights, and in its emitters.
    ///
    /// # Errors
    /// A buffer is beyond the device's limits, or memory runs out.
    pub fn with_instances(
        &self,
        context: &Arc<Context>,
        world: &World,
        [lights_differ, emitters_differ]: [bool; 2],
    ) -> Result<Self, GpuError> {
        self.changed(|next| {
            next.accel.set_instances(context, world.geometry())?;
            if lights_differ {
                next.lights = Buffer::with(context, "lights", &world.scene().lights, BufferUse::Storage)?;
            }
            if emitters_differ { next.accel.set_emitters(context, world) } else { Ok(()) }
        })
    }

    /// Makes the resources that have the pixels of another frame, with their contents, if these fit the options.
    ///
    /// # Errors
    /// Memory runs out.
    pub fn with_pixels_of(&self, other: &Self, options: &RenderOptions) -> Result<Option<Self>, GpuError> {
        if !other.pixels.fit(&self.constants, options) {
            return Ok(None);
        }
        let take = |next: &mut Self| {
            next.pixels.clone_from(&other.pixels);
            Ok(())
        };
        self.changed(take).map(Some)
    }

    /// Makes resources for another number of batches and bounces. The contents of `bounces` and the counters are
    /// undefined.
    ///
    /// # Errors
    /// Memory runs out.
    pub fn with_bounces(&self, context: &Arc<Context>, n_bounces: usize) -> Result<Self, GpuError> {
        self.changed(|next| {
            next.bounces = new_bounces(context, n_bounces)?;
            next.counters = new_counters(context, n_bounces)?;
            Ok(())
        })
    }

    /// Makes a successor that `change` has changed, with a descriptor set over the successor's buffers.
    fn changed(&self, change: impl FnOnce(&mut Self) -> Result<(), GpuError>) -> Result<Self, GpuError> {
        let mut next = self.clone();
        change(&mut next)?;
        next.set = Some(Arc::new(next.make_set()?));
        Ok(next)
    }

    /// Makes the vertex indices of the triangles that are on the device. The triangles are downloaded if they are few
    /// enough to have indices.
    fn make_vertex_indices(&self, context: &Arc<Context>) -> Result<Buffer<u32>, GpuError> {
        let triangles = &self.accel.arrays.triangles;
        let has_vertices = !self.accel.is_instanced;
        let triangles = if has_vertices && has_indices(triangles.len()) { triangles.download()? } else { Vec::new() };
        new_vertex_indices(context, &vertex_indices(&triangles))
    }

    /// Replaces the constants, for the same number of pixels and rays. The next frame uploads them.
    pub fn set_constants(&mut self, constants: &Frame) {
        self.constants = *constants;
    }

    /// Copies the first sample into the sums of samples. The buffer of the sums is made if there is none.
    ///
    /// # Errors
    /// Memory runs out, or a copy fails. Nothing has changed then.
    pub fn begin_sums(&mut self, context: &Arc<Context>) -> Result<(), GpuError> {
        let next = match self.pixels.pixel_accumulated {
            Some(_) => self.clone(),
            None => self.changed(|next| {
                let n_pixels = next.pixels.pixel_radiance.len();
                let sums = Buffer::new(context, "pixel_accumulated", n_pixels, BufferUse::Storage)?;
                next.pixels.pixel_accumulated = Some(sums);
                Ok(())
            })?,
        };
        let (sample, sums) = (next.pixels.pixel_radiance.any(), next.pixels.accumulated().any());
        context.run("first sample", |commands| {
            commands.barrier(Access::ComputeWrite, Access::TransferRead); // pixel_radiance
            commands.barrier(Access::ComputeUpdate, Access::TransferWrite); // pixel_accumulated
            commands.copy_buffer(sample, sums, sample.bytes());
            commands.barrier(Access::TransferWrite, Access::AnyUse); // pixel_accumulated
        })?;
        *self = next;
        Ok(())
    }

    /// Makes room for `n_sums` sums of samples for each pixel and each layer of light. The sums that are there are
    /// kept.
    ///
    /// # Errors
    /// The buffer is beyond the device's limits, memory runs out, or a copy fails. Nothing has changed then.
    pub fn make_room_for_sums(&mut self, context: &Arc<Context>, n_sums: u32) -> Result<(), GpuError> {
        let n_elements = n_sums as usize * self.n_pixels() * self.pixels.n_layers as usize;
        let (before, n_before) = (&self.pixels.pixel_accumulated, self.pixels.accumulated().len());
        if before.is_some() && n_before >= n_elements {
            return Ok(());
        }
        let next = self.changed(|next| {
            let sums = Buffer::new(context, "pixel_accumulated", n_elements, BufferUse::Storage)?;
            next.pixels.pixel_accumulated = Some(sums);
            Ok(())
        })?;
        if let Some(before) = before {
            let (from, to) = (before.any(), next.pixels.accumulated().any());
            context.run("more sums", |commands| {
                commands.barrier(Access::ComputeWrite, Access::TransferRead); // pixel_accumulated
                commands.copy_buffer(from, to, from.bytes());
                commands.barrier(Access::TransferWrite, Access::AnyUse); // pixel_accumulated
            })?;
        }
        *self = next;
        Ok(())
    }

    /// Sets all counters to 0.
    pub fn clear_counters(&self, commands: &Commands) {
        commands.clear_buffer(self.counters.any());
    }

    /// Downloads the sums of the kernels' counters, an element for each bounce of each batch.
    ///
    /// # Errors
    /// A copy fails.
    pub fn counters(&self) -> Result<Vec<Counters>, GpuError> {
        let sum = |row: &[Counters]| {
            row.iter().step_by(COUNTER_STRIDE as usize).fold(Counters::default(), |sum, place| Counters {
                n_hits: sum.n_hits + place.n_hits,
                n_shadow_rays: sum.n_shadow_rays + place.n_shadow_rays,
            })
        };
        Ok(self.counters.download()?.chunks_exact(COUNTERS_PER_BOUNCE).map(sum).collect())
    }

    /// The number of the window's pixels.
    pub fn n_pixels(&self) -> usize {
        n_pixels(&self.constants)
    }

    /// The constants that the kernels read, from the next frame on.
    pub fn constants(&self) -> &Frame {
        &self.constants
    }

    /// A dispatch of one invocation for each path of the batch.
    pub fn paths_dispatch(&self, batch: &Batch) -> Dispatch<'_> {
        let n_paths = batch.n_pixels << self.constants.samples_log2;
        Dispatch::Threads([n_paths, 1, 1], [layout::RAY_GROUP_SIZE, 1, 1])
    }

    /// A dispatch over the rays of the bounce, with `2^trace_lanes_log2` lanes for each ray ([`Bounce`]).
    pub fn trace_dispatch(&self, batch: &Batch) -> Dispatch<'_> {
        self.indirect(batch.bounce_ix, offset_of!(Bounce, trace_groups_x))
    }

    /// A dispatch of one invocation for each ray of the bounce.
    pub fn scan_dispatch(&self, batch: &Batch) -> Dispatch<'_> {
        self.indirect(batch.bounce_ix, offset_of!(Bounce, scan_groups_x))
    }

    /// A dispatch over the rays of all bounces of the batch and the lights, with `2^shadow_lanes_log2` lanes for each
    /// pair ([`Bounce`]).
    pub fn shadow_dispatch(&self, batch: &Batch) -> Dispatch<'_> {
        self.indirect(self.last_bounce(batch), offset_of!(Bounce, shadow_groups_x))
    }

    /// A dispatch of one invocation for each ray of the batch, of all bounces.
    pub fn shade_dispatch(&self, batch: &Batch) -> Dispatch<'_> {
        self.indirect(self.last_bounce(batch), offset_of!(Bounce, shade_groups_x))
    }

    /// Returns the row of a batch's last bounce. `batch.bounce_ix`: the row of its first bounce.
    fn last_bounce(&self, batch: &Batch) -> u32 {
        batch.bounce_ix + self.constants.max_depth - 1
    }

    /// A dispatch whose workgroups are in a member of a row of `bounces`. `member`: its offset, bytes.
    fn indirect(&self, bounce_ix: u32, member: usize) -> Dispatch<'_> {
        Dispatch::Indirect(self.bounces.any(), (bounce_ix as usize * size_of::<Bounce>() + member) as u64)
    }

    /// A dispatch of one invocation for each pixel of the window.
    pub fn pixel_dispatch(&self) -> Dispatch<'_> {
        self.layered_dispatch(1)
    }

    /// A dispatch of one invocation for each pixel of the window in the picture, and in each of its layers of light.
    pub fn layer_dispatch(&self) -> Dispatch<'_> {
        self.layered_dispatch(self.pixels.n_layers)
    }

    fn layered_dispatch(&self, n_layers: u32) -> Dispatch<'_> {
        let side = layout::PIXEL_GROUP_SIZE;
        Dispatch::Threads([self.constants.width, self.constants.height, n_layers], [side, side, 1])
    }

    /// Binds everything that the kernels read and write.
    pub fn bind(&self, commands: &Commands) {
        commands.bind(self.set());
    }

    pub(crate) fn set(&self) -> &BindingSet {
        self.set.as_ref().expect("made with the resources")
    }
}

/// Makes the queue, and what frames of paths have beside it.
fn new_queues(
    context: &Arc<Context>,
    constants: &Frame,
    options: &RenderOptions,
) -> Result<(Queue, Option<PathQueue>), GpuError> {
    let capacity = constants.queue_capacity;
    match options.integrator {
        Integrator::Path => {
            let paths = PathQueue::new(context, capacity, options.has_light_layers())?;
            Ok((Queue::of_paths(context, capacity)?, Some(paths)))
        }
        Integrator::Whitted => Ok((Queue::new(context, capacity, constants.n_lights)?, None)),
    }
}

fn new_vertex_indices(context: &Arc<Context>, indices: &[u32]) -> Result<Buffer<u32>, GpuError> {
    Buffer::with(context, "vertex_indices", indices, BufferUse::Index)
}

fn new_bounces(context: &Arc<Context>, n_bounces: usize) -> Result<Buffer<Bounce>, GpuError> {
    Buffer::new(context, "bounces", n_bounces, BufferUse::Indirect)
}

fn new_counters(context: &Arc<Context>, n_bounces: usize) -> Result<Buffer<Counters>, GpuError> {
    Buffer::new(context, "counters", n_bounces * COUNTERS_PER_BOUNCE, BufferUse::Storage)
}

/// Refuses more triangles than the graphics pipeline has indices of vertices for.
fn check_drawn(constants: &Frame, options: &RenderOptions) -> Result<(), GpuError> {
    let (value, limit) = (u64::from(constants.n_triangles), u64::from(u32::MAX / 3));
    match uses_graphics_pipeline(options) && value > limit {
        true => Err(GpuError::Limit { what: "triangles that the graphics pipeline draws", value, limit }),
        false => Ok(()),
    }
}
