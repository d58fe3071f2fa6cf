//! A sample in parts, for those who have to do something else meanwhile.

use std::time::Instant;

use tracing::info_span;

use super::{Renderer, schedule::Schedule};
use crate::{
    frame::{Picture, Profile, View},
    gpu::{CommandBuffer, GpuError},
    layout::{Batch, FalseColor, Frame},
    scene::Camera,
};

/// A command buffer of a frame.
pub(super) struct Part {
    commands: CommandBuffer,
    /// Rays that can stall in it: they have to end before the next step.
    traced: Option<Traced>,
    /// Whether it is the last one of its batch.
    pub ends_batch: bool,
}

/// Rays that a step takes through the tree.
pub(super) enum Traced {
    /// Those of a bounce.
    Rays(Batch),
    /// The shadow segments of all rays of a batch.
    Shadows(Batch),
}

impl Part {
    /// One without rays that can stall.
    pub fn plain(commands: CommandBuffer) -> Self {
        Self { commands, traced: None, ends_batch: false }
    }

    /// One whose rays can stall.
    pub fn traced(commands: CommandBuffer, traced: Traced) -> Self {
        Self { commands, traced: Some(traced), ends_batch: false }
    }
}

/// How far a sample is to go on.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Until {
    /// To the end of the next step.
    Step,
    /// To the end of the batch that is next, and with the last batch to the frame's end.
    Batch,
    /// To the frame's end.
    End,
}

/// A sample that is drawn in part; nothing of it is under way.
pub(super) struct Pending {
    parts: Vec<Part>,
    /// How many of the parts have run.
    n_done: usize,
    sample_ix: u32,
    /// When its first commands were submitted.
    begun_at: Option<Instant>,
}

impl Pending {
    /// The number of parts that have run when the sample has gone on so far.
    fn end(&self, until: Until) -> usize {
        if until == Until::Step {
            return self.n_done + 1;
        }
        let ends_batch = |part: &Part| part.ends_batch;
        let batch_end = self.parts[self.n_done..].iter().position(ends_batch).map(|place| self.n_done + place + 1);
        match batch_end {
            Some(end) if until == Until::Batch && self.parts[end..].iter().any(ends_batch) => end,
            _ => self.parts.len(),
        }
    }
}

/// The picture that is displayed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Displayed {
    /// Pixels.
    pub size: (u32, u32),
    /// Where it is seen from.
    pub camera: Camera,
}

impl Renderer {
    /// Draws one batch of the sample that is begun, or of the next one; gives the whole sample's profile with its last
    /// batch. The picture changes with the last one only. Whatever begins a new picture drops what is begun.
    ///
    /// # Errors
    /// As [`Renderer::draw_sample`].
    pub fn draw_part(&mut self) -> Result<Option<Profile>, GpuError> {
        self.go_on(Until::Batch)
    }

    /// Draws one step of the sample that is begun, or of the next one: a bounce of a batch, or its light. Gives
    /// the whole sample's profile with its last one. The picture changes with the last one only.
    ///
    /// # Errors
    /// As [`Renderer::draw_sample`].
    pub fn draw_step(&mut self) -> Result<Option<Profile>, GpuError> {
        self.go_on(Until::Step)
    }

    /// Whether nothing but the hits of primary rays is drawn.
    pub(super) fn draws_primary_rays_only(&self) -> bool {
        self.options.features && self.needs_primary_rays_only
    }

    /// Whether a sample is begun.
    pub fn is_pending(&self) -> bool {
        self.pending.is_some()
    }

    /// Share of the next sample that is drawn, 0 to 1.
    pub fn progress(&self) -> f32 {
        self.pending.as_ref().map_or(0.0, |pending| pending.n_done as f32 / pending.parts.len() as f32)
    }

    /// Batches have so many pixels at the most from now on, or as many as the queues hold. The picture does not depend on
    /// it. A sample that is begun is begun anew.
    ///
    /// # Errors
    /// Out of memory; then nothing has changed, and a sample that is begun goes on.
    pub fn limit_batches(&mut self, most_pixels: Option<u32>) -> Result<(), GpuError> {
        if self.most_pixels == most_pixels {
            return Ok(());
        }
        let spans = self.budget.spans(self.resources.constants(), most_pixels);
        self.reschedule(spans)?;
        self.most_pixels = most_pixels;
        Ok(())
    }

    /// What `limit_batches` was told last.
    pub fn most_pixels(&self) -> Option<u32> {
        self.most_pixels
    }

    fn reschedule(&mut self, spans: Vec<(u32, u32)>) -> Result<(), GpuError> {
        let schedule = Schedule::new(&self.context, self.resources.constants(), spans, &self.options)?;
        let resources = self.resources.with_bounces(&self.context, schedule.n_rows())?;
        self.pending = None;
        (self.resources, self.schedule) = (resources, schedule);
        Ok(())
    }

    /// Runs the sample's next parts; gives its profile when all have run without an overflow. None: there is more to do.
    pub(super) fn go_on(&mut self, until: Until) -> Result<Option<Profile>, GpuError> {
        // Where no sample can begin, those that are complete stay.
        let pending = self.pending.take().map_or_else(|| self.begin_sample(), Ok)?;
        let gone_on = self.try_to_go_on(pending, until);
        if gone_on.is_err() {
            self.reset_samples();
        }
        gone_on
    }

    fn try_to_go_on(&mut self, mut pending: Pending, until: Until) -> Result<Option<Profile>, GpuError> {
        let running = info_span!("submit and wait").entered();
        let begun_at = *pending.begun_at.get_or_insert_with(Instant::now);
        let end = pending.end(until);
        self.run_parts(&pending.parts[pending.n_done..end])?;
        drop(running);
        pending.n_done = end;
        if end < pending.parts.len() {
            self.pending = Some(pending);
            return Ok(None);
        }
        let _fetching = info_span!("fetch counts").entered();
        let bounces = self.resources.bounces.download()?;
        if bounces.iter().any(|row| row.overflow != 0) {
            // At once and whole: pixel_display shows a picture without the rays that had no room.
            let spans = self.schedule.split(&bounces, self.resources.constants())?;
            pending.parts.clear();
            self.reschedule(spans)?;
            let pending = self.recorded(pending.sample_ix)?;
            return self.try_to_go_on(pending, Until::End);
        }
        self.n_samples = pending.sample_ix + 1;
        self.note_displayed();
        self.profile(&bounces, begun_at).map(Some)
    }

    /// Runs parts and waits for their end: all together, but for rays that can stall, which have to end before the next
    /// step begins.
    fn run_parts(&self, parts: &[Part]) -> Result<(), GpuError> {
        for together in parts.split_inclusive(|part| part.traced.is_some()) {
            self.context.submit(&together.iter().map(|part| &part.commands).collect::<Vec<_>>())?;
            self.context.wait()?;
            if let Some(traced) = together.last().and_then(|part| part.traced.as_ref()) {
                self.finish_rays(traced)?;
            }
        }
        Ok(())
    }

    fn begin_sample(&mut self) -> Result<Pending, GpuError> {
        let sample_ix = self.n_samples;
        // A second sample that is begun anew finds them begun.
        if sample_ix == 1 && !self.has_sums {
            self.resources.begin_sums(&self.context)?;
            self.has_sums = true;
        }
        let mut constants = *self.resources.constants();
        constants.set_view(&self.camera, self.world.bounds(), sample_ix);
        self.resources.set_constants(&constants);
        self.recorded(sample_ix)
    }

    fn recorded(&self, sample_ix: u32) -> Result<Pending, GpuError> {
        let parts = info_span!("record").in_scope(|| self.record())?;
        Ok(Pending { parts, n_done: 0, sample_ix, begun_at: None })
    }

    /// Displays one of the features in place of the picture, from the next sample on; only where the options ask for
    /// features. `brightest`: the value that is brightest, for cost and rays, or half as bright, for depth. True where
    /// that is new; a sample that is begun is begun anew then. Samples for a view that needs primary rays only have no
    /// radiance: where that changes, the next sample is the first of a new picture.
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

    /// The picture that is displayed, while another one may be drawn; none before there is a picture.
    pub fn displayed(&self) -> Option<Displayed> {
        self.displayed
    }

    /// The picture that is displayed, as large as it is there, while another one may be drawn; none before there is one. It
    /// has no radiance, which the sample that is being drawn may have changed. Only for pictures without a crop.
    ///
    /// # Errors
    /// A failed copy.
    pub fn displayed_picture(&self) -> Result<Option<Picture>, GpuError> {
        let Some(Displayed { size: (width, height), .. }) = self.displayed else { return Ok(None) };
        let display = self.resources.pixels.pixel_display.download_first(width as usize * height as usize)?;
        let display = display.into_iter().map(u32::to_le_bytes).collect();
        Ok(Some(Picture { width, height, radiance: Vec::new(), display }))
    }

    /// The picture is complete.
    pub(super) fn note_displayed(&mut self) {
        let Frame { width, height, .. } = *self.resources.constants();
        self.displayed = Some(Displayed { size: (width, height), camera: self.camera });
    }
}
