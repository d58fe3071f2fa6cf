//! Deliberate failures. Tests let creations of Vulkan objects fail, to find out what state remains if the driver
//! refuses an object in the middle of a change, and leave barriers out, to find out whether anybody would notice.

use std::sync::atomic::{AtomicU32, Ordering};

use ash::vk;

use super::{Context, GpuError, raw_device::RawDevice};

/// A countdown of the creations that succeed before one fails.
pub(super) struct FailureInjection {
    /// Number of creations that still succeed. [`FailureInjection::NEVER`] if none fails.
    n_left: AtomicU32,
    /// Number of barriers that are still recorded before one is left out, likewise.
    n_barriers_left: AtomicU32,
}

impl FailureInjection {
    const NEVER: u32 = u32::MAX;

    pub(super) fn never() -> Self {
        Self { n_left: AtomicU32::new(Self::NEVER), n_barriers_left: AtomicU32::new(Self::NEVER) }
    }

    /// Counts a barrier. Returns whether it is to be left out.
    pub fn leaves_barrier_out(&self) -> bool {
        if self.n_barriers_left.load(Ordering::Relaxed) == Self::NEVER {
            return false;
        }
        // After 0 comes `NEVER`.
        self.n_barriers_left.fetch_sub(1, Ordering::Relaxed) == 0
    }
}

impl Context {
    /// Lets the next `n_creations` creations succeed, and every later one fail as if memory were exhausted. `None`
    /// lets all succeed. Creations are those of buffers, images, their views, compute and raster pipelines,
    /// descriptor pools, descriptor sets, query pools and command buffers.
    #[doc(hidden)]
    pub fn fail_creations_after(&self, n_creations: Option<u32>) {
        self.device.failure_injection.n_left.store(n_creations.unwrap_or(FailureInjection::NEVER), Ordering::Relaxed);
    }
}

impl Context {
    /// Leaves out the barrier of [`Commands::barrier`](super::Commands::barrier) after the next `n` ones; none with
    /// `None`. Returns how many would still have come before the barrier of the last call; `None` if that has been left
    /// out.
    #[doc(hidden)]
    pub fn leave_out_barrier_after(&self, n: Option<u32>) -> Option<u32> {
        let n = n.unwrap_or(FailureInjection::NEVER);
        let n_left = self.device.failure_injection.n_barriers_left.swap(n, Ordering::Relaxed);
        (n_left != FailureInjection::NEVER).then_some(n_left)
    }
}

impl RawDevice {
    /// Counts a creation that `call` is about to make, and fails if the creation is to fail.
    ///
    /// # Errors
    /// The creation is one of those that [`Context::fail_creations_after`] lets fail.
    pub fn count_creation(&self, call: &'static str, object: &str) -> Result<(), GpuError> {
        let count_down = |n_left| match n_left {
            FailureInjection::NEVER => Some(n_left),
            _ => u32::checked_sub(n_left, 1),
        };
        match self.failure_injection.n_left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, count_down) {
            Ok(_) => Ok(()),
            Err(_) => Err(GpuError::call(call, object)(vk::Result::ERROR_OUT_OF_DEVICE_MEMORY)),
        }
    }
}
