//! GPU times of passes, measured by timestamp queries.

use std::sync::{Arc, Mutex};

use ash::vk;

use super::{
    Commands, Context, GpuError,
    lock::{Guard, Rank, lock_anyway},
    raw_device::RawDevice,
};

/// A row of the profile: the time that a pass took.
#[derive(Clone, Debug, PartialEq)]
pub struct TimerRow {
    /// The pass's name.
    pub name: &'static str,
    /// The number that distinguishes the pass from others of its name, if any.
    pub number: Option<u32>,
    /// Begin and end of the pass, milliseconds since the frame's first pass began. `None` if the device's queue
    /// writes no timestamps.
    pub span_ms: Option<(f64, f64)>,
}

/// Timestamps of up to `capacity` passes a frame. A pass begins at the timestamp with which the previous pass of its
/// command buffer ended, because a timestamp costs an H200 more than a microsecond.
pub struct Timer {
    pool: Arc<QueryPool>,
    capacity: u32,
    recorded: Mutex<Recorded>,
}

/// Vulkan's pool of queries.
struct QueryPool {
    raw: vk::QueryPool,
    device: Arc<RawDevice>,
}

/// Rows and timestamps that the current frame has so far.
#[derive(Default)]
struct Recorded {
    rows: Vec<Row>,
    n_timestamps: u32,
}

/// A recorded pass.
struct Row {
    name: &'static str,
    number: Option<u32>,
    /// Indices of the timestamps at which the pass begins and ends.
    begin: u32,
    end: u32,
}

impl Timer {
    /// Creates a timer.
    ///
    /// # Errors
    /// Memory is exhausted.
    pub fn new(context: &Arc<Context>, capacity: u32) -> Result<Self, GpuError> {
        let device = &context.device;
        device.count_creation("vkCreateQueryPool", "timer")?;
        let info = vk::QueryPoolCreateInfo::default()
            .query_type(vk::QueryType::TIMESTAMP)
            .query_count(Self::n_queries(capacity));
        // SAFETY: the call only creates a pool, which `Drop` destroys.
        let raw = unsafe { device.raw.create_query_pool(&info, None) }
            .map_err(GpuError::call("vkCreateQueryPool", "timer"))?;
        device.set_name(raw, "timer");
        let pool = Arc::new(QueryPool { raw, device: Arc::clone(device) });
        Ok(Self { pool, capacity, recorded: Mutex::default() })
    }

    /// Returns the number of queries: a begin, an end and two dummies for each pass (see [`Timer::write`]).
    fn n_queries(capacity: u32) -> u32 {
        4 * capacity
    }

    /// Returns the number of passes that the timer has room for.
    pub fn capacity(&self) -> u32 {
        self.capacity
    }

    /// Forgets all rows. It must be recorded before the frame's first pass.
    pub(super) fn reset(&self, commands: &Commands) {
        *self.recorded() = Recorded::default();
        let (pool, n_queries) = (self.pool.raw, Self::n_queries(self.capacity));
        commands.keep(&self.pool);
        // SAFETY: the commands are being recorded, and no rendering is open.
        unsafe { commands.device.raw.cmd_reset_query_pool(commands.raw, pool, 0, n_queries) };
    }

    /// Opens the next row. `is_first` says whether the pass is the first of its command buffer.
    pub(super) fn begin(&self, commands: &Commands, name: &'static str, number: Option<u32>, is_first: bool) {
        let n_rows = self.recorded().rows.len() as u32;
        assert!(n_rows < self.capacity, "the timer has room for {} passes", self.capacity);
        if is_first {
            self.write(commands);
        }
        let mut recorded = self.recorded();
        let begin = recorded.n_timestamps - 1;
        recorded.rows.push(Row { name, number, begin, end: begin });
    }

    /// Closes the last row.
    pub(super) fn end(&self, commands: &Commands) {
        self.write(commands);
        let recorded = &mut *self.recorded();
        if let Some(row) = recorded.rows.last_mut() {
            row.end = recorded.n_timestamps - 1;
        }
    }

    /// Writes the next timestamp, and writes it twice. On Mesa 22.3's lavapipe, once any render pass has run, the
    /// query of a compute timestamp gets the value of the timestamp before it. The second write, to a dummy query,
    /// pushes the first value into its place.
    fn write(&self, commands: &Commands) {
        let timestamp = self.recorded().n_timestamps;
        self.recorded().n_timestamps += 1;
        if commands.device.timestamp_valid_bits == 0 {
            return;
        }
        commands.keep(&self.pool);
        let stage = vk::PipelineStageFlags2::BOTTOM_OF_PIPE;
        for query in [2 * timestamp, 2 * timestamp + 1] {
            // SAFETY: the commands are being recorded, and the query was reset at the frame's start.
            unsafe { commands.device.raw.cmd_write_timestamp2(commands.raw, stage, self.pool.raw, query) };
        }
    }

    /// Returns the frame's rows in the order of recording. The device must have ended the frame.
    pub fn rows(&self) -> Result<Vec<TimerRow>, GpuError> {
        let Recorded { rows, n_timestamps } = &*self.recorded();
        let ticks = self.ticks(*n_timestamps as usize)?;
        let start = ticks.iter().copied().min().unwrap_or(0);
        let ms = |tick: u64| tick.saturating_sub(start) as f64 * f64::from(self.pool.device.timestamp_period_ns) * 1e-6;
        let time = |timestamp: u32| ticks.get(timestamp as usize).map(|&tick| ms(tick));
        let row =
            |row: &Row| TimerRow { name: row.name, number: row.number, span_ms: time(row.begin).zip(time(row.end)) };
        Ok(rows.iter().map(row).collect())
    }

    /// Returns all timestamps in ticks, or none if the queue writes none.
    fn ticks(&self, n_timestamps: usize) -> Result<Vec<u64>, GpuError> {
        let device = &self.pool.device;
        let bits = device.timestamp_valid_bits;
        if bits == 0 || n_timestamps == 0 {
            return Ok(Vec::new());
        }
        let mask = u64::MAX >> (64 - bits);
        let mut raw = vec![0u64; 2 * n_timestamps];
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: the first 2 * n_timestamps queries were written by the frame that has ended.
        unsafe { device.raw.get_query_pool_results(self.pool.raw, 0, &mut raw, flags) }
            .map_err(GpuError::call("vkGetQueryPoolResults", "timer"))?;
        Ok(raw.chunks_exact(2).map(|written| written[0] & mask).collect())
    }

    fn recorded(&self) -> Guard<'_, Recorded> {
        lock_anyway(Rank::Timer, &self.recorded)
    }
}

impl Drop for QueryPool {
    fn drop(&mut self) {
        // SAFETY: the device has ended all work with the pool, since commands that write it keep it.
        unsafe { self.device.raw.destroy_query_pool(self.raw, None) };
    }
}
