//! Vulkan objects of the caller's own: a device that is open already, and what kdray reads and writes of another program.
//!
//! Nobody but the caller can know that a raw handle is what it says and lives long enough. So each of these types is made by
//! an `unsafe` function, and is safe to use from then on.

use std::{marker::PhantomData, sync::Arc};

use ash::vk;

use super::{Commands, Context, ContextOptions, GpuError};

/// A Vulkan device that the caller has opened, and one of its queues.
#[derive(Clone)]
pub struct GivenDevice {
    /// The loader.
    pub entry: ash::Entry,
    /// The instance, of Vulkan 1.3.
    pub instance: ash::Instance,
    /// The physical device of `device`.
    pub physical: vk::PhysicalDevice,
    /// The device, with [`RequiredFeatures`] enabled.
    pub device: ash::Device,
    /// The index of a queue family with graphics and compute.
    pub queue_family: u32,
    /// A queue of the family.
    pub queue: vk::Queue,
    /// Whether the device has `shaderInt64` and `shaderBufferInt64Atomics` enabled, so that kernels can rasterize.
    pub wide_atomics: bool,
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
    /// `wide_atomics`: with 64-bit atomics on buffers, which not all devices have, kernels can rasterize.
    pub fn new(wide_atomics: bool) -> Self {
        Self {
            of_1_0: vk::PhysicalDeviceFeatures::default().shader_int64(wide_atomics),
            of_1_2: vk::PhysicalDeviceVulkan12Features::default()
                .buffer_device_address(true)
                .shader_buffer_int64_atomics(wide_atomics),
            of_1_3: vk::PhysicalDeviceVulkan13Features::default()
                .dynamic_rendering(true)
                .synchronization2(true)
                .subgroup_size_control(true)
                .compute_full_subgroups(true)
                // Every Vulkan 1.3 device has it. Older GLSL compilers state workgroup sizes in a way that asks for it.
                .maintenance4(true),
        }
    }
}

impl Context {
    /// Uses a device that the caller has opened. The caller keeps the device, and destroys it after the context and all that
    /// was made from it.
    ///
    /// # Errors
    /// The device lacks something that kdray needs; a failed call.
    ///
    /// # Safety
    /// The handles belong together and live longer than the context, the device was created with [`RequiredFeatures`], and
    /// with 64-bit atomics if `wide_atomics` says so. No other thread uses the queue while a function of kdray runs.
    pub unsafe fn on_given(given: GivenDevice) -> Result<Arc<Self>, GpuError> {
        Self::open_given(given, &ContextOptions::default().pretend)
    }
}

/// A timeline semaphore of the caller's own, and one of its values.
#[derive(Clone, Copy)]
pub struct TimelinePoint {
    pub(super) semaphore: vk::Semaphore,
    pub(super) value: u64,
}

impl TimelinePoint {
    /// # Safety
    /// The handle is a timeline semaphore of the context's device. It lives until the device has waited for it or signalled
    /// it. Something signals a value that kdray waits for, even if the calling thread waits for kdray.
    pub unsafe fn new(semaphore: vk::Semaphore, value: u64) -> Self {
        Self { semaphore, value }
    }
}

/// An image of the caller's own that takes a picture.
#[derive(Clone, Copy)]
pub struct GivenImage {
    pub(super) raw: vk::Image,
    /// Width and height, pixels.
    pub(super) size: (u32, u32),
    pub(super) layouts: [vk::ImageLayout; 2],
}

impl GivenImage {
    /// `size`: width and height, pixels. `layouts`: the image's layout before the picture is written, which may be
    /// `UNDEFINED`, and after.
    ///
    /// # Safety
    /// The handle is a two-dimensional image of the context's device with one layer and one level, of this size, of the
    /// format `R8G8B8A8_UNORM` or `R8G8B8A8_SRGB`, with the usage `TRANSFER_DST`. It lives until the device has written it.
    pub unsafe fn new(raw: vk::Image, size: (u32, u32), layouts: [vk::ImageLayout; 2]) -> Self {
        Self { raw, size, layouts }
    }

    /// Width and height, pixels.
    pub fn size(&self) -> (u32, u32) {
        self.size
    }
}

/// A storage buffer of the caller's own.
#[derive(Clone, Copy)]
pub struct GivenBuffer {
    pub(super) raw: vk::Buffer,
    pub(super) offset: u64,
    pub(super) bytes: u64,
}

impl GivenBuffer {
    /// The bytes of a buffer from an offset on.
    ///
    /// # Safety
    /// The handle is a buffer of the context's device with the usage `STORAGE_BUFFER` and at least `offset + bytes` bytes.
    /// The offset is a multiple of the device's `minStorageBufferOffsetAlignment`. The buffer lives until the device has run
    /// all commands that use it.
    pub unsafe fn new(raw: vk::Buffer, offset: u64, bytes: u64) -> Self {
        Self { raw, offset, bytes }
    }

    /// The number of bytes.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }
}

/// A command buffer of the caller's own that is being recorded.
pub struct GivenCommands<'a> {
    raw: vk::CommandBuffer,
    borrowed: PhantomData<&'a ()>,
}

impl GivenCommands<'_> {
    /// # Safety
    /// The handle is a command buffer of the context's device, of a family with compute. It is being recorded, outside of
    /// rendering, for as long as this value lives.
    pub unsafe fn new(raw: vk::CommandBuffer) -> Self {
        Self { raw, borrowed: PhantomData }
    }

    /// The commands, recorded without times.
    pub(crate) fn commands<'c>(&'c self, context: &'c Context) -> Commands<'c> {
        Commands::to_given(context, self.raw)
    }
}
