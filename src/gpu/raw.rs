//! Vulkan handles, for libraries that make objects and record commands of their own.

use std::sync::{Arc, Mutex};

use ash::vk;
use gpu_allocator::vulkan::Allocator;

use super::{Commands, Context, WindowImage};

impl Context {
    /// The allocator of the device's memory.
    pub(crate) fn allocator(&self) -> Arc<Mutex<Allocator>> {
        Arc::clone(&self.allocator)
    }

    /// The device, which must not be destroyed.
    pub(crate) fn device(&self) -> &ash::Device {
        &self.device
    }

    /// The queue that all commands go to.
    pub(crate) fn queue(&self) -> vk::Queue {
        self.queue
    }

    /// The pool of the device's command buffers.
    pub(crate) fn command_pool(&self) -> vk::CommandPool {
        self.command_pool
    }
}

impl Commands<'_> {
    /// The command buffer that is being recorded.
    pub(crate) fn raw(&self) -> vk::CommandBuffer {
        self.raw
    }
}

impl WindowImage {
    /// The image's size, pixels.
    pub(crate) fn extent(&self) -> vk::Extent2D {
        self.extent
    }
}
