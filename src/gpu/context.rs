//! The context: an open Vulkan device with its queues, its memory and its limits.

use std::sync::{Arc, Mutex, OnceLock};

use ash::vk;

use super::{
    AnyBuffer, CommandBuffer, Commands, DeviceInfo, DeviceOverrides, DeviceSelector, ExternalDevice, GpuError, Limits,
    Submission, TimelinePoint,
    devices::{copy_family, list, queue_family, select},
    extras::{DeviceExtras, Purpose},
    instance::Instance,
    pipeline::Made,
    probe,
    queue::Queue,
    raw_device::{Opened, RawDevice},
    ray_tracing::RayTracingCalls,
};

/// Options of a context: which device it opens, and how.
#[derive(Clone, Debug, Default)]
pub struct ContextOptions {
    /// The device to open. `None` selects the best GPU, or a software driver if there is no GPU.
    pub device: Option<DeviceSelector>,
    /// Whether the Khronos validation layer runs, with synchronization validation. Commands then have no debug
    /// labels.
    pub validate: bool,
    /// Whether a discrete GPU that has a queue for copies alone is opened with it, too. Streams of bare rays and hits
    /// ([`GpuCaster::cast_stream`](crate::cast::GpuCaster::cast_stream)) are up to a fifth faster with it, and some
    /// shorter casts slower (docs/experiments.md).
    pub for_streams: bool,
    /// Properties that tests substitute for the device's own.
    #[doc(hidden)]
    pub overrides: DeviceOverrides,
}

impl ContextOptions {
    /// Returns options for the selected device, or for the best one if `device` is `None`. `validate` turns the
    /// validation layer on.
    pub fn new(device: Option<DeviceSelector>, validate: bool) -> Self {
        Self { device, validate, ..Self::default() }
    }
}

/// A Vulkan device with a queue for graphics and compute. All threads may use it at once.
pub struct Context {
    pub(super) device: Arc<RawDevice>,
    pub(super) queue: Queue,
    /// The queue for copies that run while kernels do, if the device was opened for streams and has one.
    copies: Option<Queue>,
    predicates_branches: bool,
    fuses_fma: OnceLock<bool>,
    n_lanes: OnceLock<u32>,
    /// See [`Context::loop_limit`].
    loop_limit: OnceLock<Option<u32>>,
    pub(super) pipelines: Mutex<Made>,
}

impl Context {
    /// Opens a device.
    ///
    /// # Errors
    /// There is no loader, driver, device of that name or validation layer; the device lacks a feature; or a call
    /// fails.
    pub(super) fn new(options: &ContextOptions) -> Result<Arc<Self>, GpuError> {
        let instance = Instance::new(options.validate)?;
        let (physical, info) = select(&instance, options.device.as_ref(), |_| true)?;
        let purpose = if options.for_streams { Purpose::Streams } else { Purpose::Compute };
        Self::open(instance, physical, info, purpose, &options.overrides)
    }

    /// Opens a device and makes the surface of a window, in which the context can show pictures.
    ///
    /// # Errors
    /// Fails as [`Context::new`] does, or if the device cannot present to the window.
    #[cfg(feature = "view")]
    pub(crate) fn for_window(
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
    pub(super) fn with_ray_tracing(options: &ContextOptions) -> Result<Arc<Self>, GpuError> {
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
        let family = queue_family(&families).expect("`select` refuses a device without such a queue") as u32;
        let copies = purpose == Purpose::Streams && info.kind == "discrete GPU";
        let copy_family = copy_family(&families).filter(|_| copies).map(|family| family as u32);
        let extras = DeviceExtras::of(&instance, physical, purpose)
            .map_err(GpuError::call("vkEnumerateDeviceExtensionProperties", &info.name))?
            .with_bounds_checks(overrides.bounds_checks);
        let device = extras
            .create_device(&instance, physical, &[family].into_iter().chain(copy_family).collect::<Vec<_>>())
            .map_err(GpuError::call("vkCreateDevice", &info.name))?;
        // SAFETY: the device was created with one queue of this family.
        let queue_of = |family| unsafe { device.get_device_queue(family, 0) };
        let (queue, copies) = (queue_of(family), copy_family.map(queue_of));
        let opened = Opened { physical, device, family, copy_family, info, extras, is_external: false };
        let device = RawDevice::new(instance, opened, purpose, overrides)?;
        let queue_of = |raw| Queue::new(Arc::clone(&device), raw, None);
        let (queue, copies) = (queue_of(queue), copies.map(queue_of));
        Ok(Self::with_device(device, queue, copies, overrides))
    }

    /// Opens a context on the caller's device.
    ///
    /// # Safety
    /// [`Device::external`](super::Device::external) states the conditions.
    pub unsafe fn on_external(external: ExternalDevice, overrides: &DeviceOverrides) -> Result<Arc<Self>, GpuError> {
        let instance = Instance::external(external.entry, external.instance);
        let (physical, info) = list(&instance)?
            .into_iter()
            .find(|(physical, _)| *physical == external.physical)
            .ok_or_else(|| GpuError::NoSuchDevice { wanted: "external".into(), available: "others".into() })?;
        if !info.missing.is_empty() {
            return Err(GpuError::Lacks { device: info.name, missing: info.missing.join(", ") });
        }
        let opened = Opened {
            physical,
            device: external.device,
            family: external.queue_family,
            copy_family: None,
            info,
            extras: DeviceExtras::of_external(external.int64_atomics),
            is_external: true,
        };
        let device = RawDevice::new(instance, opened, Purpose::Compute, overrides)?;
        let queue = Queue::new(Arc::clone(&device), external.queue, Some(external.queue_lock));
        Ok(Self::with_device(device, queue, None, overrides))
    }

    fn with_device(
        device: Arc<RawDevice>,
        queue: Queue,
        copies: Option<Queue>,
        overrides: &DeviceOverrides,
    ) -> Arc<Self> {
        Arc::new(Self {
            predicates_branches: device.info.is_software() && overrides.n_lanes.is_none(),
            fuses_fma: OnceLock::new(),
            n_lanes: overrides.n_lanes.map_or_else(OnceLock::new, OnceLock::from),
            loop_limit: overrides.loop_limit.map_or_else(OnceLock::new, |limit| OnceLock::from(Some(limit))),
            pipelines: Mutex::default(),
            device,
            queue,
            copies,
        })
    }

    /// Describes the device.
    pub fn info(&self) -> &DeviceInfo {
        &self.device.info
    }

    /// Returns the device's limits, against which sizes are checked.
    pub fn limits(&self) -> &Limits {
        &self.device.limits
    }

    /// Whether the driver computes on the CPU.
    pub fn is_software(&self) -> bool {
        self.device.info.is_software()
    }

    /// Whether the driver predicates branches: if any lane takes a side of a branch, all lanes execute that side.
    /// Software drivers do.
    pub fn predicates_branches(&self) -> bool {
        self.predicates_branches
    }

    /// Whether the device's queue writes timestamps.
    pub fn has_timestamps(&self) -> bool {
        self.device.timestamp_valid_bits > 0
    }

    /// Whether kernels have 64-bit atomics on buffers.
    pub fn has_int64_atomics(&self) -> bool {
        self.device.int64_atomics
    }

    /// Checks that kernels have 64-bit atomics on buffers.
    ///
    /// # Errors
    /// Kernels have no such atomics.
    pub fn require_int64_atomics(&self) -> Result<(), GpuError> {
        let missing = "shaderBufferInt64Atomics".to_owned();
        if self.device.int64_atomics {
            Ok(())
        } else {
            Err(GpuError::Lacks { device: self.device.info.name.clone(), missing })
        }
    }

    /// Whether `fma` rounds once in this device's kernels. The first call runs a kernel to find out.
    ///
    /// # Errors
    /// The kernel does not run.
    pub fn fuses_fma(self: &Arc<Self>) -> Result<bool, GpuError> {
        probed(&self.fuses_fma, || probe::fuses_fma(self))
    }

    /// Returns the number of lanes (invocations) that are resident on the device at once, in all subgroups together.
    /// The first call runs a kernel to find out. The result is 0 if the driver predicates branches: lanes are then
    /// SIMD lanes of the CPU, and to leave some of them idle saves no time.
    ///
    /// # Errors
    /// The kernel does not run.
    pub fn n_lanes(self: &Arc<Self>) -> Result<u32, GpuError> {
        probed(&self.n_lanes, || if self.predicates_branches { Ok(0) } else { probe::n_lanes(self) })
    }

    /// Returns the number of iterations that all loops of a kernel may take together. Beyond it, the driver
    /// ends the kernel without an error. `None` if there is no limit. The first call runs a kernel to find out. Only
    /// software drivers are tested: a GPU executes a loop as branches of the kernel's own code, and nothing counts
    /// the branches.
    ///
    /// # Errors
    /// The kernel does not run.
    pub fn loop_limit(self: &Arc<Self>) -> Result<Option<u32>, GpuError> {
        probed(&self.loop_limit, || if self.is_software() { probe::loop_limit(self) } else { Ok(None) })
    }

    /// Returns the properties that tests substitute for the device's own.
    pub(crate) fn overrides(&self) -> &DeviceOverrides {
        &self.device.overrides
    }

    /// Returns the validation layer's messages so far. There are none without validation.
    pub fn validation_messages(&self) -> Vec<String> {
        self.device.instance.messages()
    }

    /// Whether a call has found the device lost, by any handle of it. All later work fails then.
    pub fn is_lost(&self) -> bool {
        self.queue.is_lost()
    }

    /// Returns the greatest number of submissions that the device had at once, by all threads.
    #[doc(hidden)]
    pub fn most_in_flight(&self) -> u32 {
        self.queue.most_in_flight()
    }

    /// Records commands, submits them and waits for their end. Uploads, downloads, probes and tests use it.
    ///
    /// # Errors
    /// Out of memory; a call fails.
    pub fn run(self: &Arc<Self>, name: &str, record: impl FnOnce(&Commands)) -> Result<(), GpuError> {
        let buffer = CommandBuffer::record(self, name, None, record)?;
        self.wait_for(self.submit(vec![buffer])?)
    }

    /// Whether [`Context::copy_to_input`] is for the inputs of streams: copies run while kernels do, or a test demands
    /// it.
    pub(super) fn copies_inputs(&self) -> bool {
        self.copies.is_some() || self.device.overrides.copies_inputs
    }

    /// Copies bytes to a buffer for [`BufferUse::Input`](super::BufferUse::Input), and waits for the end. The copy runs
    /// on the queue for copies, if there is one. Kernels see it after a barrier.
    ///
    /// # Errors
    /// Fails as [`Context::run`] does.
    pub(super) fn copy_to_input(
        self: &Arc<Self>,
        from: &Arc<AnyBuffer>,
        to: &Arc<AnyBuffer>,
        bytes: u64,
    ) -> Result<(), GpuError> {
        let queue = self.copies.as_ref().unwrap_or(&self.queue);
        let family = self.device.copy_family.unwrap_or(self.device.family);
        let copy = |commands: &Commands| commands.copy_buffer(from, to, bytes);
        let buffer = CommandBuffer::record_for(family, self, "inputs", None, copy)?;
        queue.wait_for(submit_to(queue, vec![buffer])?)
    }

    /// Submits command buffers in order. Each is in a `VkSubmitInfo2` of its own, because a driver's watchdog times
    /// each of these separately. One `vkQueueSubmit2` takes all of them, because a call for each would cost 6 us per
    /// command buffer on an H200. If the call fails, no command buffer has begun.
    pub fn submit(&self, buffers: Vec<CommandBuffer>) -> Result<Submission, GpuError> {
        submit_to(&self.queue, buffers)
    }

    /// Submits a command buffer of copies. The copies wait for the point `after` and signal the point `then`.
    ///
    /// # Errors
    /// The call fails: the commands have not begun.
    pub fn submit_copies(
        &self,
        buffer: CommandBuffer,
        after: Option<TimelinePoint>,
        then: Option<TimelinePoint>,
    ) -> Result<Submission, GpuError> {
        let semaphore = |point: TimelinePoint| {
            vk::SemaphoreSubmitInfo::default()
                .semaphore(point.semaphore)
                .value(point.value)
                .stage_mask(vk::PipelineStageFlags2::COPY)
        };
        let (waits, signals) = (after.map(semaphore), then.map(semaphore));
        let commands = [vk::CommandBufferSubmitInfo::default().command_buffer(buffer.raw())];
        // Whoever made the points has guaranteed that their semaphores are valid.
        let submit_infos = [vk::SubmitInfo2::default()
            .wait_semaphore_infos(waits.as_slice())
            .command_buffer_infos(&commands)
            .signal_semaphore_infos(signals.as_slice())];
        self.queue.submit(&submit_infos, vec![buffer])
    }

    /// Waits until the device has ended a submission.
    ///
    /// # Errors
    /// The device is lost, or memory is exhausted.
    pub fn wait_for(&self, submission: Submission) -> Result<(), GpuError> {
        self.queue.wait_for(submission)
    }

    /// Waits until the device has ended all that any thread has submitted before, but for inputs that are copied, whose
    /// threads wait themselves.
    ///
    /// # Errors
    /// Fails as [`Context::wait_for`] does.
    pub fn wait_for_all(&self) -> Result<(), GpuError> {
        self.queue.wait_for_all()
    }
}

/// Submits command buffers to a queue, each in a `VkSubmitInfo2` of its own.
fn submit_to(queue: &Queue, buffers: Vec<CommandBuffer>) -> Result<Submission, GpuError> {
    let infos: Vec<_> =
        (buffers.iter()).map(|buffer| [vk::CommandBufferSubmitInfo::default().command_buffer(buffer.raw())]).collect();
    let submit_infos: Vec<_> = infos.iter().map(|info| vk::SubmitInfo2::default().command_buffer_infos(info)).collect();
    queue.submit(&submit_infos, buffers)
}

/// Returns the property, which `probe` finds out at the first call.
fn probed<T: Copy>(property: &OnceLock<T>, probe: impl FnOnce() -> Result<T, GpuError>) -> Result<T, GpuError> {
    if let Some(&known) = property.get() {
        return Ok(known);
    }
    let found = probe()?;
    Ok(*property.get_or_init(|| found))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With labels, Debian 12's validation layer ends the process after some ten thousand command buffers on a busy
    /// machine.
    #[test]
    fn commands_have_no_labels_under_validation() {
        let validated = Context::new(&ContextOptions::new(None, true)).expect("a device with validation");
        assert!(validated.device.debug_utils.is_some() && !validated.device.has_labels);
        let plain = Context::new(&ContextOptions::new(None, false)).expect("a device");
        assert!(plain.device.has_labels);
    }
}
