//! The frame: the order of passes, every barrier between them, one command buffer a bounce.

mod bands;
mod changes;
mod parts;
mod profile;
mod schedule;

use std::sync::Arc;

use tracing::info_span;

pub use self::{
    bands::{BandedRenderer, Drawn, Watcher},
    parts::Displayed,
};
use self::{
    parts::{Pending, Step, Traced, Until},
    schedule::{Room, Schedule},
};
use crate::{
    buffers::{Needs, Resources},
    frame::{Denoise, Picture, Primary, Profile, RenderOptions, frame_constants},
    gpu::{Access, AnyBuffer, CommandBuffer, Commands, Context, GpuError},
    layout::{Batch, FalseColor, Feature, MATERIAL_REFLECT, MATERIAL_REFRACT},
    passes::{Passes, Rasterize},
    scene::Camera,
    world::World,
};

/// A scene on a device, ready to be drawn again and again: sample by sample, from other places, with other options.
pub struct Renderer {
    context: Arc<Context>,
    world: World,
    camera: Camera,
    options: RenderOptions,
    room: Room,
    resources: Resources,
    passes: Passes,
    schedule: Schedule,
    /// Samples a pixel that the picture holds.
    n_samples: u32,
    /// What is displayed in place of the picture, where there are features.
    false_color: Option<FalseColor>,
    /// Whether the view asks for the hits of primary rays only, where there are features.
    needs_primary_rays_only: bool,
    /// Whether what samples are added to holds the first one.
    has_sums: bool,
    /// A sample that is drawn in part.
    pending: Option<Pending>,
    /// Pixels of a batch at the most, where the caller has said so.
    most_pixels: Option<u32>,
    /// What pixel_display holds.
    displayed: Option<Displayed>,
}

impl Renderer {
    /// Uploads the scene and makes the passes.
    ///
    /// # Errors
    /// The scene or the picture is beyond the device's limits or memory.
    pub fn new(context: Arc<Context>, world: &World, options: &RenderOptions) -> Result<Self, GpuError> {
        Self::with_capacity(context, world, options, None)
    }

    /// As [`Renderer::new`], with room for so many rays in the queue. A frame that makes more is split into batches.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn with_queue_capacity(
        context: Arc<Context>,
        world: &World,
        options: &RenderOptions,
        capacity: u32,
    ) -> Result<Self, GpuError> {
        Self::with_capacity(context, world, options, Some(capacity))
    }

    fn with_capacity(
        context: Arc<Context>,
        world: &World,
        options: &RenderOptions,
        fixed_capacity: Option<u32>,
    ) -> Result<Self, GpuError> {
        let scene = world.scene();
        let both = MATERIAL_REFLECT | MATERIAL_REFRACT;
        let branches = scene.materials.iter().any(|material| material.flags & both == both);
        let mut constants = frame_constants(scene, world.tree(), options);
        constants.n_lanes = lanes_to_share(&context, options)?;
        let room = Room { fixed_capacity, branches };
        constants.queue_capacity = room.queue_capacity(context.limits(), &constants);
        let spans = room.spans(&constants, None);
        let schedule = Schedule::new(&context, &constants, spans, options.profile)?;
        let uploading = info_span!("upload scene").entered();
        let needs = Needs { constants: &constants, options, n_bounces: schedule.n_rows() };
        let resources = Resources::new(&context, world, &needs)?;
        drop(uploading);
        let passes = info_span!("make pipelines").in_scope(|| Passes::new(&context, &resources.bindings, options))?;
        let (camera, options) = (scene.camera, options.clone());
        Ok(Self {
            context,
            world: world.clone(),
            camera,
            options,
            room,
            resources,
            passes,
            schedule,
            n_samples: 0,
            false_color: None,
            needs_primary_rays_only: false,
            has_sums: false,
            pending: None,
            most_pixels: None,
            displayed: None,
        })
    }

    /// Draws the frame and fetches its picture.
    ///
    /// # Errors
    /// A failed call; one pixel alone makes more rays than a queue holds.
    pub fn render(&mut self) -> Result<(Picture, Profile), GpuError> {
        let profile = self.draw()?;
        Ok((self.picture()?, profile))
    }

    /// Draws the frame by one sample a pixel, at its centre. The picture stays on the device.
    ///
    /// # Errors
    /// As [`Renderer::render`].
    pub fn draw(&mut self) -> Result<Profile, GpuError> {
        self.reset_samples();
        self.draw_sample()
    }

    /// Draws the frame by one sample more a pixel, the first at its centre; the picture, which stays on the device, is the
    /// mean of all. Where a queue was too small, the batches that it broke off are halved and the sample is drawn anew;
    /// later ones keep the smaller batches.
    ///
    /// # Errors
    /// As [`Renderer::render`]. The next sample is the first again then.
    pub fn draw_sample(&mut self) -> Result<Profile, GpuError> {
        loop {
            if let Some(profile) = self.go_on(Until::End)? {
                return Ok(profile);
            }
        }
    }

    /// Filters and encodes the samples that are there anew, with options that have changed since; no sample is begun.
    ///
    /// # Errors
    /// A failed call.
    pub fn show(&mut self) -> Result<(), GpuError> {
        self.context.run("show", |commands| {
            self.resources.bind(commands);
            self.update_constants(commands);
            self.show_samples(commands);
        })?;
        self.note_displayed();
        Ok(())
    }

    /// The picture as it was last drawn or shown, of a sample that is complete.
    ///
    /// # Errors
    /// A failed copy.
    pub fn picture(&self) -> Result<Picture, GpuError> {
        let _fetching = info_span!("fetch picture").entered();
        let (pixels, n_pixels) = (&self.resources.pixels, self.resources.n_pixels());
        let (window, crop) = (self.options.window(), self.options.crop_or_whole());
        let display = pixels.pixel_display.download_first(n_pixels)?;
        Ok(Picture {
            width: crop.width(),
            height: crop.height(),
            radiance: window.part(&pixels.filtered().download_first(n_pixels)?, &crop),
            display: window.part(&display, &crop).into_iter().map(u32::to_le_bytes).collect(),
        })
    }

    /// What the rays of each of the picture's pixels met and cost, of the sample drawn last.
    ///
    /// # Panics
    /// The options do not ask for features.
    ///
    /// # Errors
    /// A failed copy.
    pub fn features(&self) -> Result<Vec<Feature>, GpuError> {
        assert!(self.options.features, "the options ask for features");
        let features = self.resources.pixels.pixel_features.download_first(self.resources.n_pixels())?;
        Ok(self.options.window().part(&features, &self.options.crop_or_whole()))
    }

    /// The frame's buffers, as the last frame left them.
    pub fn resources(&self) -> &Resources {
        &self.resources
    }

    /// Algorithm 1: one command buffer before, one a bounce, one for the light on all of a batch's rays, one after.
    fn record(&self) -> Result<Vec<Step>, GpuError> {
        let mut frame = vec![Step::plain(self.command_buffer("begin frame", |commands| self.begin_frame(commands))?)];
        for &batch in &self.schedule.batches {
            for depth in 0..self.n_bounces() {
                let batch = Batch { bounce_ix: batch.bounce_ix + depth, depth, ..batch };
                let traced = (!self.is_rasterized(depth)).then_some(Traced::Rays(batch));
                let hits = |commands: &Commands| self.find_hits(commands, &batch);
                frame.extend(
                    self.steps(&format!("bounce {depth}"), traced, hits, |commands| self.next_rays(commands, &batch))?,
                );
            }
            if !self.draws_primary_rays_only() {
                let traced = (self.resources.constants().n_lights > 0).then_some(Traced::Shadows(batch));
                let shadows = |commands: &Commands| self.cast_shadows(commands, &batch);
                frame.extend(self.steps("light", traced, shadows, |commands| self.light(commands, &batch))?);
            }
            frame.last_mut().expect("the steps of the batch").ends_batch = true;
        }
        frame.push(Step::plain(self.command_buffer("end frame", |commands| self.end_frame(commands))?));
        Ok(frame)
    }

    /// What traces rays and what needs their results, in one command buffer. Where rays can stall they are two: the device
    /// goes on with the second when the host has seen that all rays of the first have ended.
    fn steps(
        &self,
        name: &str,
        traced: Option<Traced>,
        trace: impl Fn(&Commands),
        rest: impl Fn(&Commands),
    ) -> Result<Vec<Step>, GpuError> {
        let Some(traced) = traced.filter(|_| self.resources.accel.stalls.can_occur()) else {
            let both = |commands: &Commands| {
                self.resources.bind(commands);
                trace(commands);
                rest(commands);
            };
            return Ok(vec![Step::plain(self.command_buffer(name, both)?)]);
        };
        let tracing = |commands: &Commands| {
            self.resources.bind(commands);
            self.resources.accel.stalls.reset(commands);
            trace(commands);
        };
        let resting = |commands: &Commands| {
            self.resources.bind(commands);
            rest(commands);
        };
        Ok(vec![
            Step::traced(self.command_buffer(name, tracing)?, traced),
            Step::plain(self.command_buffer(name, resting)?),
        ])
    }

    /// Brings the rays of a step that has run to their ends.
    fn finish_rays(&self, traced: &Traced) -> Result<(), GpuError> {
        let (passes, resources) = (&self.passes, &self.resources);
        resources.accel.stalls.finish(&self.context, |commands, round| {
            resources.bind(commands);
            let round = round.constant();
            match *traced {
                Traced::Rays(batch) => passes.trace.record(commands, resources, &Batch { round, ..batch }),
                Traced::Shadows(batch) => passes.shadow.record(commands, resources, &Batch { round, ..batch }),
            }
        })?;
        Ok(())
    }

    /// Whether the hits of a level's rays are found without the tree.
    fn is_rasterized(&self, depth: u32) -> bool {
        depth == 0 && self.options.primary != Primary::Trace
    }

    fn command_buffer(&self, name: &str, body: impl FnOnce(&Commands)) -> Result<CommandBuffer, GpuError> {
        CommandBuffer::record(&self.context, name, self.schedule.timer.as_ref(), body)
    }

    fn begin_frame(&self, commands: &Commands) {
        commands.reset_timer();
        self.resources.bind(commands);
        self.update_constants(commands);
        copy_all(commands, self.schedule.first_bounces.any(), self.resources.bounces.any());
        self.resources.clear_counters(commands);
        if self.options.features {
            commands.clear_buffer(self.resources.pixels.pixel_features.any());
        }
        if self.options.primary == Primary::Compute {
            Rasterize::reset(commands, &self.resources);
        }
        // bounces, counters, pixel_features, raster_groups, raster_count
        commands.barrier(Access::TransferWrite, Access::AllReads);
        if let Some(visibility) = &self.passes.visibility {
            visibility.record(commands, &self.resources);
        }
        if let Some(rasterize) = &self.passes.rasterize {
            rasterize.record(commands, &self.resources);
            commands.barrier(Access::ComputeWrite, Access::ComputeRead); // pixel_nearest
        }
    }

    fn update_constants(&self, commands: &Commands) {
        commands.barrier(Access::AllReads, Access::TransferWrite); // what the frame before still reads
        commands.update_buffer(self.resources.accel.frame.any(), self.resources.constants());
        commands.barrier(Access::TransferWrite, Access::AllReads); // frame
    }

    /// The closest hits of one level of rays.
    fn find_hits(&self, commands: &Commands, batch: &Batch) {
        if self.is_rasterized(batch.depth) {
            self.passes.primary_hit.record(commands, batch);
        } else {
            self.passes.trace.record(commands, &self.resources, batch);
        }
        commands.barrier(Access::ComputeWrite, Access::ComputeUpdate); // hits, counters
    }

    /// The next level of rays, from the hits of this one.
    fn next_rays(&self, commands: &Commands, batch: &Batch) {
        let (passes, resources) = (&self.passes, &self.resources);
        if batch.depth == 0 && self.options.features {
            passes.features.record(commands, batch);
            commands.barrier(Access::ComputeWrite, Access::ComputeUpdate); // pixel_features
        }
        if batch.depth + 1 < self.n_bounces() {
            passes.compact.record(commands, resources, batch);
            commands.barrier(Access::ComputeWrite, Access::ComputeUpdate); // rays, first_children
        }
    }

    /// Which lights the hits of all bounces see. A dispatch lasts as long as its longest ray; one for the shadows of all
    /// bounces waits for such a ray once, not once a bounce.
    fn cast_shadows(&self, commands: &Commands, batch: &Batch) {
        if self.resources.constants().n_lights > 0 {
            self.passes.shadow.record(commands, &self.resources, batch);
            commands.barrier(Access::ComputeWrite, Access::ComputeUpdate); // light_visibility
        }
    }

    /// What the lights give to the hits of all bounces, and that to the pixels.
    fn light(&self, commands: &Commands, batch: &Batch) {
        let (passes, resources) = (&self.passes, &self.resources);
        passes.shade.record(commands, resources, batch);
        commands.barrier(Access::ComputeWrite, Access::ComputeUpdate); // ray_radiance, counters
        passes.resolve.record(commands, batch);
        commands.barrier(Access::ComputeWrite, Access::ComputeUpdate); // pixel_radiance; the next batch overwrites the queue
    }

    fn end_frame(&self, commands: &Commands) {
        self.resources.bind(commands);
        if self.resources.constants().n_samples > 1 && !self.draws_primary_rays_only() {
            self.passes.accumulate.record(commands, &self.resources);
            commands.barrier(Access::ComputeWrite, Access::ComputeRead); // pixel_radiance
        }
        self.show_samples(commands);
    }

    /// From the mean of all samples to what a display shows.
    fn show_samples(&self, commands: &Commands) {
        if self.options.denoise != Denoise::Off && !self.draws_primary_rays_only() {
            self.passes.denoise.record(commands, &self.resources);
            commands.barrier(Access::ComputeWrite, Access::ComputeRead); // pixel_filtered
        }
        match &self.false_color {
            Some(push) if self.options.features => self.passes.false_color.record(commands, &self.resources, push),
            _ => self.passes.tonemap.record(commands, &self.resources),
        }
    }
}

/// Lanes that are shared out among rays. Where what rays cost is shown, each has one, as if it went alone.
fn lanes_to_share(context: &Arc<Context>, options: &RenderOptions) -> Result<u32, GpuError> {
    if options.features { Ok(0) } else { context.n_lanes() }
}

fn copy_all(commands: &Commands, source: &AnyBuffer, destination: &AnyBuffer) {
    commands.copy_buffer(source, destination, source.bytes());
}
