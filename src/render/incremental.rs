//! Draws a sample step by step, so that the caller can do something else in between.
//!
//! A recording is a command buffer of the frame. A batch has several recordings: one or two for each bounce, and for
//! the light. A sample is pending while some of its recordings have run and others have not.

use std::{collections::VecDeque, mem, time::Instant};

use glam::UVec2;
use tracing::info_span;

use super::{GpuRenderer, schedule::Schedule};
use crate::{
    buffers::Needs,
    frame::{FrameRenderer, Integrator, Pass, Picture, Profile, View},
    gpu::{CommandBuffer, GpuError},
    layout::{Batch, FalseColor, Frame, PixelAovs, constants},
    passes::FramePasses,
    scene::Camera,
};

/// A command buffer of a frame.
pub(super) struct Recording {
    commands: CommandBuffer,
    /// The recording's rays that can be suspended, if there are any. All of them must end before the next recording
    /// begins.
    traced: Option<Traced>,
    /// Whether it is the last recording of its batch.
    pub ends_batch: bool,
}

/// Rays that a recording traces through the acceleration structure: those of a pass, in a batch.
pub(super) struct Traced {
    pub pass: Pass,
    pub batch: Batch,
}

impl Recording {
    /// Creates a recording without rays that can be suspended.
    pub fn plain(commands: CommandBuffer) -> Self {
        Self { commands, traced: None, ends_batch: false }
    }

    /// Creates a recording whose rays can be suspended.
    pub fn traced(commands: CommandBuffer, traced: Traced) -> Self {
        Self { commands, traced: Some(traced), ends_batch: false }
    }
}

/// The point up to which a sample is drawn.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Until {
    /// The end of the next recording.
    Recording,
    /// The end of the batch that has begun or is next, or the frame's end if that is the last batch.
    Batch,
    /// The frame's end.
    End,
}

/// A sample of which some recordings have run and others have not. The device has finished the recordings that were
/// submitted.
pub(super) struct PendingSample {
    /// The recordings that have not run.
    recordings: VecDeque<Recording>,
    /// Number of recordings that have run.
    n_done: usize,
    sample_ix: u32,
    /// When its first commands were submitted; None before.
    begun_at: Option<Instant>,
}

impl PendingSample {
    /// Takes the recordings that are to run until the sample is drawn up to `until`.
    fn take(&mut self, until: Until) -> Vec<Recording> {
        let ends_batch = |recording: &Recording| recording.ends_batch;
        let n_taken = match until {
            Until::Recording => 1,
            Until::Batch if self.recordings.iter().filter(|recording| recording.ends_batch).count() > 1 => {
                self.recordings.iter().position(ends_batch).map_or(0, |place| place + 1)
            }
            Until::Batch | Until::End => self.recordings.len(),
        };
        self.n_done += n_taken;
        self.recordings.drain(..n_taken).collect()
    }
}

/// The picture that is displayed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Displayed {
    /// Width and height, pixels.
    pub size: (u32, u32),
    /// The camera that it was drawn from.
    pub camera: Camera,
}

impl GpuRenderer {
    /// Draws one batch of the pending sample, or of the next sample if none is pending. Returns the whole sample's
    /// profile after its last batch, and None before that. Only the last batch changes the displayed picture. The
    /// pending sample is dropped when a new picture begins.
    ///
    /// # Errors
    /// Fails as [`GpuRenderer::draw_sample`] does.
    pub fn draw_batch(&mut self) -> Result<Option<Profile>, GpuError> {
        self.go_on(Until::Batch)
    }

    /// Draws one recording of the pending sample, or of the next sample if none is pending: mostly a bounce or the
    /// light of a batch. Returns the whole sample's profile after its last recording, and None before that. Only the
    /// last recording changes the displayed picture.
    ///
    /// # Errors
    /// Fails as [`GpuRenderer::draw_sample`] does.
    pub fn draw_next(&mut self) -> Result<Option<Profile>, GpuError> {
        self.go_on(Until::Recording)
    }

    /// Whether a sample consists of the hits of primary rays only, without light.
    pub(super) fn draws_primary_rays_only(&self) -> bool {
        self.in_use.pixel_aovs && self.needs_primary_rays_only
    }

    /// Whether a sample is pending.
    pub fn is_pending(&self) -> bool {
        self.pending.is_some()
    }

    /// Share of the pending sample's recordings that have run, 0 to 1; 0 if no sample is pending.
    pub fn progress(&self) -> f32 {
        let share =
            |pending: &PendingSample| pending.n_done as f32 / (pending.n_done + pending.recordings.len()) as f32;
        self.pending.as_ref().map_or(0.0, share)
    }

    /// Limits batches to `most_pixels` pixels or, with None, only to what the queue holds. The picture does not
    /// depend on this. A pending sample is dropped. The next call that draws starts it again.
    ///
    /// # Errors
    /// Out of memory. Then nothing has changed, and a pending sample stays pending.
    pub fn limit_batches(&mut self, most_pixels: Option<u32>) -> Result<(), GpuError> {
        if self.most_pixels == most_pixels {
            return Ok(());
        }
        let spans = self.budget.spans(self.resources.constants(), most_pixels);
        self.reschedule(spans)?;
        self.most_pixels = most_pixels;
        Ok(())
    }

    /// Returns the limit that [`GpuRenderer::limit_batches`] has set.
    pub fn most_pixels(&self) -> Option<u32> {
        self.most_pixels
    }

    /// Replaces the batches by those of `spans`, and drops a pending sample.
    fn reschedule(&mut self, spans: Vec<(u32, u32)>) -> Result<(), GpuError> {
        let schedule = Schedule::new(&self.context, self.resources.constants(), spans, &self.in_use)?;
        let resources = self.resources.with_bounces(&self.context, schedule.n_rows())?;
        self.pending = None;
        (self.resources, self.schedule) = (resources, schedule);
        Ok(())
    }

    /// Runs the next recordings of the pending sample, or of the next sample if none is pending. Returns the sample's
    /// profile when all recordings have run, and None while recordings are left. If the ray queue has overflowed, the
    /// whole sample is drawn again, in smaller batches, before the call returns.
    pub(super) fn go_on(&mut self, until: Until) -> Result<Option<Profile>, GpuError> {
        // If the sample cannot begin, the complete samples are kept. An error after that drops them.
        let pending = self.pending.take().map_or_else(|| self.begin_sample(), Ok)?;
        let gone_on = self.try_to_go_on(pending, until);
        if gone_on.is_err() {
            self.reset_samples();
        }
        gone_on
    }

    fn try_to_go_on(&mut self, mut pending: PendingSample, until: Until) -> Result<Option<Profile>, GpuError> {
        let running = info_span!("submit and wait").entered();
        let begun_at = *pending.begun_at.get_or_insert_with(Instant::now);
        self.run_recordings(pending.take(until))?;
        drop(running);
        if !pending.recordings.is_empty() {
            self.pending = Some(pending);
            return Ok(None);
        }
        let _fetching = info_span!("fetch counts").entered();
        let bounces = self.resources.bounces.download()?;
        if bounces.iter().any(|row| row.overflow != 0) {
            // The sample is drawn again without a return to the caller, since `pixel_display` now holds a picture
            // that lacks the rays for which there was no room.
            let spans = self.schedule.split(&bounces, self.resources.constants())?;
            self.reschedule(spans)?;
            let pending = self.recorded(pending.sample_ix)?;
            return self.try_to_go_on(pending, Until::End);
        }
        self.n_samples = self.resources.constants().n_samples;
        self.note_displayed();
        self.profile(&bounces, begun_at).map(Some)
    }

    /// Runs recordings and waits for their end. They are submitted together, except that a recording whose rays can be
    /// suspended ends a submission, since its rays must end before the next recording begins.
    fn run_recordings(&self, recordings: Vec<Recording>) -> Result<(), GpuError> {
        let mut together = Vec::new();
        for Recording { commands, traced, .. } in recordings {
            together.push(commands);
            if let Some(traced) = traced {
                self.context.wait_for(self.context.submit(mem::take(&mut together))?)?;
                self.finish_rays(&traced)?;
            }
        }
        if together.is_empty() { Ok(()) } else { self.context.wait_for(self.context.submit(together)?) }
    }

    fn begin_sample(&mut self) -> Result<PendingSample, GpuError> {
        let sample_ix = self.n_samples;
        match self.in_use.integrator {
            Integrator::Path => self.begin_paths()?,
            // If the second sample was dropped and is drawn again, the sums contain the first sample already.
            Integrator::Whitted if sample_ix == 1 && !self.has_sums => {
                self.resources.begin_sums(&self.context)?;
                self.has_sums = true;
            }
            Integrator::Whitted => (),
        }
        let mut constants = *self.resources.constants();
        constants.set_view(&self.camera, self.world.bounds(), sample_ix);
        if constants.is_orthographic != self.resources.constants().is_orthographic {
            self.make_kernels_for(&constants)?;
        }
        self.resources.set_constants(&constants);
        self.recorded(sample_ix)
    }

    /// Prepares a frame of paths: batches for its number of samples, and room for the sums of the samples.
    fn begin_paths(&mut self) -> Result<(), GpuError> {
        let samples_log2 = if self.draws_primary_rays_only() { 0 } else { self.samples_log2 };
        if self.resources.constants().samples_log2 != samples_log2 {
            let constants = Frame { samples_log2, ..*self.resources.constants() };
            let wanted = self.budget.queue_capacity(self.context.limits(), self.context.info(), &constants);
            let queue_capacity = wanted.max(constants.queue_capacity);
            let constants = Frame { queue_capacity, ..constants };
            let spans = self.budget.spans(&constants, self.most_pixels);
            let schedule = Schedule::new(&self.context, &constants, spans, &self.in_use)?;
            let needs = Needs { constants: &constants, options: &self.in_use, n_bounces: schedule.n_rows() };
            let resources = self.resources.for_frame(&self.context, None, &needs)?;
            (self.resources, self.schedule) = (resources, schedule);
        }
        // There is one sum for each bit of the number of samples. Those of the lowest bits become one with the frame's.
        let n_joined = (self.n_samples >> samples_log2).trailing_ones();
        self.resources.make_room_for_sums(&self.context, self.n_samples.count_ones() - n_joined + 1)
    }

    /// Replaces all kernels, which are made for one kind of camera, by those for the camera of `constants`.
    fn make_kernels_for(&mut self, constants: &Frame) -> Result<(), GpuError> {
        let is_orthographic = constants.is_orthographic == 1;
        let bindings = self.resources.bindings.with_constant(constants::ORTHOGRAPHIC, is_orthographic);
        self.passes = FramePasses::new(&self.context, &bindings, &self.in_use)?;
        self.resources.bindings = bindings;
        Ok(())
    }

    fn recorded(&self, sample_ix: u32) -> Result<PendingSample, GpuError> {
        let recordings = info_span!("record").in_scope(|| self.record())?;
        Ok(PendingSample { recordings: recordings.into(), n_done: 0, sample_ix, begun_at: None })
    }

    /// Sets the view that the next sample and [`GpuRenderer::show`] display: the picture, or an AOV in its place. An
    /// AOV is displayed only if the options ask for AOVs. `brightest`: in views of costs and of numbers of
    /// rays, the value that is displayed brightest; in the view of depth, the depth that is half as bright as
    /// depth 0.
    ///
    /// Returns whether the view or `brightest` has changed. A change drops a pending sample. Samples of a view that
    /// needs primary rays only have no radiance. So a change from such a view to one that needs all rays, or back,
    /// also drops the complete samples: the next sample is the first of a new picture.
    pub fn set_view(&mut self, view: View, brightest: f32) -> bool {
        let false_color = view.constant().map(|view| FalseColor { view, brightest });
        let is_new = false_color != self.false_color;
        if is_new {
            self.pending = None;
            self.false_color = false_color;
        }
        if self.needs_primary_rays_only != view.needs_primary_rays_only() {
            self.needs_primary_rays_only = view.needs_primary_rays_only();
            self.reset_samples();
        }
        is_new
    }

    /// Returns the size and the camera of the displayed picture, or None before there is one. While a sample is
    /// pending, the displayed picture is the one before it.
    pub fn displayed(&self) -> Option<Displayed> {
        self.displayed
    }

    /// Returns the pixels of the picture that [`GpuRenderer::displayed`] describes, on the device, and its size; none
    /// before there is one. Later samples overwrite them.
    #[cfg(feature = "view")]
    pub fn displayed_pixels(&self) -> Option<(&crate::gpu::Buffer<u32>, (u32, u32))> {
        self.displayed.map(|displayed| (&self.resources.pixels.pixel_display, displayed.size))
    }

    /// Downloads the picture that [`GpuRenderer::displayed`] describes, or returns None before there is one. Its
    /// radiance is empty, since a pending sample may have overwritten it. The picture must have no crop.
    ///
    /// # Errors
    /// A copy fails.
    pub fn displayed_picture(&self) -> Result<Option<Picture>, GpuError> {
        let Some(Displayed { size: (width, height), .. }) = self.displayed else { return Ok(None) };
        let display = self.resources.pixels.pixel_display.download_first(width as usize * height as usize)?;
        let display = display.into_iter().map(u32::to_le_bytes).collect();
        Ok(Some(Picture { width, height, radiance: Vec::new(), display }))
    }

    /// Downloads what the primary ray of a pixel hit in the last sample, and what the pixel's rays cost. Returns None
    /// if the options do not ask for AOVs, or while a sample is drawn step by step.
    ///
    /// # Panics
    /// The picture does not have the pixel.
    ///
    /// # Errors
    /// The copy fails.
    pub fn aovs_at(&self, pixel: UVec2) -> Result<Option<PixelAovs>, GpuError> {
        if !self.in_use.pixel_aovs || self.pending.is_some() || self.n_samples == 0 {
            return Ok(None);
        }
        let Frame { width, height, .. } = *self.resources.constants();
        assert!(pixel.x < width && pixel.y < height, "a pixel of the picture");
        let pixel_ix = pixel.y as usize * width as usize + pixel.x as usize;
        Ok(self.resources.pixels.pixel_aovs.download_range(pixel_ix, 1)?.first().copied())
    }

    /// Notes that `pixel_display` holds a complete picture.
    pub(super) fn note_displayed(&mut self) {
        let Frame { width, height, .. } = *self.resources.constants();
        self.displayed = Some(Displayed { size: (width, height), camera: self.camera });
    }
}
