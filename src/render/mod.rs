//! The frame on a device: what [`Plan`] says, recorded, in one command buffer a bounce.

mod bands;
mod given;
mod incremental;
mod profile;
mod reconfigure;
mod schedule;

use std::sync::Arc;

use tracing::info_span;

pub use self::{bands::BandedRenderer, incremental::Displayed};
use self::{
    incremental::{Part, Pending, Traced, Until},
    schedule::{QueueBudget, Schedule},
};
use crate::{
    buffers::{Needs, Resources},
    frame::{FrameKind, Pass, Picture, Plan, Primary, Profile, RenderOptions, Step, plan},
    gpu::{Access, AnyBuffer, CommandBuffer, Commands, Context, GpuError},
    layout::{Batch, FalseColor, Feature, MATERIAL_REFLECT, MATERIAL_REFRACT},
    passes::{Inputs, Passes, Rasterize},
    scene::Camera,
    world::World,
};

/// A scene on a device, ready to be drawn again and again: sample by sample, from other places, with other options.
pub struct Renderer {
    context: Arc<Context>,
    world: World,
    camera: Camera,
    options: RenderOptions,
    budget: QueueBudget,
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
        let mut constants = world.frame_constants(options);
        constants.n_lanes = lanes_to_share(&context, options)?;
        let budget = QueueBudget { fixed_capacity, branches };
        constants.queue_capacity = budget.queue_capacity(context.limits(), &constants);
        let spans = budget.spans(&constants, None);
        let schedule = Schedule::new(&context, &constants, spans, options)?;
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
            budget,
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
            self.record_section(commands, &plan::display(&self.frame_kind()), &Batch::default());
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

    /// Records the plan: one command buffer before all batches, one a bounce, one for the light on all of a batch's rays, one
    /// after all batches.
    fn record(&self) -> Result<Vec<Part>, GpuError> {
        let plan = Plan::new(&self.frame_kind());
        let begin = self.command_buffer("begin frame", |commands| self.begin_frame(commands, &plan.visibility))?;
        let mut frame = vec![Part::plain(begin)];
        for &batch in &self.schedule.batches {
            for (depth, bounce) in (0..).zip(&plan.bounces) {
                let batch = Batch { bounce_ix: batch.bounce_ix + depth, depth, ..batch };
                frame.extend(self.parts(&format!("bounce {depth}"), bounce, &batch)?);
            }
            if !plan.light.is_empty() {
                frame.extend(self.parts("light", &plan.light, &batch)?);
            }
            frame.last_mut().expect("the parts of the batch").ends_batch = true;
        }
        let end = self.command_buffer("end frame", |commands| {
            self.resources.bind(commands);
            self.record_section(commands, &plan.image, &Batch::default());
        })?;
        frame.push(Part::plain(end));
        Ok(frame)
    }

    /// Which passes the next sample has.
    fn frame_kind(&self) -> FrameKind {
        let only_primary_rays = self.draws_primary_rays_only();
        let constants = self.resources.constants();
        FrameKind {
            n_bounces: if only_primary_rays { 1 } else { self.options.max_depth },
            is_lit: !only_primary_rays,
            adds_samples: constants.n_samples > 1,
            shows_feature: self.options.features && self.false_color.is_some(),
            ..FrameKind::new(&self.options, constants.n_lights)
        }
    }

    /// Records a section of a batch in one command buffer. Where rays of the section can stall they are two: the device goes
    /// on with the second when the host has seen that all rays of the first have ended.
    fn parts(&self, name: &str, section: &[Step], batch: &Batch) -> Result<Vec<Part>, GpuError> {
        let traced = self.traced(section, batch).filter(|_| self.resources.accel.stalls.can_occur());
        let Some(traced) = traced else {
            let all = |commands: &Commands| {
                self.resources.bind(commands);
                self.record_section(commands, section, batch);
            };
            return Ok(vec![Part::plain(self.command_buffer(name, all)?)]);
        };
        // The pass and the barrier behind it.
        let (trace, rest) = section.split_at(2);
        let tracing = |commands: &Commands| {
            self.resources.bind(commands);
            self.resources.accel.stalls.reset(commands);
            self.record_section(commands, trace, batch);
        };
        let resting = |commands: &Commands| {
            self.resources.bind(commands);
            self.record_section(commands, rest, batch);
        };
        Ok(vec![
            Part::traced(self.command_buffer(name, tracing)?, traced),
            Part::plain(self.command_buffer(name, resting)?),
        ])
    }

    /// The rays that a section's first pass takes through the acceleration structure.
    fn traced(&self, section: &[Step], batch: &Batch) -> Option<Traced> {
        match section.first()? {
            Step::Run(Pass::Trace) => Some(Traced::Rays(*batch)),
            Step::Run(Pass::Shadow) => Some(Traced::Shadows(*batch)),
            _ => None,
        }
    }

    /// Brings the rays of a part that has run to their ends.
    fn finish_rays(&self, traced: &Traced) -> Result<(), GpuError> {
        self.resources.accel.stalls.finish(&self.context, |commands, round| {
            self.resources.bind(commands);
            let round = round.constant();
            let (pass, batch) = match *traced {
                Traced::Rays(batch) => (Pass::Trace, batch),
                Traced::Shadows(batch) => (Pass::Shadow, batch),
            };
            self.record_section(commands, &[Step::Run(pass)], &Batch { round, ..batch });
        })?;
        Ok(())
    }

    fn command_buffer(&self, name: &str, body: impl FnOnce(&Commands)) -> Result<CommandBuffer, GpuError> {
        CommandBuffer::record(&self.context, name, self.schedule.timer.as_ref(), body)
    }

    /// What is there before the first pass: constants, rows of bounces, cleared counts. Then primary visibility.
    fn begin_frame(&self, commands: &Commands, visibility: &[Step]) {
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
        // bounces, counters, pixel_features, raster_groups
        commands.barrier(Access::TransferWrite, Access::AllReads);
        self.record_section(commands, visibility, &Batch::default());
    }

    fn update_constants(&self, commands: &Commands) {
        commands.barrier(Access::AllReads, Access::TransferWrite); // what the frame before still reads
        commands.update_buffer(self.resources.frame.any(), self.resources.constants());
        commands.barrier(Access::TransferWrite, Access::AllReads); // frame
    }

    fn record_section(&self, commands: &Commands, section: &[Step], batch: &Batch) {
        let inputs = Inputs { batch: *batch, false_color: self.false_color };
        self.passes.record_section(commands, &self.resources, section, &inputs);
    }
}

/// Lanes that are shared out among rays. Where what rays cost is shown, each has one, as if it went alone.
fn lanes_to_share(context: &Arc<Context>, options: &RenderOptions) -> Result<u32, GpuError> {
    if options.features { Ok(0) } else { context.n_lanes() }
}

fn copy_all(commands: &Commands, source: &AnyBuffer, destination: &AnyBuffer) {
    commands.copy_buffer(source, destination, source.bytes());
}
