//! A device in use: its queue, its memory, its limits.

use std::{
    ffi::CString,
    mem::ManuallyDrop,
    sync::{Arc, Mutex, OnceLock, PoisonError},
};

use ash::{ext, khr, vk};
use gpu_allocator::vulkan::Allocator;

use super::{
    Commands, DeviceInfo, DeviceOverrides, DeviceSelector, GivenDevice, GpuError, Limits, TimelinePoint,
    commands::CommandBuffer,
    device::{DeviceExtras, Purpose},
    devices::{list, queue_family, select},
    instance::Instance,
    memory::create_allocator,
    probe,
    ray_tracing::RayTracingCalls,
    refusal::Refusal,
    statistics::StatisticsCalls,
};

/// Which device to use, and how.
#[derive(Clone, Debug, Default)]
pub struct ContextOptions {
    /// None: the best GPU, a software driver where there is none.
    pub device: Option<DeviceSelector>,
    /// Run under the Khronos validation layer with synchronization validation. Commands have no debug labels then.
    pub validate: bool,
    /// What the device is taken for in tests.
    #[doc(hidden)]
    pub pretend: DeviceOverrides,
}

impl ContextOptions {
    /// The best device, or the selected one, under the validation layer if `validate` says so.
    pub fn new(device: Option<DeviceSelector>, validate: bool) -> Self {
        Self { device, validate, pretend: DeviceOverrides::default() }
    }
}

/// [`DeviceInfo::kind`] of a driver that computes on the CPU.
const SOFTWARE: &str = "CPU";

/// A Vulkan device with one queue for graphics and compute.
pub struct Context {
    pub(super) device: ash::Device,
    pub(super) debug_utils: Option<ext::debug_utils::Device>,
    /// Whether commands get debug labels. Not under the validation layer: that of Debian 12 (1.3.239) corrupts its heap after
    /// some ten thousand labelled command buffers.
    pub(super) has_labels: bool,
    pub(super) command_pool: vk::CommandPool,
    pub(super) timestamp_period_ns: f32,
    pub(super) timestamp_valid_bits: u32,
    pub(super) ray_tracing: Option<RayTracingCalls>,
    /// None where the device lacks the extension.
    pub(super) statistics: Option<StatisticsCalls>,
    /// Kernels can do without bounds checks.
    pub(super) unchecked: bool,
    wide_atomics: bool,
    /// None where the device was opened without a window.
    pub(super) presentation: Option<khr::swapchain::Device>,
    #[cfg(feature = "view")]
    pub(super) physical: vk::PhysicalDevice,
    pub(super) queue: vk::Queue,
    /// Shared with the overlay's renderer, which ends before the context.
    pub(super) allocator: ManuallyDrop<Arc<Mutex<Allocator>>>,
    info: DeviceInfo,
    predicates_branches: bool,
    limits: Limits,
    fuses_fma: OnceLock<bool>,
    n_lanes: OnceLock<u32>,
    loop_limit: OnceLock<Option<u32>>,
    pretend: DeviceOverrides,
    pub(super) refusal: Refusal,
    #[cfg(feature = "hot-reload")]
    pub(super) replacements: Mutex<super::Replacements>,
    /// Command buffers that nobody waits for, freed when the queue is idle.
    left_commands: Mutex<Vec<vk::CommandBuffer>>,
    /// The caller of the library destroys the device.
    is_given: bool,
    instance: Arc<Instance>,
}

/// A device that is open, and what is known of it.
struct Opened {
    physical: vk::PhysicalDevice,
    device: ash::Device,
    queue: vk::Queue,
    /// The index of the queue's family.
    family: usize,
    info: DeviceInfo,
    extras: DeviceExtras,
    is_given: bool,
}

impl Context {
    /// Opens a device.
    ///
    /// # Errors
    /// No loader, driver, device of that name or validation layer; a device that lacks a feature; a failed call.
    pub fn new(options: &ContextOptions) -> Result<Arc<Self>, GpuError> {
        let instance = Instance::new(options.validate)?;
        let (physical, info) = select(&instance, options.device.as_ref(), |_| true)?;
        Self::open(instance, physical, info, Purpose::Compute, &options.pretend)
    }

    /// As [`Context::new`], with the surface of a window that it can show pictures in.
    ///
    /// # Errors
    /// As [`Context::new`]; a device that cannot present to the window.
    #[cfg(feature = "view")]
    pub fn for_window(
        options: &ContextOptions,
        window: Arc<dyn super::Screen>,
    ) -> Result<(Arc<Self>, super::Surface), GpuError> {
        let instance = Instance::with_extensions(options.validate, &super::Surface::extensions(&*window)?)?;
        let surface = super::Surface::new(&instance, window)?;
        let (physical, info) =
            select(&instance, options.device.as_ref(), |device| surface.is_served_by(&instance, device))?;
        Ok((Self::open(instance, physical, info, Purpose::Window, &options.pretend)?, surface))
    }

    /// As [`Context::new`], with the driver's own ray tracing, to compare with.
    ///
    /// # Errors
    /// As [`Context::new`]; the device lacks that extension.
    pub fn with_ray_tracing(options: &ContextOptions) -> Result<Arc<Self>, GpuError> {
        let instance = Instance::new(options.validate)?;
        let (physical, info) = select(&instance, options.device.as_ref(), |_| true)?;
        if let Some(missing) = RayTracingCalls::missing(&instance, physical) {
            return Err(GpuError::Lacks { device: info.name, missing });
        }
        Self::open(instance, physical, info, Purpose::RayTracing, &options.pretend)
    }

    fn open(
        instance: Arc<Instance>,
        physical: vk::PhysicalDevice,
        info: DeviceInfo,
        purpose: Purpose,
        pretend: &DeviceOverrides,
    ) -> Result<Arc<Self>, GpuError> {
        // SAFETY: the device belongs to the instance.
        let families = unsafe { instance.raw.get_physical_device_queue_family_properties(physical) };
        let family = queue_family(&families).expect("`select` refuses a device without such a queue");
        let extras = DeviceExtras::of(&instance, physical, purpose)
            .map_err(GpuError::call("vkEnumerateDeviceExtensionProperties", &info.name))?;
        let device = extras
            .create_device(&instance, physical, family as u32)
            .map_err(GpuError::call("vkCreateDevice", &info.name))?;
        // SAFETY: the queue was asked for at creation.
        let queue = unsafe { device.get_device_queue(family as u32, 0) };
        let opened = Opened { physical, device, queue, family, info, extras, is_given: false };
        Self::with_device(instance, opened, purpose, pretend)
    }

    /// For [`Context::on_given`](Self::on_given), which says what must hold.
    pub(super) fn open_given(given: GivenDevice, pretend: &DeviceOverrides) -> Result<Arc<Self>, GpuError> {
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
            extras: DeviceExtras::of_given(given.wide_atomics),
            is_given: true,
        };
        Self::with_device(instance, opened, Purpose::Compute, pretend)
    }

    fn with_device(
        instance: Arc<Instance>,
        opened: Opened,
        purpose: Purpose,
        pretend: &DeviceOverrides,
    ) -> Result<Arc<Self>, GpuError> {
        let Opened { physical, device, queue, family, info, extras, is_given } = opened;
        let ray_tracing = purpose == Purpose::RayTracing;
        // SAFETY: the device belongs to the instance; the pool belongs to its family.
        let (families, properties, command_pool) = unsafe {
            let pool = vk::CommandPoolCreateInfo::default()
                .queue_family_index(family as u32)
                .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
            (
                instance.raw.get_physical_device_queue_family_properties(physical),
                instance.raw.get_physical_device_properties(physical),
                device.create_command_pool(&pool, None).map_err(GpuError::call("vkCreateCommandPool", "kdray"))?,
            )
        };
        let allocator = create_allocator(&instance, &device, physical)?;
        Ok(Arc::new(Self {
            ray_tracing: ray_tracing.then(|| RayTracingCalls::new(&instance, physical, &device)),
            has_labels: !instance.validates(),
            unchecked: extras.unchecked,
            wide_atomics: extras.wide_atomics && !pretend.no_wide_atomics,
            statistics: extras.statistics.then(|| StatisticsCalls::new(&instance, &device)),
            debug_utils: instance.has_debug_utils.then(|| ext::debug_utils::Device::new(&instance.raw, &device)),
            presentation: (purpose == Purpose::Window).then(|| khr::swapchain::Device::new(&instance.raw, &device)),
            device,
            #[cfg(feature = "view")]
            physical,
            command_pool,
            timestamp_period_ns: properties.limits.timestamp_period,
            timestamp_valid_bits: families[family].timestamp_valid_bits,
            queue,
            allocator: ManuallyDrop::new(Arc::new(Mutex::new(allocator))),
            predicates_branches: info.kind == SOFTWARE && pretend.n_lanes.is_none(),
            info,
            fuses_fma: OnceLock::new(),
            n_lanes: pretend.n_lanes.map_or_else(OnceLock::new, OnceLock::from),
            pretend: *pretend,
            loop_limit: pretend.loop_limit.map_or_else(OnceLock::new, |limit| OnceLock::from(Some(limit))),
            refusal: Refusal::never(),
            #[cfg(feature = "hot-reload")]
            replacements: Mutex::default(),
            limits: Limits::of(&instance, physical).reduced_to(pretend),
            left_commands: Mutex::default(),
            is_given,
            instance,
        }))
    }

    /// What the device is.
    pub fn info(&self) -> &DeviceInfo {
        &self.info
    }

    /// The limits that sizes are held against.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// True for a driver that computes on the CPU.
    pub fn is_software(&self) -> bool {
        self.info.kind == SOFTWARE
    }

    /// Whether kernels run both sides of a branch for all lanes, where any lane takes it.
    pub fn predicates_branches(&self) -> bool {
        self.predicates_branches
    }

    /// Whether the device writes timestamps.
    pub fn has_timestamps(&self) -> bool {
        self.timestamp_valid_bits > 0
    }

    /// Whether kernels have atomics of 64 bits.
    pub fn has_wide_atomics(&self) -> bool {
        self.wide_atomics
    }

    /// # Errors
    /// Kernels have no atomics of 64 bits.
    pub fn require_wide_atomics(&self) -> Result<(), GpuError> {
        let missing = "shaderBufferInt64Atomics".to_owned();
        if self.wide_atomics { Ok(()) } else { Err(GpuError::Lacks { device: self.info.name.clone(), missing }) }
    }

    /// Whether `fma` rounds once in this device's kernels; found out by one of them, the first time.
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

    /// How many lanes the device runs at once; found out by a kernel, the first time. 0 where lanes are not the device's
    /// own, so that leaving some of them idle spares nothing.
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

    /// How many turns the loops of a kernel may take together before the driver ends it without a word; none where they
    /// may take any number. A kernel finds that out the first time. Only drivers that compute on the CPU are asked: a
    /// GPU's loops are branches of its own code, which nothing counts.
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

    /// What tests make of the device.
    pub(crate) fn pretend(&self) -> &DeviceOverrides {
        &self.pretend
    }

    /// What the validation layer has said so far; empty without validation.
    pub fn validation_messages(&self) -> Vec<String> {
        self.instance.messages()
    }

    /// Records commands, runs them and waits for their end. For uploads, downloads and tests.
    pub fn run(self: &Arc<Self>, name: &str, record: impl FnOnce(&Commands)) -> Result<(), GpuError> {
        let buffer = CommandBuffer::record(self, name, None, record)?;
        self.submit(&[&buffer])?;
        self.wait()
    }

    /// Starts command buffers in order, a submit each: a driver's watchdog looks at submits. One call for all of them, which
    /// otherwise cost an H200 6 us each. Where that fails, none has begun.
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

    /// Starts a command buffer of copies between two values of timeline semaphores, and does not wait for its end. Without
    /// `then`, nothing says when it has ended but [`Context::wait`].
    ///
    /// # Errors
    /// A failed call: the commands have not begun.
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
        // SAFETY: the buffer is recorded, and is left to the context until the queue is idle; whoever made the points
        // vouches for the semaphores.
        unsafe { self.device.queue_submit2(self.queue, &submits, vk::Fence::null()) }
            .map_err(GpuError::call("vkQueueSubmit2", buffer.name()))?;
        buffer.leave();
        Ok(())
    }

    /// Takes over a command buffer that was submitted.
    pub(super) fn leave_commands(&self, raw: vk::CommandBuffer) {
        self.left_commands.lock().unwrap_or_else(PoisonError::into_inner).push(raw);
    }

    /// Waits until all that was submitted has ended.
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

    /// Shader stages that see bindings and push constants.
    pub(super) fn stages(&self) -> vk::ShaderStageFlags {
        let mut stages = vk::ShaderStageFlags::COMPUTE | vk::ShaderStageFlags::VERTEX;
        if self.ray_tracing.is_some() {
            stages |= vk::ShaderStageFlags::RAYGEN_KHR;
        }
        if self.presentation.is_some() {
            stages |= vk::ShaderStageFlags::FRAGMENT;
        }
        stages
    }

    /// Gives a handle its name in the debuggers' and the validation layer's eyes.
    pub(super) fn set_name(&self, handle: impl vk::Handle, name: &str) {
        let (Some(debug_utils), Ok(name)) = (&self.debug_utils, CString::new(name)) else { return };
        let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(handle).object_name(&name);
        // SAFETY: the handle is one of this device's. A name that is not taken is no loss.
        let _ = unsafe { debug_utils.set_debug_utils_object_name(&info) };
    }
}

impl Drop for Context {
    fn drop(&mut self) {
        // SAFETY: every object made from the context holds it, so none is left; the allocator goes before the device.
        unsafe {
            // Other queues of a given device are not kdray's to wait for.
            let _ =
                if self.is_given { self.device.queue_wait_idle(self.queue) } else { self.device.device_wait_idle() };
            ManuallyDrop::drop(&mut self.allocator);
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

    /// With labels, the layer of Debian 12 ends the process after some ten thousand command buffers on a busy machine.
    #[test]
    fn commands_have_no_labels_under_validation() {
        let validated = Context::new(&ContextOptions::new(None, true)).expect("a device with validation");
        assert!(validated.debug_utils.is_some() && !validated.has_labels);
        let plain = Context::new(&ContextOptions::new(None, false)).expect("a device");
        assert!(plain.has_labels);
    }
}
