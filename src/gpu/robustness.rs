//! Kernels without bounds checks. Their indices come from queues that kdray's own kernels write, from grids and trees
//! that kdray builds, and from other trees and from scenes, which are checked before they are uploaded
//! (accel/kdtree/validate.rs, world/check.rs). A check of each load costs rays 3 to 4 % of their speed on an H200
//! (docs/experiments.md).

use std::ffi::CStr;

use ash::{ext, vk};

use super::instance::Instance;

/// The extension with which a pipeline declares that it needs no bounds checks. Without it, some drivers check every
/// access to a buffer.
pub(super) const EXTENSION: &CStr = ext::pipeline_robustness::NAME;

/// Whether a device that has the extension also has its feature.
pub(super) fn has_feature(instance: &Instance, physical: vk::PhysicalDevice) -> bool {
    let mut feature = vk::PhysicalDevicePipelineRobustnessFeaturesEXT::default();
    let mut all = vk::PhysicalDeviceFeatures2::default().push_next(&mut feature);
    // SAFETY: the device belongs to the instance and has the extension.
    unsafe { instance.raw.get_physical_device_features2(physical, &mut all) };
    feature.pipeline_robustness == vk::TRUE
}

/// Returns the structure with which a pipeline turns off bounds checks of storage and uniform buffers.
pub(super) fn without_checks() -> vk::PipelineRobustnessCreateInfoEXT<'static> {
    vk::PipelineRobustnessCreateInfoEXT::default()
        .storage_buffers(vk::PipelineRobustnessBufferBehaviorEXT::DISABLED)
        .uniform_buffers(vk::PipelineRobustnessBufferBehaviorEXT::DISABLED)
}
