//! A program's own device, with as little Vulkan as the examples need.

use std::{error::Error, sync::Arc};

use ash::vk;
use kdray::gpu::{ExternalDevice, RequiredFeatures};

/// The program's device.
pub struct Program {
    entry: ash::Entry,
    instance: ash::Instance,
    physical: vk::PhysicalDevice,
    pub device: ash::Device,
    queue_family: u32,
    queue: vk::Queue,
    commands: vk::CommandPool,
    pub timeline: vk::Semaphore,
}

impl Program {
    /// Creates an instance, and a device with the features that kdray requires.
    pub unsafe fn new() -> Result<Self, Box<dyn Error>> {
        // SAFETY: the structs that the calls read live until they return.
        unsafe {
            let entry = ash::Entry::load()?;
            let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_3);
            let info = vk::InstanceCreateInfo::default().application_info(&application);
            let instance = entry.create_instance(&info, None)?;
            let (physical, queue_family) = choose_device(&instance).ok_or("no device with graphics and compute")?;
            let RequiredFeatures { of_1_0, of_1_2, mut of_1_3 } = RequiredFeatures::new(false);
            // This program needs this feature in addition to those that kdray requires.
            let mut of_1_2 = of_1_2.timeline_semaphore(true);
            let queues =
                [vk::DeviceQueueCreateInfo::default().queue_family_index(queue_family).queue_priorities(&[1.0])];
            let info = vk::DeviceCreateInfo::default()
                .queue_create_infos(&queues)
                .enabled_features(&of_1_0)
                .push_next(&mut of_1_2)
                .push_next(&mut of_1_3);
            let device = instance.create_device(physical, &info, None)?;
            let pool = vk::CommandPoolCreateInfo::default().queue_family_index(queue_family);
            let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
            let semaphore = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
            Ok(Self {
                commands: device.create_command_pool(&pool, None)?,
                timeline: device.create_semaphore(&semaphore, None)?,
                queue: device.get_device_queue(queue_family, 0),
                entry,
                instance,
                physical,
                device,
                queue_family,
            })
        }
    }

    /// Returns the device in the form in which kdray takes it.
    pub fn external(&self) -> ExternalDevice {
        ExternalDevice {
            entry: self.entry.clone(),
            instance: self.instance.clone(),
            physical: self.physical,
            device: self.device.clone(),
            queue_family: self.queue_family,
            queue: self.queue,
            queue_lock: Arc::default(), // the program has one thread
            int64_atomics: false,
        }
    }

    /// Records a command buffer.
    pub unsafe fn record(&self, body: impl FnOnce(vk::CommandBuffer)) -> Result<vk::CommandBuffer, vk::Result> {
        let info = vk::CommandBufferAllocateInfo::default().command_pool(self.commands).command_buffer_count(1);
        // SAFETY: the pool is the program's.
        unsafe {
            let buffer = self.device.allocate_command_buffers(&info)?[0];
            self.device.begin_command_buffer(buffer, &vk::CommandBufferBeginInfo::default())?;
            body(buffer);
            self.device.end_command_buffer(buffer)?;
            Ok(buffer)
        }
    }

    /// Submits a command buffer. It waits for the timeline's value `after`, and signals `then`.
    pub unsafe fn submit(
        &self,
        buffer: &vk::CommandBuffer,
        after: Option<u64>,
        then: Option<u64>,
    ) -> Result<(), vk::Result> {
        let point = |value| {
            vk::SemaphoreSubmitInfo::default()
                .semaphore(self.timeline)
                .value(value)
                .stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
        };
        let (after, then) = (after.map(point), then.map(point));
        let buffers = [vk::CommandBufferSubmitInfo::default().command_buffer(*buffer)];
        let submit = vk::SubmitInfo2::default()
            .wait_semaphore_infos(after.as_slice())
            .command_buffer_infos(&buffers)
            .signal_semaphore_infos(then.as_slice());
        // SAFETY: the buffer is recorded, and the semaphore is the program's.
        unsafe { self.device.queue_submit2(self.queue, &[submit], vk::Fence::null()) }
    }

    /// Waits on the host for a value of the timeline.
    pub unsafe fn wait_for(&self, value: u64) -> Result<(), vk::Result> {
        let (semaphores, values) = ([self.timeline], [value]);
        let info = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
        // SAFETY: the semaphore is the program's.
        unsafe { self.device.wait_semaphores(&info, u64::MAX) }
    }

    /// Allocates memory with the properties `wanted`. The caller binds it.
    pub unsafe fn allocate(
        &self,
        requirements: &vk::MemoryRequirements,
        wanted: vk::MemoryPropertyFlags,
    ) -> Result<vk::DeviceMemory, Box<dyn Error>> {
        // SAFETY: the device is the program's.
        unsafe {
            let memory = self.instance.get_physical_device_memory_properties(self.physical);
            let is_right = |ix: &u32| {
                requirements.memory_type_bits >> ix & 1 == 1
                    && memory.memory_types[*ix as usize].property_flags.contains(wanted)
            };
            let kind = (0..memory.memory_type_count).find(is_right).ok_or("no memory of this kind")?;
            let info = vk::MemoryAllocateInfo::default().allocation_size(requirements.size).memory_type_index(kind);
            Ok(self.device.allocate_memory(&info, None)?)
        }
    }

    pub unsafe fn destroy(self) {
        // SAFETY: the program has waited for all its work.
        unsafe {
            self.device.destroy_semaphore(self.timeline, None);
            self.device.destroy_command_pool(self.commands, None);
            self.device.destroy_device(None);
            self.instance.destroy_instance(None);
        }
    }
}

/// Returns the first device that has a queue for graphics and compute, and the queue's family.
unsafe fn choose_device(instance: &ash::Instance) -> Option<(vk::PhysicalDevice, u32)> {
    let both = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
    // SAFETY: the instance is alive.
    unsafe {
        instance.enumerate_physical_devices().ok()?.into_iter().find_map(|physical| {
            let families = instance.get_physical_device_queue_family_properties(physical);
            let family = families.iter().position(|family| family.queue_flags.contains(both))?;
            Some((physical, family as u32))
        })
    }
}
