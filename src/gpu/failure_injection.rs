//! Deliberate failures to create Vulkan objects. Tests use them to find out what state remains if the driver refuses
//! an object in the middle of a change.

use std::sync::atomic::{AtomicU32, Ordering};

use ash::vk;

use super::{Context, GpuError, raw_device::RawDevice};

/// A countdown of the creations that succeed before one fails.
pub(super) struct FailureInjection {
    /// Number of creations that still succeed. [`FailureInjection::NEVER`] if none fails.
    n_left: AtomicU32,
}

impl FailureInjection {
    const NEVER: u32 = u32::MAX;

    pub(super) fn never() -> Self {
        Self { n_left: AtomicU32::new(Self::NEVER) }
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
