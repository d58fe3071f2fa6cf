//! GPU times of passes by timestamp queries.

use std::{cell::RefCell, sync::Arc};

use ash::vk;

use super::{Context, GpuError};

/// A row of the profile: when a pass began and ended, in milliseconds since the frame's first pass began.
#[derive(Clone, Debug, PartialEq)]
pub struct TimerRow {
    pub name: &'static str,
    /// The bounce that the pass belongs to, if any.
    pub bounce: Option<u32>,
    /// None where the device's queue has no timestamps.
    pub span_ms: Option<(f64, f64)>,
}

/// Timestamps of up to `capacity` passes a frame.
pub struct Timer {
    pool: vk::QueryPool,
    capacity: u32,
    rows: RefCell<Vec<(&'static str, Option<u32>)>>,
    context: Arc<Context>,
}

impl Timer {
    /// # Errors
    /// Out of memory.
    pub fn new(context: &Arc<Context>, capacity: u32) -> Result<Self, GpuError> {
        let info = vk::QueryPoolCreateInfo::default()
            .query_type(vk::QueryType::TIMESTAMP)
            .query_count(Self::n_queries(capacity));
        // SAFETY: a plain creation.
        let pool = unsafe { context.device.create_query_pool(&info, None) }
            .map_err(GpuError::call("vkCreateQueryPool", "timer"))?;
        context.set_name(pool, "timer");
        Ok(Self { pool, capacity, rows: RefCell::default(), context: context.clone() })
    }

    /// Begin, end and two dummies a pass (see [`Timer::write`]).
    fn n_queries(capacity: u32) -> u32 {
        4 * capacity
    }

    /// Passes it has room for.
    pub fn capacity(&self) -> u32 {
        self.capacity
    }

    /// Forgets all rows; to be recorded before the frame's first pass.
    pub(super) fn reset(&self, commands: vk::CommandBuffer) {
        self.rows.borrow_mut().clear();
        // SAFETY: the commands are being recorded, outside rendering.
        unsafe { self.context.device.cmd_reset_query_pool(commands, self.pool, 0, Self::n_queries(self.capacity)) };
    }

    /// Opens the next row and returns its number.
    pub(super) fn begin(&self, commands: vk::CommandBuffer, name: &'static str, bounce: Option<u32>) -> u32 {
        let row = self.rows.borrow().len() as u32;
        assert!(row < self.capacity, "the timer has room for {} passes", self.capacity);
        self.rows.borrow_mut().push((name, bounce));
        self.write(commands, 4 * row);
        row
    }

    pub(super) fn end(&self, commands: vk::CommandBuffer, row: u32) {
        self.write(commands, 4 * row + 2);
    }

    /// Written twice: on Mesa 22.3's lavapipe a compute timestamp holds the one before it once any render pass has
    /// run; the second write, to a dummy, pushes the first one into its place.
    fn write(&self, commands: vk::CommandBuffer, query: u32) {
        if self.context.timestamp_valid_bits == 0 {
            return;
        }
        let stage = vk::PipelineStageFlags2::BOTTOM_OF_PIPE;
        for query in [query, query + 1] {
            // SAFETY: the commands are being recorded; the query was reset at the frame's start.
            unsafe { self.context.device.cmd_write_timestamp2(commands, stage, self.pool, query) };
        }
    }

    /// The frame's rows in the order of recording; the device must have ended the frame.
    pub fn rows(&self) -> Result<Vec<TimerRow>, GpuError> {
        let rows = self.rows.borrow();
        let ticks = self.ticks(rows.len())?;
        let start = ticks.iter().map(|(begin, _)| *begin).min().unwrap_or(0);
        let ms = |tick: u64| tick.saturating_sub(start) as f64 * f64::from(self.context.timestamp_period_ns) * 1e-6;
        Ok(rows
            .iter()
            .enumerate()
            .map(|(i, &(name, bounce))| TimerRow {
                name,
                bounce,
                span_ms: ticks.get(i).map(|&(begin, end)| (ms(begin), ms(end))),
            })
            .collect())
    }

    /// Begin and end of each row; none where there are no timestamps.
    fn ticks(&self, n_rows: usize) -> Result<Vec<(u64, u64)>, GpuError> {
        let bits = self.context.timestamp_valid_bits;
        if bits == 0 || n_rows == 0 {
            return Ok(Vec::new());
        }
        let mask = u64::MAX >> (64 - bits);
        let mut raw = vec![0u64; 4 * n_rows];
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: the first 4 * n_rows queries were written by the frame that has ended.
        unsafe { self.context.device.get_query_pool_results(self.pool, 0, &mut raw, flags) }
            .map_err(GpuError::call("vkGetQueryPoolResults", "timer"))?;
        Ok(raw.chunks_exact(4).map(|row| (row[0] & mask, row[2] & mask)).collect())
    }
}

impl Drop for Timer {
    fn drop(&mut self) {
        // SAFETY: the device has ended all work with it.
        unsafe { self.context.device.destroy_query_pool(self.pool, None) };
    }
}
