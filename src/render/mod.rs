//! Draws frames on a device: records the passes and barriers of a [`Plan`] and submits them.
//!
//! A frame draws one sample of each pixel, as the paper's Algorithm 1 does:
//!
//! ```text
//! begin frame    constants, cleared counters; the triangle of each pixel, where primary rays are rasterized
//! each batch     a part of the picture's pixels, whose rays fit in the ray queue
//!   bounce 0 ..  closest hits of the bounce's rays, then the next bounce's rays
//!   light        shadows and shading at the hits of all bounces, then the sum of each pixel
//! end frame      mean of all samples, noise filter, encoding for display
//! ```
//!
//! Each line except `each batch` is one command buffer, and each bounce has one of its own. Where rays can be
//! suspended, a bounce or `light` has two command buffers. A ray is suspended if the driver limits the loop iterations
//! of a kernel and the ray has spent its budget; it goes on in a further dispatch.

mod bands;
mod external;
mod frames;
mod incremental;
mod joined;
mod profile;
mod reconfigure;
mod schedule;

use std::sync::Arc;

use tracing::info_span;

pub use self::{bands::BandedRenderer, incremental::Displayed, joined::JoinedPicture};
use self::{
    incremental::{PendingSample, Recording, Traced, Until},
    schedule::{QueueSizing, Schedule},
};
use crate::{
    buffers::{Needs, Resources},
    frame::{
        Denoise, FrameProperties, FrameRenderer, Integrator, Pass, Picture, Plan, PlanEntry, Primary, Profile,
        RenderOptions, opaque, plan,
    },
    gpu::{Access, AnyBuffer, CommandBuffer, Commands, Context, GpuError},
    layout::{Batch, FalseColor, MATERIAL_REFLECT, MATERIAL_REFRACT, PixelAovs},
    passes::{FramePasses, Inputs, Rasterize},
    scene::Camera,
    world::World,
};

/// A scene on a device, which can be drawn any number of times: sample by sample, from any camera, with any options.
pub struct GpuRenderer {
    context: Arc<Context>,
    world: World,
    camera: Camera,
    /// The options as the caller has set them.
    options: RenderOptions,
    /// The options that are in use ([`in_use`]).
    in_use: RenderOptions,
    budget: QueueSizing,
    resources: Resources,
    passes: FramePasses,
    schedule: Schedule,
    /// Number of samples per pixel of which the picture is the mean.
    n_samples: u32,
    /// Whether the next sample is expected to be slow, as the last one was. The first one is expected to be slow if
    /// the driver runs kernels on the CPU.
    is_slow: bool,
    /// Base-2 logarithm of the number of samples that a frame of paths draws.
    samples_log2: u32,
    /// The AOV that is displayed in place of the picture. Used only if the options ask for AOVs.
    false_color: Option<FalseColor>,
    /// Whether the view needs only the hits of primary rays. Used only if the options ask for AOVs.
    needs_primary_rays_only: bool,
    /// Whether `pixel_accumulated`, to which samples are added, contains the first sample.
    has_sums: bool,
    /// The sample of which only some command buffers have run, if there is one.
    pending: Option<PendingSample>,
    /// The most pixels of a batch, if the caller has set a limit.
    most_pixels: Option<u32>,
    /// The picture in `pixel_display`; None before there is one.
    displayed: Option<Displayed>,
}

impl GpuRenderer {
    /// Uploads the scene and creates the pipelines.
    ///
    /// # Errors
    /// An option is out of its range, the scene or the picture exceeds the device's limits or memory, the device lacks
    /// 64-bit atomics for [`Primary::SoftwareRaster`], or the driver refuses a shader.
    pub fn new(context: Arc<Context>, world: &World, options: &RenderOptions) -> Result<Self, GpuError> {
        options.check()?;
        Self::with_capacity((context, world), options, None, None)
    }

    /// Makes a second renderer of the same scene, for either integrator. Both share the arrays of the scene on the
    /// device.
    ///
    /// # Errors
    /// Fails as [`GpuRenderer::new`] does.
    pub fn sharing(&self, options: &RenderOptions) -> Result<Self, GpuError> {
        let scene = (self.context.clone(), &self.world);
        let mut next = Self::with_capacity(scene, options, self.budget.fixed_capacity, Some(self))?;
        next.set_camera(&self.camera);
        Ok(next)
    }

    /// Does what [`GpuRenderer::new`] does, with a ray queue of `capacity` rays. A frame that makes more rays is split
    /// into batches.
    ///
    /// # Errors
    /// Fails as [`GpuRenderer::new`] does.
    pub fn with_queue_capacity(
        context: Arc<Context>,
        world: &World,
        options: &RenderOptions,
        capacity: u32,
    ) -> Result<Self, GpuError> {
        Self::with_capacity((context, world), options, Some(capacity), None)
    }

    /// `shared`: a renderer of the same world, whose arrays of the scene are taken.
    fn with_capacity(
        (context, world): (Arc<Context>, &World),
        options: &RenderOptions,
        fixed_capacity: Option<u32>,
        shared: Option<&Self>,
    ) -> Result<Self, GpuError> {
        options.check_ranges()?;
        let scene = world.scene();
        let (asked, options) = (options.clone(), &in_use(options));
        let both = MATERIAL_REFLECT | MATERIAL_REFRACT;
        let branches = scene.materials.iter().any(|material| material.flags & both == both);
        let mut constants = world.frame_constants(options);
        constants.n_lanes = lanes_to_share(&context, options)?;
        let of_paths = options.integrator == Integrator::Path;
        check_lights(&context, if of_paths { 0 } else { constants.n_lights })?;
        let budget = QueueSizing { fixed_capacity, branches, of_paths };
        constants.queue_capacity = budget.queue_capacity(context.limits(), context.info(), &constants);
        let spans = budget.spans(&constants, None);
        let schedule = Schedule::new(&context, &constants, spans, options)?;
        let uploading = info_span!("upload scene").entered();
        let needs = Needs { constants: &constants, options, n_bounces: schedule.n_rows() };
        let resources = match shared {
            Some(Self { resources, in_use, .. }) => {
                resources.for_integrator(&context, (world, in_use.traversal), &needs)?
            }
            None => Resources::new(&context, world, &needs)?,
        };
        drop(uploading);
        let passes =
            info_span!("make pipelines").in_scope(|| FramePasses::new(&context, &resources.bindings, options))?;
        let (camera, options, is_slow) = (scene.camera, options.clone(), context.predicates_branches());
        Ok(Self {
            context,
            world: world.clone(),
            camera,
            options: asked,
            in_use: options,
            budget,
            resources,
            passes,
            schedule,
            n_samples: 0,
            is_slow,
            samples_log2: 0,
            false_color: None,
            needs_primary_rays_only: false,
            has_sums: false,
            pending: None,
            most_pixels: None,
            displayed: None,
        })
    }

    /// Draws a new picture with one sample a pixel and downloads it.
    ///
    /// # Errors
    /// A Vulkan call fails, or one pixel alone makes more rays than the queue holds.
    pub fn render(&mut self) -> Result<(Picture, Profile), GpuError> {
        let profile = self.draw()?;
        Ok((self.picture()?, profile))
    }

    /// Draws a new picture with one sample a pixel, at the pixel's centre. The picture stays on the device.
    ///
    /// # Errors
    /// Fails as [`GpuRenderer::render`] does.
    pub fn draw(&mut self) -> Result<Profile, GpuError> {
        self.reset_samples();
        self.draw_sample()
    }

    /// Draws one more sample a pixel; the first is at the pixel's centre. Of paths, as many samples are drawn as
    /// [`FrameRenderer::set_samples_per_frame`] says, at random places. The picture, which stays on the device, is the
    /// mean of all samples. If the ray queue overflows in a batch, the batch is halved and the sample is drawn again.
    /// Later samples keep the smaller batches.
    ///
    /// # Errors
    /// Fails as [`GpuRenderer::render`] does. If the error occurs before the commands of the sample are completely
    /// recorded, the earlier samples are kept. Otherwise the next sample is the first of a new picture.
    pub fn draw_sample(&mut self) -> Result<Profile, GpuError> {
        loop {
            if let Some(profile) = self.go_on(Until::End)? {
                return Ok(profile);
            }
        }
    }

    /// Displays the mean of the samples again, filtered and encoded by the current options, or the AOVs of the
    /// view. Draws no sample. The last sample must be complete, as for [`GpuRenderer::picture`].
    ///
    /// # Errors
    /// A Vulkan call fails.
    pub fn show(&mut self) -> Result<(), GpuError> {
        self.context.run("show", |commands| {
            self.resources.bind(commands);
            self.update_constants(commands);
            self.record_sequence(commands, &plan::display(&self.frame_properties()), &Batch::default());
        })?;
        self.note_displayed();
        Ok(())
    }

    /// Replaces the mean of the samples, and returns the picture of it, filtered and encoded. The next sample is the
    /// first of a new picture.
    ///
    /// # Panics
    /// The mean does not have one value for each pixel of the window.
    ///
    /// # Errors
    /// A copy fails, or a Vulkan call.
    fn picture_of(&mut self, mean: &mut Vec<[f32; 4]>) -> Result<Picture, GpuError> {
        assert_eq!(mean.len(), self.resources.n_pixels(), "pixels of the window");
        self.resources.pixels.pixel_radiance.upload(mean)?;
        self.show()?;
        self.reset_samples();
        match self.in_use.noise_filter() {
            // What is displayed is the mean itself.
            Denoise::Off => {
                let display = self.display()?;
                Ok(self.picture_from(std::mem::take(mean), display))
            }
            _ => self.picture(),
        }
    }

    /// Downloads the picture as it was last drawn or shown. The last sample must be complete: one that was drawn in
    /// part, even if it has been dropped, has overwritten some of the radiance.
    ///
    /// # Errors
    /// A copy fails.
    pub fn picture(&self) -> Result<Picture, GpuError> {
        let _fetching = info_span!("fetch picture").entered();
        let radiance = self.resources.pixels.filtered().download_first(self.resources.n_pixels())?;
        Ok(self.picture_from(radiance, self.display()?))
    }

    /// Downloads what a display shows of the window's pixels.
    fn display(&self) -> Result<Vec<[u8; 4]>, GpuError> {
        let mut display = vec![[0; 4]; self.resources.n_pixels()];
        // The words of the buffer have the red byte first on every host that kdray runs on.
        self.resources.pixels.pixel_display.download_bytes(0, display.as_flattened_mut())?;
        Ok(display)
    }

    /// Returns the picture of the crop, from the radiance and the display of the window's pixels.
    fn picture_from(&self, radiance: Vec<[f32; 4]>, display: Vec<[u8; 4]>) -> Picture {
        let (window, crop) = (self.in_use.window(), self.in_use.crop_or_whole());
        Picture {
            width: crop.width(),
            height: crop.height(),
            radiance: opaque(window.cut(radiance, &crop)),
            display: window.cut(display, &crop),
        }
    }

    /// Downloads what the primary ray of each pixel hits in the last sample, and what all rays of that sample cost.
    ///
    /// # Panics
    /// The options do not ask for AOVs.
    ///
    /// # Errors
    /// A copy fails.
    pub fn pixel_aovs(&self) -> Result<Vec<PixelAovs>, GpuError> {
        assert!(self.in_use.pixel_aovs, "the options ask for AOVs");
        let pixel_aovs = self.resources.pixels.pixel_aovs.download_first(self.resources.n_pixels())?;
        Ok(self.in_use.window().cut(pixel_aovs, &self.in_use.crop_or_whole()))
    }

    /// Returns the frame's buffers, with the contents that the last frame left.
    pub fn resources(&self) -> &Resources {
        &self.resources
    }

    /// Records the plan, in the command buffers that this file's first lines list.
    fn record(&self) -> Result<Vec<Recording>, GpuError> {
        let plan = Plan::new(&self.frame_properties());
        let begin = self.command_buffer("begin frame", |commands| self.begin_frame(commands, &plan.visibility))?;
        let mut frame = vec![Recording::plain(begin)];
        for &batch in &self.schedule.batches {
            // The closest hits of each bounce decide the rays of the next one.
            for (depth, bounce) in (0..).zip(&plan.bounces) {
                let batch = Batch { bounce_ix: batch.bounce_ix + depth, depth, ..batch };
                frame.extend(self.recordings(&format!("bounce {depth}"), bounce, &batch)?);
            }
            // Light is computed for the hits of all bounces together.
            if !plan.light.is_empty() {
                let after_bounces = Batch { depth: plan.bounces.len() as u32, ..batch };
                frame.extend(self.recordings("light", &plan.light, &after_bounces)?);
            }
            frame.last_mut().expect("the recordings of the batch").ends_batch = true;
        }
        let end = self.command_buffer("end frame", |commands| {
            self.resources.bind(commands);
            self.record_sequence(commands, &plan.image, &Batch::default());
        })?;
        frame.push(Recording::plain(end));
        Ok(frame)
    }

    /// Returns the properties of the next sample's frame that decide which passes it has.
    fn frame_properties(&self) -> FrameProperties {
        let only_primary_rays = self.draws_primary_rays_only();
        let constants = self.resources.constants();
        FrameProperties {
            n_bounces: if only_primary_rays { 1 } else { constants.max_depth },
            is_lit: !only_primary_rays,
            adds_samples: constants.n_samples > 1,
            shows_aovs: self.in_use.pixel_aovs && self.false_color.is_some(),
            ..FrameProperties::new(&self.in_use, constants)
        }
    }

    /// Records a sequence of a batch in one command buffer, or in two if rays of the sequence can be suspended: the
    /// host submits the second when all rays of the first have ended.
    fn recordings(&self, name: &str, sequence: &[PlanEntry], batch: &Batch) -> Result<Vec<Recording>, GpuError> {
        let traced = self.traced(sequence, batch).filter(|_| self.resources.accel.suspended_rays.can_occur());
        let Some(traced) = traced else {
            let all = |commands: &Commands| {
                self.resources.bind(commands);
                self.record_sequence(commands, sequence, batch);
            };
            return Ok(vec![Recording::plain(self.command_buffer(name, all)?)]);
        };
        // `trace` ends with the pass that traces the rays, and the barrier after it.
        let is_tracing =
            |entry: &PlanEntry| matches!(entry, PlanEntry::Run(Pass::Trace | Pass::Shadow | Pass::PathTrace));
        let tracing_ix = sequence.iter().position(is_tracing).expect("a pass that traces rays");
        let (trace, rest) = sequence.split_at(tracing_ix + 2);
        let tracing = |commands: &Commands| {
            self.resources.bind(commands);
            self.resources.accel.suspended_rays.reset(commands);
            self.record_sequence(commands, trace, batch);
        };
        let resting = |commands: &Commands| {
            self.resources.bind(commands);
            self.record_sequence(commands, rest, batch);
        };
        Ok(vec![
            Recording::traced(self.command_buffer(name, tracing)?, traced),
            Recording::plain(self.command_buffer(name, resting)?),
        ])
    }

    /// Returns the rays that a sequence traces through the acceleration structure, if it does. A sequence has one such
    /// pass at most.
    fn traced(&self, sequence: &[PlanEntry], batch: &Batch) -> Option<Traced> {
        sequence.iter().find_map(|entry| match entry {
            PlanEntry::Run(pass @ (Pass::Trace | Pass::Shadow | Pass::PathTrace)) => {
                Some(Traced { pass: *pass, batch: *batch })
            }
            _ => None,
        })
    }

    /// Repeats the tracing pass of a recording, whose commands have run once, until none of its rays is suspended.
    fn finish_rays(&self, traced: &Traced) -> Result<(), GpuError> {
        self.resources.accel.suspended_rays.finish(&self.context, |commands, resume_pass| {
            self.resources.bind(commands);
            let batch = Batch { resume_pass: resume_pass.constant(), ..traced.batch };
            self.record_sequence(commands, &[PlanEntry::Run(traced.pass)], &batch);
        })?;
        Ok(())
    }

    fn command_buffer(&self, name: &str, body: impl FnOnce(&Commands)) -> Result<CommandBuffer, GpuError> {
        CommandBuffer::record(&self.context, name, self.schedule.timer.as_ref(), body)
    }

    /// Records the transfers that set the constants and the initial rows of `bounces` and clear the counters, then
    /// the passes of primary visibility.
    fn begin_frame(&self, commands: &Commands, visibility: &[PlanEntry]) {
        commands.reset_timer();
        self.resources.bind(commands);
        self.update_constants(commands);
        copy_all(commands, self.schedule.first_bounces.any(), self.resources.bounces.any());
        self.resources.clear_counters(commands);
        if self.in_use.pixel_aovs {
            commands.clear_buffer(self.resources.pixels.pixel_aovs.any());
        }
        if self.in_use.primary == Primary::SoftwareRaster {
            Rasterize::reset(commands, &self.resources);
        }
        // bounces, counters, pixel_aovs, raster_groups
        commands.barrier(Access::TransferWrite, Access::AnyUse);
        self.record_sequence(commands, visibility, &Batch::default());
    }

    fn update_constants(&self, commands: &Commands) {
        commands.barrier(Access::AnyUse, Access::TransferWrite); // all that the last frame reads: frame, bounces ...
        commands.update_buffer(self.resources.frame.any(), &[*self.resources.constants()]);
        if let (Some(tiles), Some(paths)) = (&self.in_use.noise_tiles, &self.resources.paths) {
            commands.update_buffer(paths.noise_tiles.any(), tiles.words());
        }
        commands.barrier(Access::TransferWrite, Access::AnyUse); // frame, noise_tiles
    }

    fn record_sequence(&self, commands: &Commands, sequence: &[PlanEntry], batch: &Batch) {
        let inputs = Inputs { batch: *batch, false_color: self.false_color };
        self.passes.record_sequence(commands, &self.resources, sequence, &inputs);
    }
}

/// Returns the options that a renderer uses: paths' primary rays are always traced.
fn in_use(options: &RenderOptions) -> RenderOptions {
    let primary = if options.integrator == Integrator::Path { Primary::Trace } else { options.primary };
    RenderOptions { primary, ..options.clone() }
}

/// Checks that a dispatch can have a row of workgroups for each light.
fn check_lights(context: &Context, n_lights: u32) -> Result<(), GpuError> {
    let (value, limit) = (u64::from(n_lights), u64::from(context.limits().n_groups));
    if value <= limit {
        Ok(())
    } else {
        Err(GpuError::Limit { what: "lights of the integrator whitted", value, limit })
    }
}

/// Returns the number of lanes to share among the rays of a dispatch. 0 means that each ray gets one lane, and is
/// returned if the options ask for AOVs, which contain the costs of rays.
fn lanes_to_share(context: &Arc<Context>, options: &RenderOptions) -> Result<u32, GpuError> {
    if options.pixel_aovs { Ok(0) } else { context.n_lanes() }
}

fn copy_all(commands: &Commands, source: &Arc<AnyBuffer>, destination: &Arc<AnyBuffer>) {
    commands.copy_buffer(source, destination, source.bytes());
}
