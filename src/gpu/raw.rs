//! Raw Vulkan handles, for libraries that make objects and record commands of their own.

use std::sync::{Arc, Mutex};

use ash::vk;
use gpu_allocator::vulkan::Allocator;

use super::{Commands, Context, GpuError, WindowImage};

impl Context {
    /// Returns the allocator of the device's memory.
    pub(crate) fn allocator(&self) -> Arc<Mutex<Allocator>> {
        Arc::clone(&self.device.allocator)
    }

    /// Returns the device, which must not be destroyed.
    pub(crate) fn device(&self) -> &ash::Device {
        &self.device.raw
    }

    /// Calls `submit` with the queue, which no other thread uses meanwhile, and with a command pool. All that `submit`
    /// submits must have ended when it returns, and the command buffers that it makes must be freed.
    ///
    /// # Errors
    /// Memory is exhausted.
    pub(crate) fn with_queue<T>(&self, submit: impl FnOnce(vk::Queue, vk::CommandPool) -> T) -> Result<T, GpuError> {
        let pool = self.device.take_pool("overlay", self.device.family)?;
        let result = self.queue.with_raw(|queue| submit(queue, pool.raw));
        // SAFETY: the caller guarantees it.
        unsafe { self.device.give_pool(pool) };
        Ok(result)
    }
}

impl Commands<'_> {
    /// Returns the command buffer that is being recorded.
    pub(crate) fn raw(&self) -> vk::CommandBuffer {
        self.raw
    }
}

impl WindowImage {
    /// Returns the image's size, pixels.
    pub(crate) fn extent(&self) -> vk::Extent2D {
        self.extent
    }
}
