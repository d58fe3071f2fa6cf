//! Extensions and features with which a device is created.

use std::ffi::{CStr, c_char};

use ash::{khr, prelude::VkResult, vk};

use super::{
    RequiredFeatures, instance::Instance, ray_tracing::RayTracingCalls, robustness, statistics::StatisticsCalls,
};

/// Purpose for which a device is opened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Purpose {
    /// The device computes pictures and other results in memory.
    Compute,
    /// The device also copies while kernels run.
    Streams,
    /// The device also runs the driver's own ray tracing, for comparison.
    RayTracing,
    /// The device also shows pictures in a window.
    Window,
}

/// Extensions and optional features with which a device is created.
#[derive(Clone, Copy)]
pub(super) struct DeviceExtras {
    /// Whether `VK_KHR_portability_subset` is enabled, as a driver that is not fully conformant requires.
    portability: bool,
    /// Whether the driver reports statistics of kernels.
    pub statistics: bool,
    /// Whether pipelines can be made without bounds checks.
    pub unchecked: bool,
    /// Whether the device checks the bounds of buffers.
    bounds_checks: bool,
    /// Whether kernels have 64-bit atomics on buffers.
    pub int64_atomics: bool,
    purpose: Purpose,
}

impl DeviceExtras {
    /// Returns all extras that the device has and kdray can use. The extensions and features that `purpose` requires
    /// are included without a test: the caller has chosen a device that has them.
    pub fn of(instance: &Instance, physical: vk::PhysicalDevice, purpose: Purpose) -> VkResult<Self> {
        // SAFETY: the physical device belongs to the instance.
        let available = unsafe { instance.raw.enumerate_device_extension_properties(physical) }?;
        let has = |name: &CStr| available.iter().any(|e| e.extension_name_as_c_str() == Ok(name));
        Ok(Self {
            portability: has(khr::portability_subset::NAME),
            statistics: has(StatisticsCalls::EXTENSION) && StatisticsCalls::has_feature(instance, physical),
            unchecked: has(robustness::EXTENSION) && robustness::has_feature(instance, physical),
            int64_atomics: has_int64_atomics(instance, physical),
            bounds_checks: false,
            purpose,
        })
    }

    /// Returns the extras of a device that checks bounds, if `is_checked`.
    pub fn with_bounds_checks(self, is_checked: bool) -> Self {
        Self { unchecked: self.unchecked && !is_checked, bounds_checks: is_checked, ..self }
    }

    /// Returns the extras of a device that the library's caller has created: at most 64-bit atomics.
    pub fn of_external(int64_atomics: bool) -> Self {
        let (portability, statistics, unchecked, bounds_checks) = Default::default();
        let purpose = Purpose::Compute;
        Self { portability, statistics, unchecked, bounds_checks, int64_atomics, purpose }
    }

    fn extensions(self) -> Vec<*const c_char> {
        let mut names = Vec::new();
        names.extend(self.portability.then_some(khr::portability_subset::NAME));
        names.extend(self.statistics.then_some(StatisticsCalls::EXTENSION));
        names.extend(self.unchecked.then_some(robustness::EXTENSION));
        match self.purpose {
            Purpose::Compute | Purpose::Streams => {}
            Purpose::RayTracing => names.extend(RayTracingCalls::EXTENSIONS),
            Purpose::Window => names.push(khr::swapchain::NAME),
        }
        names.into_iter().map(CStr::as_ptr).collect()
    }

    /// Creates a device with one queue of each family.
    pub fn create_device(
        self,
        instance: &Instance,
        physical: vk::PhysicalDevice,
        families: &[u32],
    ) -> VkResult<ash::Device> {
        let extensions = self.extensions();
        let priorities = [1.0];
        let queue = |family: &u32| {
            vk::DeviceQueueCreateInfo::default().queue_family_index(*family).queue_priorities(&priorities)
        };
        let queues: Vec<_> = families.iter().map(queue).collect();
        let RequiredFeatures { of_1_0, mut of_1_2, mut of_1_3 } = RequiredFeatures::new(self.int64_atomics);
        // Every device has this feature.
        let of_1_0 = of_1_0.robust_buffer_access(self.bounds_checks);
        let mut executables =
            vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default().pipeline_executable_info(true);
        let mut unchecked = vk::PhysicalDevicePipelineRobustnessFeaturesEXT::default().pipeline_robustness(true);
        let mut structures = vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default().acceleration_structure(true);
        let mut pipelines = vk::PhysicalDeviceRayTracingPipelineFeaturesKHR::default().ray_tracing_pipeline(true);
        let mut create = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&extensions)
            .push_next(&mut of_1_3)
            .enabled_features(&of_1_0)
            .push_next(&mut of_1_2);
        if self.statistics {
            create = create.push_next(&mut executables);
        }
        if self.unchecked {
            create = create.push_next(&mut unchecked);
        }
        if self.purpose == Purpose::RayTracing {
            create = create.push_next(&mut structures).push_next(&mut pipelines);
        }
        // SAFETY: all that `create` points to lives until the call returns.
        unsafe { instance.raw.create_device(physical, &create, None) }
    }
}

fn has_int64_atomics(instance: &Instance, physical: vk::PhysicalDevice) -> bool {
    let mut of_1_2 = vk::PhysicalDeviceVulkan12Features::default();
    let mut all = vk::PhysicalDeviceFeatures2::default().push_next(&mut of_1_2);
    // SAFETY: the device supports Vulkan 1.3, which defines the struct.
    unsafe { instance.raw.get_physical_device_features2(physical, &mut all) };
    all.features.shader_int64 == vk::TRUE && of_1_2.shader_buffer_int64_atomics == vk::TRUE
}
