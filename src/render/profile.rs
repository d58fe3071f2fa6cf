//! The profile of a frame: times and counts of its passes.

use std::time::Instant;

use super::GpuRenderer;
use crate::{
    frame::{
        PassTime, Profile,
        counts::{count_batches, device_counts, sum_of_batches},
    },
    gpu::{GpuError, TimerRow},
    layout::Bounce,
};

impl GpuRenderer {
    /// Returns the profile of the last frame, which began at `begun_at`. The profile is empty if the options do not
    /// ask for one. `bounces`: the rows that the frame has left in the buffer.
    ///
    /// # Errors
    /// A copy fails.
    pub(super) fn profile(&self, bounces: &[Bounce], begun_at: Instant) -> Result<Profile, GpuError> {
        let Some(timer) = &self.schedule.timer else { return Ok(Profile::default()) };
        let rows = timer.rows()?;
        let max_depth = self.resources.constants().max_depth;
        let counts = device_counts(bounces, &self.resources.counters()?);
        let ends_ms = rows.iter().map(|row| row.span_ms.map(|(_, end)| end));
        let pass = |row: &TimerRow| PassTime {
            name: row.name,
            bounce: row.number,
            start_ms: row.span_ms.map(|(begin, _)| begin),
            ms: row.span_ms.map(|(begin, end)| end - begin),
            ..PassTime::default()
        };
        let mut passes: Vec<_> = rows.iter().map(pass).collect();
        count_batches(&mut passes, &counts, max_depth);
        let mut bounces = sum_of_batches(&counts, max_depth);
        // Most bounces that blended surfaces add have no rays.
        while bounces.len() > self.in_use.n_bounces() as usize && bounces.last().is_some_and(|row| row.n_rays == 0) {
            bounces.pop();
        }
        Ok(Profile {
            device: self.context.info().name.clone(),
            n_batches: self.schedule.batches.len() as u32,
            bounces,
            frame_ms: ends_ms.max_by(|a, b| a.partial_cmp(b).expect("no NaN")).flatten(),
            passes,
            begun_at: Some(begun_at),
        })
    }
}
