//! Raw Vulkan handles, for libraries that make objects and record commands of their own.

use std::sync::{Arc, Mutex};

use ash::vk;
use gpu_allocator::vulkan::Allocator;

use super::{Commands, Context, WindowImage};

impl Context {
    /// Returns the allocator of the device's memory.
    pub(crate) fn allocator(&self) -> Arc<Mutex<Allocator>> {
        Arc::clone(&self.allocator)
    }

    /// Returns the device, which must not be destroyed.
    pub(crate) fn device(&self) -> &ash::Device {
        &self.device
    }

    /// Returns the queue to which all commands are submitted.
    pub(crate) fn queue(&self) -> vk::Queue {
        self.queue
    }

    /// Returns the pool of the device's command buffers.
    pub(crate) fn command_pool(&self) -> vk::CommandPool {
        self.command_pool
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
