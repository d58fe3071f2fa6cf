//! GPU times of passes by timestamp queries.

use std::{cell::RefCell, sync::Arc};

use ash::vk;

use super::{Context, GpuError};

/// A row of the profile: when a pass began and ended, in milliseconds since the frame's first pass began.
#[derive(Clone, Debug, PartialEq)]
pub struct TimerRow {
    /// The pass's name.
    pub name: &'static str,
    /// The number that tells the pass from others of its name, if any.
    pub number: Option<u32>,
    /// None where the device's queue has no timestamps.
    pub span_ms: Option<(f64, f64)>,
}

/// Timestamps of up to `capacity` passes a frame. A pass begins where the one before it in its command buffer has ended: a
/// timestamp costs an H200 more than a microsecond.
pub struct Timer {
    pool: vk::QueryPool,
    capacity: u32,
    recorded: RefCell<Recorded>,
    context: Arc<Context>,
}

#[derive(Default)]
struct Recorded {
    rows: Vec<Row>,
    n_timestamps: u32,
}

struct Row {
    name: &'static str,
    number: Option<u32>,
    /// Numbers of its timestamps.
    begin: u32,
    end: u32,
}

impl Timer {
    /// # Errors
    /// Out of memory.
    pub fn new(context: &Arc<Context>, capacity: u32) -> Result<Self, GpuError> {
        context.count_creation("vkCreateQueryPool", "timer")?;
        let info = vk::QueryPoolCreateInfo::default()
            .query_type(vk::QueryType::TIMESTAMP)
            .query_count(Self::n_queries(capacity));
        // SAFETY: a plain creation.
        let pool = unsafe { context.device.create_query_pool(&info, None) }
            .map_err(GpuError::call("vkCreateQueryPool", "timer"))?;
        context.set_name(pool, "timer");
        Ok(Self { pool, capacity, recorded: RefCell::default(), context: context.clone() })
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
        self.recorded.take();
        // SAFETY: the commands are being recorded, outside rendering.
        unsafe { self.context.device.cmd_reset_query_pool(commands, self.pool, 0, Self::n_queries(self.capacity)) };
    }

    /// Opens the next row. `is_first`: of its command buffer.
    pub(super) fn begin(&self, commands: vk::CommandBuffer, name: &'static str, number: Option<u32>, is_first: bool) {
        let n_rows = self.recorded.borrow().rows.len() as u32;
        assert!(n_rows < self.capacity, "the timer has room for {} passes", self.capacity);
        if is_first {
            self.write(commands);
        }
        let mut recorded = self.recorded.borrow_mut();
        let begin = recorded.n_timestamps - 1;
        recorded.rows.push(Row { name, number, begin, end: begin });
    }

    /// Closes the last row.
    pub(super) fn end(&self, commands: vk::CommandBuffer) {
        self.write(commands);
        let recorded = &mut *self.recorded.borrow_mut();
        if let Some(row) = recorded.rows.last_mut() {
            row.end = recorded.n_timestamps - 1;
        }
    }

    /// Written twice: on Mesa 22.3's lavapipe a compute timestamp holds the one before it once any render pass has
    /// run; the second write, to a dummy, pushes the first one into its place.
    fn write(&self, commands: vk::CommandBuffer) {
        let timestamp = self.recorded.borrow().n_timestamps;
        self.recorded.borrow_mut().n_timestamps += 1;
        if self.context.timestamp_valid_bits == 0 {
            return;
        }
        let stage = vk::PipelineStageFlags2::BOTTOM_OF_PIPE;
        for query in [2 * timestamp, 2 * timestamp + 1] {
            // SAFETY: the commands are being recorded; the query was reset at the frame's start.
            unsafe { self.context.device.cmd_write_timestamp2(commands, stage, self.pool, query) };
        }
    }

    /// The frame's rows in the order of recording; the device must have ended the frame.
    pub fn rows(&self) -> Result<Vec<TimerRow>, GpuError> {
        let Recorded { rows, n_timestamps } = &*self.recorded.borrow();
        let ticks = self.ticks(*n_timestamps as usize)?;
        let start = ticks.iter().copied().min().unwrap_or(0);
        let ms = |tick: u64| tick.saturating_sub(start) as f64 * f64::from(self.context.timestamp_period_ns) * 1e-6;
        let time = |timestamp: u32| ticks.get(timestamp as usize).map(|&tick| ms(tick));
        let row =
            |row: &Row| TimerRow { name: row.name, number: row.number, span_ms: time(row.begin).zip(time(row.end)) };
        Ok(rows.iter().map(row).collect())
    }

    /// All timestamps; none where the queue has none.
    fn ticks(&self, n_timestamps: usize) -> Result<Vec<u64>, GpuError> {
        let bits = self.context.timestamp_valid_bits;
        if bits == 0 || n_timestamps == 0 {
            return Ok(Vec::new());
        }
        let mask = u64::MAX >> (64 - bits);
        let mut raw = vec![0u64; 2 * n_timestamps];
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: the first 2 * n_timestamps queries were written by the frame that has ended.
        unsafe { self.context.device.get_query_pool_results(self.pool, 0, &mut raw, flags) }
            .map_err(GpuError::call("vkGetQueryPoolResults", "timer"))?;
        Ok(raw.chunks_exact(2).map(|written| written[0] & mask).collect())
    }
}

impl Drop for Timer {
    fn drop(&mut self) {
        // SAFETY: the device has ended all work with it.
        unsafe { self.context.device.destroy_query_pool(self.pool, None) };
    }
}
