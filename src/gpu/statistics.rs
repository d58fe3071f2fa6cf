//! Statistics that a driver reports of its code for a kernel, such as registers, spills and instructions.

use std::{ffi::CStr, fmt};

use ash::{khr, vk};
use serde::Serialize;

use super::{ComputePipeline, GpuError, devices::text, instance::Instance, raw_device::RawDevice};

/// One statistic, under the driver's own name.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Statistic {
    /// Name of the executable. A driver may make several from one kernel.
    pub executable: String,
    /// The driver's name for the statistic.
    pub name: String,
    /// The value.
    pub value: StatisticValue,
}

/// Value of a statistic.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum StatisticValue {
    /// Yes or no.
    Flag(bool),
    /// A signed integer.
    Signed(i64),
    /// An unsigned integer.
    Unsigned(u64),
    /// A real number.
    Real(f64),
}

impl fmt::Display for StatisticValue {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Flag(flag) => flag.fmt(f),
            Self::Signed(number) => number.fmt(f),
            Self::Unsigned(number) => number.fmt(f),
            Self::Real(number) => number.fmt(f),
        }
    }
}

/// The functions of `VK_KHR_pipeline_executable_properties`.
pub(super) struct StatisticsCalls(khr::pipeline_executable_properties::Device);

impl StatisticsCalls {
    pub const EXTENSION: &'static CStr = khr::pipeline_executable_properties::NAME;

    /// Whether a device that has the extension also has its feature.
    pub fn has_feature(instance: &Instance, physical: vk::PhysicalDevice) -> bool {
        let mut feature = vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default();
        let mut all = vk::PhysicalDeviceFeatures2::default().push_next(&mut feature);
        // SAFETY: the device belongs to the instance and has the extension.
        unsafe { instance.raw.get_physical_device_features2(physical, &mut all) };
        feature.pipeline_executable_info == vk::TRUE
    }

    pub fn new(instance: &Instance, device: &ash::Device) -> Self {
        Self(khr::pipeline_executable_properties::Device::new(&instance.raw, device))
    }
}

/// Returns the creation flags with which a pipeline has statistics, if the device reports any.
pub(super) fn capture_flags(device: &RawDevice) -> vk::PipelineCreateFlags {
    match device.statistics {
        Some(_) => vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR,
        None => vk::PipelineCreateFlags::empty(),
    }
}

impl ComputePipeline {
    /// Returns all statistics that the driver reports of the kernel. There are none if the driver lacks
    /// `VK_KHR_pipeline_executable_properties`.
    ///
    /// # Errors
    /// Memory is exhausted.
    pub fn statistics(&self) -> Result<Vec<Statistic>, GpuError> {
        let Some(StatisticsCalls(calls)) = &self.raw.device.statistics else { return Ok(Vec::new()) };
        let pipeline = vk::PipelineInfoKHR::default().pipeline(self.raw.raw);
        // SAFETY: the pipeline belongs to the device, whose feature is enabled.
        let executables = unsafe { calls.get_pipeline_executable_properties(&pipeline) }
            .map_err(GpuError::call("vkGetPipelineExecutablePropertiesKHR", self.name))?;
        let mut statistics = Vec::new();
        for (executable_ix, executable) in (0..).zip(&executables) {
            let name = text(executable.name_as_c_str().unwrap_or_default());
            let info = vk::PipelineExecutableInfoKHR::default().pipeline(self.raw.raw).executable_index(executable_ix);
            // SAFETY: the pipeline belongs to the device, whose feature is enabled, and was made with
            // `capture_flags`.
            let known = unsafe { calls.get_pipeline_executable_statistics(&info) }
                .map_err(GpuError::call("vkGetPipelineExecutableStatisticsKHR", self.name))?;
            statistics.extend(known.iter().map(|raw| statistic(&name, raw)));
        }
        Ok(statistics)
    }
}

fn statistic(executable: &str, raw: &vk::PipelineExecutableStatisticKHR) -> Statistic {
    // SAFETY: `format` says which member of the union is set.
    let value = unsafe {
        match raw.format {
            vk::PipelineExecutableStatisticFormatKHR::BOOL32 => StatisticValue::Flag(raw.value.b32 != 0),
            vk::PipelineExecutableStatisticFormatKHR::INT64 => StatisticValue::Signed(raw.value.i64),
            vk::PipelineExecutableStatisticFormatKHR::FLOAT64 => StatisticValue::Real(raw.value.f64),
            _ => StatisticValue::Unsigned(raw.value.u64),
        }
    };
    Statistic { executable: executable.to_owned(), name: text(raw.name_as_c_str().unwrap_or_default()), value }
}
