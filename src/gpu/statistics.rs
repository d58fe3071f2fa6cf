//! What a driver tells of the code that it made of a kernel: registers, spills, instructions.

use std::{ffi::CStr, fmt};

use ash::{khr, vk};
use serde::Serialize;

use super::{ComputePipeline, Context, GpuError, devices::text, instance::Instance};

/// One number, under the driver's own name.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Statistic {
    /// Of several executables of one kernel, which.
    pub executable: String,
    /// The driver's name for the number.
    pub name: String,
    /// The number.
    pub value: StatisticValue,
}

/// What kinds of numbers there are.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum StatisticValue {
    /// Yes or no.
    Flag(bool),
    /// An integer.
    Signed(i64),
    /// A count.
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

/// The functions of VK_KHR_pipeline_executable_properties.
pub(super) struct StatisticsCalls(khr::pipeline_executable_properties::Device);

impl StatisticsCalls {
    pub const EXTENSION: &'static CStr = khr::pipeline_executable_properties::NAME;

    /// Whether a device that has the extension has its feature.
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

/// How a pipeline is made, so that it has statistics where the device knows any.
pub(super) fn capture_flags(context: &Context) -> vk::PipelineCreateFlags {
    match context.statistics {
        Some(_) => vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR,
        None => vk::PipelineCreateFlags::empty(),
    }
}

impl ComputePipeline {
    /// All that the driver tells of it; nothing where it has no VK_KHR_pipeline_executable_properties.
    ///
    /// # Errors
    /// Out of memory.
    pub fn statistics(&self) -> Result<Vec<Statistic>, GpuError> {
        let Some(StatisticsCalls(calls)) = &self.context.statistics else { return Ok(Vec::new()) };
        let pipeline = vk::PipelineInfoKHR::default().pipeline(self.raw);
        // SAFETY: the pipeline belongs to the device, whose feature is enabled.
        let executables = unsafe { calls.get_pipeline_executable_properties(&pipeline) }
            .map_err(GpuError::call("vkGetPipelineExecutablePropertiesKHR", self.name))?;
        let mut statistics = Vec::new();
        for (executable_ix, executable) in (0..).zip(&executables) {
            let name = text(executable.name_as_c_str().unwrap_or_default());
            let info = vk::PipelineExecutableInfoKHR::default().pipeline(self.raw).executable_index(executable_ix);
            // SAFETY: as above; the pipeline was made with `capture_flags`.
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
