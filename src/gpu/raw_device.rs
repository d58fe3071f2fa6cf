//! The open device, which every Vulkan object holds until it is released. It knows no queue, so an object that the
//! queue still keeps alive does not keep the queue alive.

use std::{
    ffi::CString,
    mem::ManuallyDrop,
    sync::{Arc, Mutex, PoisonError, atomic::AtomicBool},
};

use ash::{ext, khr, vk};
use gpu_allocator::vulkan::Allocator;

use super::{
    DeviceInfo, DeviceOverrides, GpuError, Limits,
    bindings::Layouts,
    extras::{DeviceExtras, Purpose},
    failure_injection::FailureInjection,
    instance::Instance,
    lock::{Rank, lock},
    memory::create_allocator,
    ray_tracing::RayTracingCalls,
    statistics::StatisticsCalls,
};

/// A Vulkan device with its memory, its limits and its caches.
pub(super) struct RawDevice {
    pub raw: ash::Device,
    pub debug_utils: Option<ext::debug_utils::Device>,
    /// Whether commands get debug labels. They get none under the validation layer, because that of Debian 12
    /// (1.3.239) corrupts its heap after some ten thousand labelled command buffers.
    pub has_labels: bool,
    /// What the driver keeps of its work for this device. Equal compute pipelines are not made twice (`pipeline.rs`).
    pub pipeline_cache: vk::PipelineCache,
    /// All layouts that have been made for the device.
    pub layouts: Mutex<Vec<Layouts>>,
    pub timestamp_period_ns: f32,
    pub timestamp_valid_bits: u32,
    /// `None` if the device was opened without the driver's ray tracing.
    pub ray_tracing: Option<RayTracingCalls>,
    /// `None` if the device lacks `VK_KHR_pipeline_executable_properties`.
    pub statistics: Option<StatisticsCalls>,
    /// Whether pipelines can be made without bounds checks.
    pub unchecked: bool,
    /// Whether kernels have 64-bit atomics on buffers.
    pub int64_atomics: bool,
    /// Functions of the swapchain extension. `None` if the device was opened without a window.
    #[cfg_attr(not(feature = "view"), expect(dead_code, reason = "only windows present pictures"))]
    pub presentation: Option<khr::swapchain::Device>,
    #[cfg(feature = "view")]
    pub physical: vk::PhysicalDevice,
    /// Whether a call of any queue has found the device lost. All work has ended then.
    pub is_lost: AtomicBool,
    /// Index of the queue's family.
    pub family: u32,
    /// Index of the family of the queue for copies, if the device was opened with one.
    pub copy_family: Option<u32>,
    /// Command pools that are not in use, with a command buffer each.
    pub pools: Mutex<Vec<CommandPool>>,
    /// Shared with the overlay's renderer, which is dropped before the device.
    pub allocator: ManuallyDrop<Arc<Mutex<Allocator>>>,
    pub info: DeviceInfo,
    pub limits: Limits,
    pub overrides: DeviceOverrides,
    pub failure_injection: FailureInjection,
    #[cfg(feature = "view")]
    pub replacements: Mutex<super::Replacements>,
    /// Whether the library's caller owns the device and destroys it.
    pub is_external: bool,
    pub instance: Arc<Instance>,
}

/// A command pool and its only command buffer. Vulkan lets no two threads record into buffers of one pool.
#[derive(Clone, Copy)]
pub(super) struct CommandPool {
    pub raw: vk::CommandPool,
    pub buffer: vk::CommandBuffer,
    /// Index of the family to whose queues the buffer is submitted.
    pub family: u32,
}

/// Handles and properties of an open device.
pub(super) struct Opened {
    pub physical: vk::PhysicalDevice,
    pub device: ash::Device,
    pub family: u32,
    pub copy_family: Option<u32>,
    pub info: DeviceInfo,
    pub extras: DeviceExtras,
    pub is_external: bool,
}

impl RawDevice {
    pub fn new(
        instance: Arc<Instance>,
        opened: Opened,
        purpose: Purpose,
        overrides: &DeviceOverrides,
    ) -> Result<Arc<Self>, GpuError> {
        let Opened { physical, device, family, copy_family, info, extras, is_external } = opened;
        // SAFETY: the physical device belongs to the instance, and the device to the physical device.
        let (families, properties, pipeline_cache) = unsafe {
            (
                instance.raw.get_physical_device_queue_family_properties(physical),
                instance.raw.get_physical_device_properties(physical),
                (device.create_pipeline_cache(&vk::PipelineCacheCreateInfo::default(), None))
                    .map_err(GpuError::call("vkCreatePipelineCache", "kdray"))?,
            )
        };
        let allocator = create_allocator(&instance, &device, physical)?;
        Ok(Arc::new(Self {
            ray_tracing: (purpose == Purpose::RayTracing).then(|| RayTracingCalls::new(&instance, physical, &device)),
            has_labels: !instance.validates(),
            unchecked: extras.unchecked,
            int64_atomics: extras.int64_atomics && !overrides.no_int64_atomics,
            statistics: extras.statistics.then(|| StatisticsCalls::new(&instance, &device)),
            debug_utils: instance.has_debug_utils.then(|| ext::debug_utils::Device::new(&instance.raw, &device)),
            presentation: (purpose == Purpose::Window).then(|| khr::swapchain::Device::new(&instance.raw, &device)),
            raw: device,
            #[cfg(feature = "view")]
            physical,
            is_lost: AtomicBool::new(false),
            family,
            copy_family,
            pipeline_cache,
            layouts: Mutex::default(),
            pools: Mutex::default(),
            timestamp_period_ns: properties.limits.timestamp_period,
            timestamp_valid_bits: families[family as usize].timestamp_valid_bits,
            allocator: ManuallyDrop::new(Arc::new(Mutex::new(allocator))),
            info,
            overrides: *overrides,
            failure_injection: FailureInjection::never(),
            #[cfg(feature = "view")]
            replacements: Mutex::default(),
            limits: Limits::of(&instance, physical).reduced_to(overrides),
            is_external,
            instance,
        }))
    }

    /// Takes a command pool of a queue family that is not in use, or makes one.
    pub fn take_pool(&self, name: &str, family: u32) -> Result<CommandPool, GpuError> {
        let mut pools = lock(Rank::Pools, &self.pools)?;
        if let Some(place) = pools.iter().rposition(|pool| pool.family == family) {
            return Ok(pools.swap_remove(place));
        }
        drop(pools);
        let info = vk::CommandPoolCreateInfo::default()
            .queue_family_index(family)
            .flags(vk::CommandPoolCreateFlags::TRANSIENT);
        // SAFETY: the pool is destroyed on every path that does not hand it to an owner.
        unsafe {
            let raw = self.raw.create_command_pool(&info, None).map_err(GpuError::call("vkCreateCommandPool", name))?;
            let info = vk::CommandBufferAllocateInfo::default().command_pool(raw).command_buffer_count(1);
            match self.raw.allocate_command_buffers(&info) {
                Ok(buffers) => Ok(CommandPool { raw, buffer: buffers[0], family }),
                Err(result) => {
                    self.raw.destroy_command_pool(raw, None);
                    Err(GpuError::call("vkAllocateCommandBuffers", name)(result))
                }
            }
        }
    }

    /// Keeps a command pool for later recorders.
    ///
    /// # Safety
    /// The device has ended all work with the pool's buffer, and nobody records into it.
    pub unsafe fn give_pool(&self, pool: CommandPool) {
        match lock(Rank::Pools, &self.pools) {
            Ok(mut pools) => pools.push(pool),
            // SAFETY: the caller guarantees that the pool is not in use.
            Err(_) => unsafe { self.raw.destroy_command_pool(pool.raw, None) },
        }
    }

    /// Returns the shader stages that see bindings and push constants.
    pub fn stages(&self) -> vk::ShaderStageFlags {
        let mut stages = vk::ShaderStageFlags::COMPUTE | vk::ShaderStageFlags::VERTEX | vk::ShaderStageFlags::FRAGMENT;
        if self.ray_tracing.is_some() {
            stages |= vk::ShaderStageFlags::RAYGEN_KHR;
        }
        stages
    }

    /// Names a handle for debuggers and the validation layer.
    pub fn set_name(&self, handle: impl vk::Handle, name: &str) {
        let (Some(debug_utils), Ok(name)) = (&self.debug_utils, CString::new(name)) else { return };
        let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(handle).object_name(&name);
        // SAFETY: the handle belongs to this device and is not shared yet. An error is ignored, since a missing name
        // does no harm.
        let _ = unsafe { debug_utils.set_debug_utils_object_name(&info) };
    }
}

impl Drop for RawDevice {
    fn drop(&mut self) {
        // SAFETY: every object made from the device holds it, so none is left, and neither is a queue that works; the
        // allocator is dropped before the device.
        unsafe {
            ManuallyDrop::drop(&mut self.allocator);
            let layouts = std::mem::take(self.layouts.get_mut().unwrap_or_else(PoisonError::into_inner));
            layouts.into_iter().for_each(|layouts| layouts.destroy(&self.raw));
            let pools = self.pools.get_mut().unwrap_or_else(PoisonError::into_inner);
            pools.iter().for_each(|pool| self.raw.destroy_command_pool(pool.raw, None));
            self.raw.destroy_pipeline_cache(self.pipeline_cache, None);
            if !self.is_external {
                self.raw.destroy_device(None);
            }
        }
    }
}
