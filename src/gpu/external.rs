//! Vulkan objects that the library's caller owns: a device that is already open, and objects of another program that
//! kdray reads and writes.
//!
//! Only the caller can guarantee that a raw handle is what it claims to be and lives long enough. So an `unsafe`
//! function takes each of these handles, and all later use is safe.

use std::{
    marker::PhantomData,
    sync::{Arc, Mutex},
};

use ash::vk;

use super::{Commands, Context};

/// A Vulkan device that the caller has opened, and one of its queues.
#[derive(Clone)]
pub struct ExternalDevice {
    /// The loader.
    pub entry: ash::Entry,
    /// The instance, for Vulkan 1.3.
    pub instance: ash::Instance,
    /// The physical device of `device`.
    pub physical: vk::PhysicalDevice,
    /// The device, with [`RequiredFeatures`] enabled.
    pub device: ash::Device,
    /// The index of a queue family with graphics and compute.
    pub queue_family: u32,
    /// A queue of the family.
    pub queue: vk::Queue,
    /// The lock under which everybody uses the queue: kdray holds it while it submits. If nobody else uses the queue,
    /// this is a new lock.
    pub queue_lock: Arc<Mutex<()>>,
    /// Whether the device has `shaderInt64` and `shaderBufferInt64Atomics` enabled, with which kernels can rasterize.
    pub int64_atomics: bool,
}

/// The features that a device needs for kdray. A program may add its own before it creates a device with them.
#[derive(Clone, Copy, Default)]
pub struct RequiredFeatures {
    /// Features of Vulkan 1.0.
    pub of_1_0: vk::PhysicalDeviceFeatures,
    /// Features of Vulkan 1.2.
    pub of_1_2: vk::PhysicalDeviceVulkan12Features<'static>,
    /// Features of Vulkan 1.3.
    pub of_1_3: vk::PhysicalDeviceVulkan13Features<'static>,
}

impl RequiredFeatures {
    /// Returns the required features. `int64_atomics` adds 64-bit atomics on buffers, which not all devices have and
    /// with which kernels can rasterize.
    pub fn new(int64_atomics: bool) -> Self {
        Self {
            of_1_0: vk::PhysicalDeviceFeatures::default().shader_int64(int64_atomics),
            of_1_2: vk::PhysicalDeviceVulkan12Features::default()
                .buffer_device_address(true)
                .shader_buffer_int64_atomics(int64_atomics),
            of_1_3: vk::PhysicalDeviceVulkan13Features::default()
                .dynamic_rendering(true)
                .synchronization2(true)
                .subgroup_size_control(true)
                .compute_full_subgroups(true)
                // Every Vulkan 1.3 device has this feature. Older GLSL compilers state workgroup sizes in a way that
                // requires it.
                .maintenance4(true),
        }
    }
}

/// A timeline semaphore that the caller owns, and one of its values.
#[derive(Clone, Copy)]
pub struct TimelinePoint {
    pub(super) semaphore: vk::Semaphore,
    pub(super) value: u64,
}

impl TimelinePoint {
    /// Makes a point from a semaphore and a value.
    ///
    /// # Safety
    /// The handle is a timeline semaphore of the context's device. It lives until the device has waited for it or
    /// signalled it. If kdray waits for the value, something signals it even while the calling thread waits for
    /// kdray.
    pub unsafe fn new(semaphore: vk::Semaphore, value: u64) -> Self {
        Self { semaphore, value }
    }
}

/// An image that the caller owns and kdray writes a picture to.
#[derive(Clone, Copy)]
pub struct ExternalImage {
    pub(super) raw: vk::Image,
    /// Width and height, pixels.
    pub(super) size: (u32, u32),
    /// The image's layouts before and after the picture is written.
    pub(super) layouts: [vk::ImageLayout; 2],
}

impl ExternalImage {
    /// Wraps an image. `size` is its width and height, pixels. `layouts` are its layouts before the picture is
    /// written, which may be `UNDEFINED`, and afterwards.
    ///
    /// # Safety
    /// The handle is a two-dimensional image of the context's device with one layer and one level, of this size, of
    /// the format `R8G8B8A8_UNORM` or `R8G8B8A8_SRGB`, with the usage `TRANSFER_DST`. It lives until the device has
    /// written it.
    pub unsafe fn new(raw: vk::Image, size: (u32, u32), layouts: [vk::ImageLayout; 2]) -> Self {
        Self { raw, size, layouts }
    }

    /// Returns the width and height, pixels.
    pub fn size(&self) -> (u32, u32) {
        self.size
    }
}

/// A range of a storage buffer that the caller owns.
#[derive(Clone, Copy)]
pub struct ExternalBuffer {
    pub(super) raw: vk::Buffer,
    pub(super) offset: u64,
    pub(super) bytes: u64,
}

impl ExternalBuffer {
    /// Wraps `bytes` bytes of a buffer, from an offset on. A range that kernels read and one that they write should not
    /// share an aligned block of 128 bytes: on an H200, a kernel lost hits where they shared 32 (docs/experiments.md).
    ///
    /// # Safety
    /// The handle is a buffer of the context's device with the usage `STORAGE_BUFFER` and at least `offset + bytes`
    /// bytes. The offset is a multiple of the device's `minStorageBufferOffsetAlignment`. The buffer lives until the
    /// device has run all commands that use it.
    pub unsafe fn new(raw: vk::Buffer, offset: u64, bytes: u64) -> Self {
        Self { raw, offset, bytes }
    }

    /// Returns the number of bytes.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }
}

/// A command buffer that the caller owns and is recording.
pub struct ExternalCommands<'a> {
    raw: vk::CommandBuffer,
    borrowed: PhantomData<&'a ()>,
}

impl ExternalCommands<'_> {
    /// Wraps a command buffer.
    ///
    /// # Safety
    /// The handle is a command buffer of the context's device, of a family with compute. It is being recorded,
    /// outside of rendering, for as long as this value lives. Each cast that is recorded into it lives until the device
    /// has run the commands, and runs once at a time.
    pub unsafe fn new(raw: vk::CommandBuffer) -> Self {
        Self { raw, borrowed: PhantomData }
    }

    /// Returns the commands. Their passes are not timed.
    pub(crate) fn commands<'c>(&'c self, context: &'c Context) -> Commands<'c> {
        Commands::to_external(context, self.raw)
    }
}
