//! The context: an open Vulkan device with its queue, its memory and its limits.

use std::{
    ffi::CString,
    mem::ManuallyDrop,
    sync::{Arc, Mutex, OnceLock, PoisonError},
};

use ash::{ext, khr, vk};
use gpu_allocator::vulkan::Allocator;

use super::{
    Commands, DeviceInfo, DeviceOverrides, DeviceSelector, GivenDevice, GpuError, Limits, TimelinePoint,
    bindings::Layouts,
    commands::CommandBuffer,
    device::{DeviceExtras, Purpose},
    devices::{list, queue_family, select},
    failure_injection::FailureInjection,
    instance::Instance,
    memory::create_allocator,
    probe,
    ray_tracing::RayTracingCalls,
    statistics::StatisticsCalls,
};

/// Options of a context: which device it opens, and how.
#[derive(Clone, Debug, Default)]
pub struct ContextOptions {
    /// The device to open. `None` selects the best GPU, or a software driver if there is no GPU.
    pub device: Option<DeviceSelector>,
    /// Whether the Khronos validation layer runs, with synchronization validation. Commands then have no debug
    /// labels.
    pub validate: bool,
    /// Properties that tests substitute for the device's own.
    #[doc(hidden)]
    pub overrides: DeviceOverrides,
}

impl ContextOptions {
    /// Returns options for the selected device, or for the best one if `device` is `None`. `validate` turns the
    /// validation layer on.
    pub fn new(device: Option<DeviceSelector>, validate: bool) -> Self {
        Self { device, validate, overrides: DeviceOverrides::default() }
    }
}

/// A Vulkan device with one queue for graphics and compute.
pub struct Context {
    pub(super) device: ash::Device,
    pub(super) debug_utils: Option<ext::debug_utils::Device>,
    /// Whether commands get debug labels. They get none under the validation layer, because that of Debian 12
    /// (1.3.239) corrupts its heap after some ten thousand labelled command buffers.
    pub(super) has_labels: bool,
    pub(super) command_pool: vk::CommandPool,
    /// What the driver has compiled for this context. A pipeline that is created again, for other options or another
    /// renderer, is then taken from there: software drivers need up to a second to compile a kernel.
    pub(super) pipeline_cache: vk::PipelineCache,
    /// All layouts that the context has made.
    pub(super) layouts: Mutex<Vec<Layouts>>,
    pub(super) timestamp_period_ns: f32,
    pub(super) timestamp_valid_bits: u32,
    /// `None` if the context was opened without the driver's ray tracing.
    pub(super) ray_tracing: Option<RayTracingCalls>,
    /// `None` if the device lacks `VK_KHR_pipeline_executable_properties`.
    pub(super) statistics: Option<StatisticsCalls>,
    /// Whether pipelines can be made without bounds checks.
    pub(super) unchecked: bool,
    /// Whether kernels have 64-bit atomics on buffers.
    int64_atomics: bool,
    /// Functions of the swapchain extension. `None` if the device was opened without a window.
    #[cfg_attr(not(feature = "view"), expect(dead_code, reason = "only windows present pictures"))]
    pub(super) presentation: Option<khr::swapchain::Device>,
    #[cfg(feature = "view")]
    pub(super) physical: vk::PhysicalDevice,
    pub(super) queue: vk::Queue,
    /// Shared with the overlay's renderer, which is dropped before the context.
    pub(super) allocator: ManuallyDrop<Arc<Mutex<Allocator>>>,
    info: DeviceInfo,
    predicates_branches: bool,
    limits: Limits,
    fuses_fma: OnceLock<bool>,
    n_lanes: OnceLock<u32>,
    /// See [`Context::loop_limit`].
    loop_limit: OnceLock<Option<u32>>,
    overrides: DeviceOverrides,
    pub(super) failure_injection: FailureInjection,
    #[cfg(feature = "hot-reload")]
    pub(super) replacements: Mutex<super::Replacements>,
    /// Submitted command buffers that have no owner. They are freed when the queue is idle.
    left_commands: Mutex<Vec<vk::CommandBuffer>>,
    /// Whether the caller of the library owns the device and destroys it.
    is_given: bool,
    instance: Arc<Instance>,
}

/// An open device and its properties, from which a context is made.
struct Opened {
    physical: vk::PhysicalDevice,
    device: ash::Device,
    queue: vk::Queue,
    /// Index of the queue's family.
    family: usize,
    info: DeviceInfo,
    extras: DeviceExtras,
    is_given: bool,
}

impl Context {
    /// Opens a device.
    ///
    /// # Errors
    /// There is no loader, driver, device of that name or validation layer; the device lacks a feature; or a call
    /// fails.
    pub fn new(options: &ContextOptions) -> Result<Arc<Self>, GpuError> {
        let instance = Instance::new(options.validate)?;
        let (physical, info) = select(&instance, options.device.as_ref(), |_| true)?;
        Self::open(instance, physical, info, Purpose::Compute, &options.overrides)
    }

    /// Opens a device and makes the surface of a window, in which the context can show pictures.
    ///
    /// # Errors
    /// Fails as [`Context::new`] does, or if the device cannot present to the window.
    #[cfg(feature = "view")]
    pub fn for_window(
        options: &ContextOptions,
        window: Arc<dyn super::WindowHandles>,
    ) -> Result<(Arc<Self>, super::WindowSurface), GpuError> {
        let instance = Instance::with_extensions(options.validate, &super::WindowSurface::extensions(&*window)?)?;
        let surface = super::WindowSurface::new(&instance, window)?;
        let (physical, info) =
            select(&instance, options.device.as_ref(), |device| surface.is_served_by(&instance, device))?;
        Ok((Self::open(instance, physical, info, Purpose::Window, &options.overrides)?, surface))
    }

    /// Opens a device with the driver's own ray tracing, with which kdray is compared.
    ///
    /// # Errors
    /// Fails as [`Context::new`] does, or if the device lacks a ray tracing extension.
    pub fn with_ray_tracing(options: &ContextOptions) -> Result<Arc<Self>, GpuError> {
        let instance = Instance::new(options.validate)?;
        let (physical, info) = select(&instance, options.device.as_ref(), |_| true)?;
        if let Some(missing) = RayTracingCalls::missing(&instance, physical) {
            return Err(GpuError::Lacks { device: info.name, missing });
        }
        Self::open(instance, physical, info, Purpose::RayTracing, &options.overrides)
    }

    fn open(
        instance: Arc<Instance>,
        physical: vk::PhysicalDevice,
        info: DeviceInfo,
        purpose: Purpose,
        overrides: &DeviceOverrides,
    ) -> Result<Arc<Self>, GpuError> {
        // SAFETY: the physical device belongs to the instance.
        let families = unsafe { instance.raw.get_physical_device_queue_family_properties(physical) };
        let family = queue_family(&families).expect("`select` refuses a device without such a queue");
        let extras = DeviceExtras::of(&instance, physical, purpose)
            .map_err(GpuError::call("vkEnumerateDeviceExtensionProperties", &info.name))?
            .with_bounds_checks(overrides.bounds_checks);
        let device = extras
            .create_device(&instance, physical, family as u32)
            .map_err(GpuError::call("vkCreateDevice", &info.name))?;
        // SAFETY: the device was created with one queue of this family.
        let queue = unsafe { device.get_device_queue(family as u32, 0) };
        let opened = Opened { physical, device, queue, family, info, extras, is_given: false };
        Self::with_device(instance, opened, purpose, overrides)
    }

    /// Opens a context on the caller's device. [`Context::on_given`](Self::on_given) states the conditions.
    pub(super) fn open_given(given: GivenDevice, overrides: &DeviceOverrides) -> Result<Arc<Self>, GpuError> {
        let instance = Instance::given(given.entry, given.instance);
        let (physical, info) = list(&instance)?
            .into_iter()
            .find(|(physical, _)| *physical == given.physical)
            .ok_or_else(|| GpuError::NoSuchDevice { wanted: "given".into(), available: "others".into() })?;
        if !info.missing.is_empty() {
            return Err(GpuError::Lacks { device: info.name, missing: info.missing.join(", ") });
        }
        let opened = Opened {
            physical,
            device: given.device,
            queue: given.queue,
            family: given.queue_family as usize,
            info,
            extras: DeviceExtras::of_given(given.int64_atomics),
            is_given: true,
        };
        Self::with_device(instance, opened, Purpose::Compute, overrides)
    }

    fn with_device(
        instance: Arc<Instance>,
        opened: Opened,
        purpose: Purpose,
        overrides: &DeviceOverrides,
    ) -> Result<Arc<Self>, GpuError> {
        let Opened { physical, device, queue, family, info, extras, is_given } = opened;
        let ray_tracing = purpose == Purpose::RayTracing;
        // SAFETY: the physical device belongs to the instance, and the device has a queue of this family.
        let (families, properties, command_pool, pipeline_cache) = unsafe {
            let pool = vk::CommandPoolCreateInfo::default()
                .queue_family_index(family as u32)
                .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
            (
                instance.raw.get_physical_device_queue_family_properties(physical),
                instance.raw.get_physical_device_properties(physical),
                device.create_command_pool(&pool, None).map_err(GpuError::call("vkCreateCommandPool", "kdray"))?,
                (device.create_pipeline_cache(&vk::PipelineCacheCreateInfo::default(), None))
                    .map_err(GpuError::call("vkCreatePipelineCache", "kdray"))?,
            )
        };
        let allocator = create_allocator(&instance, &device, physical)?;
        Ok(Arc::new(Self {
            ray_tracing: ray_tracing.then(|| RayTracingCalls::new(&instance, physical, &device)),
            has_labels: !instance.validates(),
            unchecked: extras.unchecked,
            int64_atomics: extras.int64_atomics && !overrides.no_int64_atomics,
            statistics: extras.statistics.then(|| StatisticsCalls::new(&instance, &device)),
            debug_utils: instance.has_debug_utils.then(|| ext::debug_utils::Device::new(&instance.raw, &device)),
            presentation: (purpose == Purpose::Window).then(|| khr::swapchain::Device::new(&instance.raw, &device)),
            device,
            #[cfg(feature = "view")]
            physical,
            command_pool,
            pipeline_cache,
            layouts: Mutex::default(),
            timestamp_period_ns: properties.limits.timestamp_period,
            timestamp_valid_bits: families[family].timestamp_valid_bits,
            queue,
            allocator: ManuallyDrop::new(Arc::new(Mutex::new(allocator))),
            predicates_branches: info.is_software() && overrides.n_lanes.is_none(),
            info,
            fuses_fma: OnceLock::new(),
            n_lanes: overrides.n_lanes.map_or_else(OnceLock::new, OnceLock::from),
            overrides: *overrides,
            loop_limit: overrides.loop_limit.map_or_else(OnceLock::new, |limit| OnceLock::from(Some(limit))),
            failure_injection: FailureInjection::never(),
            #[cfg(feature = "hot-reload")]
            replacements: Mutex::default(),
            limits: Limits::of(&instance, physical).reduced_to(overrides),
            left_commands: Mutex::default(),
            is_given,
            instance,
        }))
    }

    /// Describes the device.
    pub fn info(&self) -> &DeviceInfo {
        &self.info
    }

    /// Returns the device's limits, against which sizes are checked.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Whether the driver computes on the CPU.
    pub fn is_software(&self) -> bool {
        self.info.is_software()
    }

    /// Whether the driver predicates branches: if any lane takes a side of a branch, all lanes execute that side.
    /// Software drivers do.
    pub fn predicates_branches(&self) -> bool {
        self.predicates_branches
    }

    /// Whether the device's queue writes timestamps.
    pub fn has_timestamps(&self) -> bool {
        self.timestamp_valid_bits > 0
    }

    /// Whether kernels have 64-bit atomics on buffers.
    pub fn has_int64_atomics(&self) -> bool {
        self.int64_atomics
    }

    /// Checks that kernels have 64-bit atomics on buffers.
    ///
    /// # Errors
    /// Kernels have no such atomics.
    pub fn require_int64_atomics(&self) -> Result<(), GpuError> {
        let missing = "shaderBufferInt64Atomics".to_owned();
        if self.int64_atomics { Ok(()) } else { Err(GpuError::Lacks { device: self.info.name.clone(), missing }) }
    }

    /// Whether `fma` rounds once in this device's kernels. The first call runs a kernel to find out.
    ///
    /// # Errors
    /// The kernel does not run.
    pub fn fuses_fma(self: &Arc<Self>) -> Result<bool, GpuError> {
        if let Some(&fuses) = self.fuses_fma.get() {
            return Ok(fuses);
        }
        let fuses = probe::fuses_fma(self)?;
        Ok(*self.fuses_fma.get_or_init(|| fuses))
    }

    /// Returns the number of lanes (invocations) that are resident on the device at once, in all subgroups together.
    /// The first call runs a kernel to find out. The result is 0 if the driver predicates branches: lanes are then
    /// SIMD lanes of the CPU, and to leave some of them idle saves no time.
    ///
    /// # Errors
    /// The kernel does not run.
    pub fn n_lanes(self: &Arc<Self>) -> Result<u32, GpuError> {
        if let Some(&n_lanes) = self.n_lanes.get() {
            return Ok(n_lanes);
        }
        let n_lanes = if self.predicates_branches { 0 } else { probe::n_lanes(self)? };
        Ok(*self.n_lanes.get_or_init(|| n_lanes))
    }

    /// Returns the number of turns (iterations) that all loops of a kernel may take together. Beyond it, the driver
    /// ends the kernel without an error. `None` if there is no limit. The first call runs a kernel to find out. Only
    /// software drivers are tested: a GPU executes a loop as branches of the kernel's own code, and nothing counts
    /// the branches.
    ///
    /// # Errors
    /// The kernel does not run.
    pub fn loop_limit(self: &Arc<Self>) -> Result<Option<u32>, GpuError> {
        if let Some(&limit) = self.loop_limit.get() {
            return Ok(limit);
        }
        let limit = if self.is_software() { probe::loop_limit(self)? } else { None };
        Ok(*self.loop_limit.get_or_init(|| limit))
    }

    /// Returns the properties that tests substitute for the device's own.
    pub(crate) fn overrides(&self) -> &DeviceOverrides {
        &self.overrides
    }

    /// Returns the validation layer's messages so far. There are none without validation.
    pub fn validation_messages(&self) -> Vec<String> {
        self.instance.messages()
    }

    /// Records commands, submits them and waits for their end. Uploads, downloads, probes and tests use it.
    ///
    /// # Errors
    /// Out of memory; a call fails.
    pub fn run(self: &Arc<Self>, name: &str, record: impl FnOnce(&Commands)) -> Result<(), GpuError> {
        let buffer = CommandBuffer::record(self, name, None, record)?;
        self.submit(&[&buffer])?;
        self.wait()
    }

    /// Submits command buffers in order. Each is in a `VkSubmitInfo2` of its own, because a driver's watchdog times
    /// each of these separately. One `vkQueueSubmit2` takes all of them, because a call for each would cost 6 us per
    /// command buffer on an H200. If the call fails, no command buffer has begun.
    pub fn submit(&self, buffers: &[&CommandBuffer]) -> Result<(), GpuError> {
        let infos: Vec<_> = (buffers.iter())
            .map(|buffer| [vk::CommandBufferSubmitInfo::default().command_buffer(buffer.raw())])
            .collect();
        let submits: Vec<_> = infos.iter().map(|info| vk::SubmitInfo2::default().command_buffer_infos(info)).collect();
        let names = || buffers.iter().map(|buffer| buffer.name()).collect::<Vec<_>>().join(", ");
        // SAFETY: the buffers are recorded, and their owner keeps them until `wait` has returned.
        unsafe { self.device.queue_submit2(self.queue, &submits, vk::Fence::null()) }
            .map_err(|error| GpuError::call("vkQueueSubmit2", &names())(error))
    }

    /// Submits a command buffer of copies, and does not wait for its end. The copies wait for the point `after` and
    /// signal the point `then`. Without `then`, only [`Context::wait`] tells when they have ended.
    ///
    /// # Errors
    /// The call fails: the commands have not begun.
    pub fn submit_copies(
        &self,
        buffer: CommandBuffer,
        after: Option<TimelinePoint>,
        then: Option<TimelinePoint>,
    ) -> Result<(), GpuError> {
        let semaphore = |point: TimelinePoint| {
            vk::SemaphoreSubmitInfo::default()
                .semaphore(point.semaphore)
                .value(point.value)
                .stage_mask(vk::PipelineStageFlags2::COPY)
        };
        let (waits, signals) = (after.map(semaphore), then.map(semaphore));
        let commands = [vk::CommandBufferSubmitInfo::default().command_buffer(buffer.raw())];
        let submits = [vk::SubmitInfo2::default()
            .wait_semaphore_infos(waits.as_slice())
            .command_buffer_infos(&commands)
            .signal_semaphore_infos(signals.as_slice())];
        // SAFETY: the buffer is recorded, and the context keeps it until the queue is idle; whoever made the points
        // has guaranteed that their semaphores are valid.
        unsafe { self.device.queue_submit2(self.queue, &submits, vk::Fence::null()) }
            .map_err(GpuError::call("vkQueueSubmit2", buffer.name()))?;
        buffer.leave();
        Ok(())
    }

    /// Takes over a submitted command buffer, and frees it once the queue is idle.
    pub(super) fn leave_commands(&self, raw: vk::CommandBuffer) {
        self.left_commands.lock().unwrap_or_else(PoisonError::into_inner).push(raw);
    }

    /// Waits until all submitted work has ended, and frees the command buffers that have no owner.
    pub fn wait(&self) -> Result<(), GpuError> {
        // SAFETY: the queue is used by one thread at a time.
        unsafe { self.device.queue_wait_idle(self.queue) }
            .map_err(GpuError::call("vkQueueWaitIdle", &self.info.name))?;
        let left = std::mem::take(&mut *self.left_commands.lock().unwrap_or_else(PoisonError::into_inner));
        if !left.is_empty() {
            // SAFETY: the queue has ended all work.
            unsafe { self.device.free_command_buffers(self.command_pool, &left) };
        }
        Ok(())
    }

    /// Returns the shader stages that see bindings and push constants.
    pub(super) fn stages(&self) -> vk::ShaderStageFlags {
        let mut stages = vk::ShaderStageFlags::COMPUTE | vk::ShaderStageFlags::VERTEX | vk::ShaderStageFlags::FRAGMENT;
        if self.ray_tracing.is_some() {
            stages |= vk::ShaderStageFlags::RAYGEN_KHR;
        }
        stages
    }

    /// Names a handle for debuggers and the validation layer.
    pub(super) fn set_name(&self, handle: impl vk::Handle, name: &str) {
        let (Some(debug_utils), Ok(name)) = (&self.debug_utils, CString::new(name)) else { return };
        let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(handle).object_name(&name);
        // SAFETY: the handle belongs to this device. An error is ignored, since a missing name does no harm.
        let _ = unsafe { debug_utils.set_debug_utils_object_name(&info) };
    }
}

impl Drop for Context {
    fn drop(&mut self) {
        // SAFETY: every object made from the context holds it, so none is left; the allocator is dropped before the
        // device.
        unsafe {
            // A given device may have other queues, for which kdray must not wait.
            let _ =
                if self.is_given { self.device.queue_wait_idle(self.queue) } else { self.device.device_wait_idle() };
            ManuallyDrop::drop(&mut self.allocator);
            let layouts = std::mem::take(&mut *self.layouts.lock().unwrap_or_else(PoisonError::into_inner));
            layouts.into_iter().for_each(|layouts| layouts.destroy(&self.device));
            self.device.destroy_pipeline_cache(self.pipeline_cache, None);
            self.device.destroy_command_pool(self.command_pool, None);
            if !self.is_given {
                self.device.destroy_device(None);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With labels, Debian 12's validation layer ends the process after some ten thousand command buffers on a busy
    /// machine.
    #[test]
    fn commands_have_no_labels_under_validation() {
        let validated = Context::new(&ContextOptions::new(None, true)).expect("a device with validation");
        assert!(validated.debug_utils.is_some() && !validated.has_labels);
        let plain = Context::new(&ContextOptions::new(None, false)).expect("a device");
        assert!(plain.has_labels);
    }
}
