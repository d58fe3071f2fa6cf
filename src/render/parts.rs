//! A sample in parts, for those who have to do something else meanwhile.

use std::time::Instant;

use tracing::info_span;

use super::{Renderer, schedule::Schedule};
use crate::{
    frame::{Profile, View},
    gpu::{CommandBuffer, GpuError},
    layout::{FalseColor, Frame},
};

/// A sample that is drawn in part; nothing of it is under way.
pub(super) struct Pending {
    commands: Vec<CommandBuffer>,
    /// How many of the commands have run.
    n_done: usize,
    sample_ix: u32,
    /// When its first commands were submitted.
    begun_at: Option<Instant>,
}

impl Renderer {
    /// Draws one batch of the sample that is begun, or of the next one; gives the whole sample's profile with its last
    /// batch. The picture changes with the last one only. Whatever begins a new picture drops what is begun.
    ///
    /// # Errors
    /// As [`Renderer::draw_sample`].
    pub fn draw_part(&mut self) -> Result<Option<Profile>, GpuError> {
        let a_batch = self.options.max_depth as usize + 1; // its bounces and their light
        let (n_done, n_all) = match &self.pending {
            Some(pending) => (pending.n_done, pending.commands.len()),
            None => (0, 2 + a_batch * self.schedule.batches.len()),
        };
        // What begins the frame goes with the first batch, what ends it with the last one.
        let with_first = if n_done == 0 { a_batch + 1 } else { a_batch };
        let is_last = n_done + with_first + 1 >= n_all;
        self.go_on(if is_last { with_first + 1 } else { with_first })
    }

    /// Whether a sample is begun.
    pub fn is_pending(&self) -> bool {
        self.pending.is_some()
    }

    /// Share of the next sample that is drawn, 0 to 1.
    pub fn progress(&self) -> f32 {
        self.pending.as_ref().map_or(0.0, |pending| pending.n_done as f32 / pending.commands.len() as f32)
    }

    /// Batches have so many pixels at the most from now on, or as many as the queues hold. The picture does not depend on
    /// it. A sample that is begun is begun anew.
    ///
    /// # Errors
    /// Out of memory.
    pub fn limit_batches(&mut self, most_pixels: Option<u32>) -> Result<(), GpuError> {
        if self.most_pixels == most_pixels {
            return Ok(());
        }
        self.most_pixels = most_pixels;
        let spans = self.room.spans(self.resources.constants(), most_pixels);
        self.reschedule(spans)
    }

    /// What `limit_batches` was told last.
    pub fn most_pixels(&self) -> Option<u32> {
        self.most_pixels
    }

    fn reschedule(&mut self, spans: Vec<(u32, u32)>) -> Result<(), GpuError> {
        self.pending = None;
        let timed = self.options.profile;
        let schedule = Schedule::new(&self.context, self.resources.constants(), spans, timed)?;
        self.resources.resize_bounces(&self.context, schedule.n_rows())?;
        self.schedule = schedule;
        Ok(())
    }

    /// Runs so many command buffers more of the sample, as far as there are; gives its profile when all have run without
    /// an overflow. None: there is more to do.
    pub(super) fn go_on(&mut self, n_buffers: usize) -> Result<Option<Profile>, GpuError> {
        let gone_on = self.try_to_go_on(n_buffers);
        if gone_on.is_err() {
            self.reset_samples();
        }
        gone_on
    }

    fn try_to_go_on(&mut self, n_buffers: usize) -> Result<Option<Profile>, GpuError> {
        let mut pending = match self.pending.take() {
            Some(pending) => pending,
            None => self.begin_sample()?,
        };
        let rest = &pending.commands[pending.n_done..];
        let now = &rest[..n_buffers.min(rest.len())];
        let running = info_span!("submit and wait").entered();
        let begun_at = *pending.begun_at.get_or_insert_with(Instant::now);
        self.context.submit(&now.iter().collect::<Vec<_>>())?;
        self.context.wait()?;
        drop(running);
        pending.n_done += now.len();
        if pending.n_done < pending.commands.len() {
            self.pending = Some(pending);
            return Ok(None);
        }
        let _fetching = info_span!("fetch counts").entered();
        let bounces = self.resources.bounces.download()?;
        if bounces.iter().any(|row| row.overflow != 0) {
            // At once and whole: pixel_display shows a picture without the rays that had no room.
            let spans = self.schedule.split(&bounces, self.resources.constants())?;
            pending.commands.clear();
            self.reschedule(spans)?;
            self.pending = Some(self.recorded(pending.sample_ix)?);
            return self.try_to_go_on(usize::MAX);
        }
        self.n_samples = pending.sample_ix + 1;
        self.note_displayed();
        self.profile(&bounces, begun_at).map(Some)
    }

    fn begin_sample(&mut self) -> Result<Pending, GpuError> {
        let sample_ix = self.n_samples;
        // A second sample that is begun anew finds them begun.
        if sample_ix == 1 && !self.has_sums {
            self.resources.begin_sums(&self.context)?;
            self.has_sums = true;
        }
        let mut constants = *self.resources.constants();
        constants.set_view(&self.camera, sample_ix);
        self.resources.set_constants(&constants);
        self.recorded(sample_ix)
    }

    fn recorded(&self, sample_ix: u32) -> Result<Pending, GpuError> {
        let commands = info_span!("record").in_scope(|| self.record())?;
        Ok(Pending { commands, n_done: 0, sample_ix, begun_at: None })
    }

    /// Displays one of the features in place of the picture, from the next sample on; only where the options ask for
    /// features. `brightest`: the value that is brightest, for cost and rays, or half as bright, for depth. True where
    /// that is new; a sample that is begun is begun anew then.
    pub fn set_view(&mut self, view: View, brightest: f32) -> bool {
        let false_color = view.constant().map(|view| FalseColor { view, brightest });
        let is_new = false_color != self.false_color;
        if is_new {
            self.pending = None;
            self.false_color = false_color;
        }
        is_new
    }

    /// Width and height of what pixel_display holds; none before there is a picture.
    pub fn displayed(&self) -> Option<(u32, u32)> {
        self.displayed
    }

    /// The picture is complete.
    pub(super) fn note_displayed(&mut self) {
        let Frame { width, height, .. } = *self.resources.constants();
        self.displayed = Some((width, height));
    }
}
