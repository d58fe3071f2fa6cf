//! The frame: the order of passes, every barrier between them, one command buffer a bounce.

use std::{mem, sync::Arc, time::Instant};

use tracing::info_span;

use crate::{
    camera::frame_constants,
    frame::{Denoise, PassTime, Picture, Primary, Profile, RenderOptions},
    gpu::{Access, AnyBuffer, Buffer, BufferUse, CommandBuffer, Commands, Context, GpuError, Limits, Timer, TimerRow},
    kdtree::KdTree,
    layout::{Batch, Bounce, Counters, Frame, MATERIAL_REFLECT, MATERIAL_REFRACT, RAY_GROUP_SIZE, Ray},
    passes::{Passes, Resources, bounce_row},
    profile::{count_batches, device_counts, sum_of_batches},
    scene::Scene,
};

/// A scene on a device, ready to be drawn.
pub struct Renderer {
    context: Arc<Context>,
    options: RenderOptions,
    resources: Resources,
    passes: Passes,
    schedule: Schedule,
}

impl Renderer {
    /// Uploads the scene and makes the passes.
    ///
    /// # Errors
    /// The scene or the picture is beyond the device's limits or memory.
    pub fn new(context: Arc<Context>, scene: &Scene, tree: &KdTree, options: &RenderOptions) -> Result<Self, GpuError> {
        let capacity = queue_capacity(context.limits(), scene, options);
        Self::with_queue_capacity(context, scene, tree, options, capacity)
    }

    /// As [`Renderer::new`], with room for so many rays in a queue. A frame that makes more is split into batches.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn with_queue_capacity(
        context: Arc<Context>,
        scene: &Scene,
        tree: &KdTree,
        options: &RenderOptions,
        capacity: u32,
    ) -> Result<Self, GpuError> {
        let constants = Frame { queue_capacity: capacity, ..frame_constants(scene, tree, options) };
        let spans = split_evenly(options.width * options.height, capacity);
        let n_rows = spans.len() * options.max_depth as usize;
        let uploading = info_span!("upload scene").entered();
        let mut resources = Resources::new(&context, scene, tree, &constants, n_rows)?;
        resources.add_extras(&context, tree, options.traversal)?;
        drop(uploading);
        let passes = info_span!("make pipelines").in_scope(|| Passes::new(&context, &resources.bindings, options))?;
        let schedule = Schedule::new(&context, &resources, &spans, options.profile)?;
        Ok(Self { context, options: options.clone(), resources, passes, schedule })
    }

    /// Draws the frame and fetches its picture.
    ///
    /// # Errors
    /// A failed call; one pixel alone makes more rays than a queue holds.
    pub fn render(&mut self) -> Result<(Picture, Profile), GpuError> {
        let profile = self.draw()?;
        Ok((self.picture()?, profile))
    }

    /// Draws the frame; its picture stays on the device. Where a queue was too small, the batches that it broke off
    /// are halved and the frame is drawn anew; later frames keep the smaller batches.
    ///
    /// # Errors
    /// As [`Renderer::render`].
    pub fn draw(&mut self) -> Result<Profile, GpuError> {
        loop {
            let frame = info_span!("record").in_scope(|| self.record())?;
            let running = info_span!("submit and wait").entered();
            let begun_at = Instant::now();
            self.context.submit(&frame.iter().collect::<Vec<_>>())?;
            self.context.wait()?;
            drop((frame, running));
            let _fetching = info_span!("fetch counts").entered();
            let bounces = self.resources.bounces.download()?;
            if !bounces.iter().any(|row| row.overflow != 0) {
                return self.profile(&bounces, begun_at);
            }
            self.split_batches(&bounces)?;
        }
    }

    /// The last drawn frame.
    ///
    /// # Errors
    /// A failed copy.
    pub fn picture(&self) -> Result<Picture, GpuError> {
        let _fetching = info_span!("fetch picture").entered();
        let resources = &self.resources;
        Ok(Picture {
            width: self.options.width,
            height: self.options.height,
            radiance: resources.filtered().download()?,
            display: resources.pixel_display.download()?.into_iter().map(u32::to_le_bytes).collect(),
        })
    }

    /// The frame's buffers, as the last frame left them.
    pub fn resources(&self) -> &Resources {
        &self.resources
    }

    /// Algorithm 1: one command buffer before, one a bounce, one after.
    fn record(&self) -> Result<Vec<CommandBuffer>, GpuError> {
        let mut frame = vec![self.command_buffer("begin frame", |commands| self.begin_frame(commands))?];
        for &batch in &self.schedule.batches {
            for depth in 0..self.options.max_depth {
                let batch = Batch { bounce_ix: batch.bounce_ix + depth, depth, ..batch };
                let name = format!("bounce {depth}");
                frame.push(self.command_buffer(&name, |commands| self.bounce(commands, &batch))?);
            }
        }
        frame.push(self.command_buffer("end frame", |commands| self.end_frame(commands))?);
        Ok(frame)
    }

    fn command_buffer(&self, name: &str, body: impl FnOnce(&Commands)) -> Result<CommandBuffer, GpuError> {
        CommandBuffer::record(&self.context, name, self.schedule.timer.as_ref(), body)
    }

    fn begin_frame(&self, commands: &Commands) {
        commands.reset_timer();
        commands.bind(&self.resources.sets[0]);
        copy_all(commands, self.schedule.first_bounces.any(), self.resources.bounces.any());
        copy_all(commands, self.schedule.zero_counters.any(), self.resources.counters.any());
        commands.barrier(Access::TransferWrite, Access::AllReads); // bounces, counters
        match self.options.primary {
            Primary::Raster => self.passes.visibility.record(commands, &self.resources),
            // Unread then, but bound: the layout has to be the set's.
            Primary::Trace => {
                commands.begin_targets(&self.resources.triangle_ids, &self.resources.depth);
                commands.ids_to_compute(&self.resources.triangle_ids);
            }
        }
    }

    /// One level of rays: hits, light, the next level's rays.
    fn bounce(&self, commands: &Commands, batch: &Batch) {
        let (passes, resources) = (&self.passes, &self.resources);
        resources.bind(commands, batch);
        // The bounce before has read what this one overwrites: hits, light_visibility, the ray queue of the batch before.
        commands.barrier(Access::ComputeRead, Access::ComputeWrite);
        if batch.depth == 0 {
            passes.primary_hit.record(commands, batch);
            commands.barrier(Access::ComputeWrite, Access::ComputeUpdate); // rays, hits, counters
        }
        if batch.depth > 0 || self.options.primary == Primary::Trace {
            passes.trace.record(commands, resources, batch);
            commands.barrier(Access::ComputeWrite, Access::ComputeUpdate); // hits, counters
        }
        if resources.constants().n_lights > 0 {
            passes.shadow.record(commands, resources, batch);
            commands.barrier(Access::ComputeWrite, Access::ComputeUpdate); // light_visibility, counters
        }
        passes.shade.record(commands, resources, batch);
        commands.barrier(Access::ComputeWrite, Access::ComputeUpdate); // ray_radiance, child_rays, child_counts
        passes.resolve.record(commands, resources, batch);
        commands.barrier(Access::ComputeWrite, Access::ComputeUpdate); // pixel_radiance
        if batch.depth + 1 < self.options.max_depth {
            passes.compact.record(commands, resources, batch);
            commands.barrier(Access::ComputeWrite, Access::ComputeUpdate); // next_rays
        }
    }

    fn end_frame(&self, commands: &Commands) {
        commands.bind(&self.resources.sets[0]);
        if self.options.denoise != Denoise::Off {
            self.passes.denoise.record(commands, &self.resources);
            commands.barrier(Access::ComputeWrite, Access::ComputeRead); // pixel_filtered
        }
        self.passes.tonemap.record(commands, &self.resources);
    }

    /// Halves each batch in which a bounce overflowed.
    fn split_batches(&mut self, bounces: &[Bounce]) -> Result<(), GpuError> {
        let max_depth = self.options.max_depth as usize;
        let mut spans = Vec::new();
        for (batch, rows) in self.schedule.batches.iter().zip(bounces.chunks_exact(max_depth)) {
            let (first, n) = (batch.first_pixel, batch.n_pixels);
            match rows.iter().find(|row| row.overflow != 0) {
                None => spans.push((first, n)),
                Some(row) if n == 1 => {
                    return Err(GpuError::Limit {
                        what: "rays of one pixel on one level",
                        value: u64::from(row.n_wanted),
                        limit: u64::from(self.resources.constants().queue_capacity),
                    });
                }
                Some(_) => spans.extend([(first, n / 2), (first + n / 2, n - n / 2)]),
            }
        }
        tracing::debug!(n_batches = spans.len(), "ray queues overflowed");
        self.resources.resize_bounces(&self.context, spans.len() * max_depth)?;
        self.schedule = Schedule::new(&self.context, &self.resources, &spans, self.options.profile)?;
        Ok(())
    }

    /// Times and counts of a frame that was begun then; nothing without a profile.
    fn profile(&self, bounces: &[Bounce], begun_at: Instant) -> Result<Profile, GpuError> {
        let Some(timer) = &self.schedule.timer else { return Ok(Profile::default()) };
        let rows = timer.rows()?;
        let max_depth = self.options.max_depth;
        let counts = device_counts(bounces, &self.resources.counters.download()?);
        let ends_ms = rows.iter().map(|row| row.span_ms.map(|(_, end)| end));
        let pass = |row: &TimerRow| PassTime {
            name: row.name,
            bounce: row.bounce,
            start_ms: row.span_ms.map(|(begin, _)| begin),
            ms: row.span_ms.map(|(begin, end)| end - begin),
            ..PassTime::default()
        };
        let mut passes: Vec<_> = rows.iter().map(pass).collect();
        count_batches(&mut passes, &counts, max_depth, self.options.primary);
        Ok(Profile {
            device: self.context.info().name.clone(),
            n_batches: self.schedule.batches.len() as u32,
            bounces: sum_of_batches(&counts, max_depth),
            frame_ms: ends_ms.max_by(|a, b| a.partial_cmp(b).expect("no NaN")).flatten(),
            passes,
            begun_at: Some(begun_at),
        })
    }
}

/// The batches of a frame, and what depends on their number.
struct Schedule {
    /// depth 0; bounce_ix is the batch's first row.
    batches: Vec<Batch>,
    /// What `bounces` and `counters` hold when a frame begins.
    first_bounces: Buffer<Bounce>,
    zero_counters: Buffer<Counters>,
    /// None without a profile.
    timer: Option<Timer>,
}

impl Schedule {
    /// `spans`: first pixel and number of pixels of each batch.
    fn new(context: &Arc<Context>, resources: &Resources, spans: &[(u32, u32)], timed: bool) -> Result<Self, GpuError> {
        let constants = resources.constants();
        let max_depth = constants.max_depth;
        let batches: Vec<_> = (0..)
            .zip(spans)
            .map(|(batch_ix, &(first_pixel, n_pixels))| Batch {
                first_pixel,
                n_pixels,
                bounce_ix: batch_ix * max_depth,
                depth: 0,
            })
            .collect();
        let rows: Vec<_> = batches
            .iter()
            .flat_map(|batch| (0..max_depth).map(|depth| if depth == 0 { batch.n_pixels } else { 0 }))
            .map(|n_rays| bounce_row(n_rays, constants.n_lights))
            .collect();
        let zeros = vec![Counters::default(); rows.len()];
        // The widest bounce has 9 kernels; visibility, denoise and tonemap stand outside.
        let n_passes = 3 + 9 * rows.len() as u32;
        Ok(Self {
            first_bounces: Buffer::with(context, "first_bounces", &rows, BufferUse::Storage)?,
            zero_counters: Buffer::with(context, "zero_counters", &zeros, BufferUse::Storage)?,
            timer: timed.then(|| Timer::new(context, n_passes)).transpose()?,
            batches,
        })
    }
}

fn copy_all(commands: &Commands, source: &AnyBuffer, destination: &AnyBuffer) {
    commands.copy_buffer(source, destination, source.bytes());
}

/// Rays that a queue should hold: two a pixel where rays can branch, else one, as far as the device's limits go.
fn queue_capacity(limits: &Limits, scene: &Scene, options: &RenderOptions) -> u32 {
    let branches = scene.materials.iter().any(|m| {
        let both = MATERIAL_REFLECT | MATERIAL_REFRACT;
        m.flags & both == both
    });
    let wanted = u64::from(options.width) * u64::from(options.height) * if branches { 2 } else { 1 };
    // child_rays and light_visibility are the widest buffers of a ray.
    let bytes_a_ray = (2 * mem::size_of::<Ray>()).max(4 * scene.lights.len()) as u64;
    let most = (limits.storage_range / bytes_a_ray).min(u64::from(limits.n_groups) * u64::from(RAY_GROUP_SIZE));
    wanted.min(most).max(1) as u32
}

/// Spans of equal size that leave each batch room to grow to the capacity.
fn split_evenly(n_pixels: u32, capacity: u32) -> Vec<(u32, u32)> {
    let n_batches = n_pixels.div_ceil(capacity).max(1);
    let size = n_pixels.div_ceil(n_batches);
    (0..n_batches).map(|i| (i * size, size.min(n_pixels - i * size))).collect()
}
