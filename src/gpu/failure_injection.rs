//! Creations of Vulkan objects that fail on purpose, with which tests find out what remains of a change that a driver
//! refuses halfway.

use std::sync::atomic::{AtomicU32, Ordering};

use ash::vk;

use super::{Context, GpuError};

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
    /// Lets the next `n_creations` creations of buffers, images, pipelines, descriptor sets, query pools and command
    /// buffers succeed, and every later one fail as if memory were exhausted. `None` lets all succeed.
    #[doc(hidden)]
    pub fn fail_creations_after(&self, n_creations: Option<u32>) {
        self.failure_injection.n_left.store(n_creations.unwrap_or(FailureInjection::NEVER), Ordering::Relaxed);
    }

    /// Counts a creation that is about to be made by `call`.
    ///
    /// # Errors
    /// The creation is one of those that [`Context::fail_creations_after`] lets fail.
    pub(super) fn count_creation(&self, call: &'static str, object: &str) -> Result<(), GpuError> {
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
