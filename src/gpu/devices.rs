//! The machine's Vulkan devices: their properties, the features that they lack, and the choice of one.

use std::{ffi::CStr, fmt};

use ash::vk;
use serde::Serialize;

use super::{DeviceOverrides, GpuError, instance::Instance};

/// One Vulkan device.
#[derive(Clone, Debug, Serialize)]
pub struct DeviceInfo {
    /// Index in the loader's list.
    pub index: usize,
    /// Name that the driver gives the device.
    pub name: String,
    /// `discrete GPU`, `integrated GPU`, `virtual GPU`, `CPU` or `other`.
    pub kind: String,
    /// Name and version of the driver.
    pub driver: String,
    /// Version of Vulkan that the device supports, such as `1.3.290`.
    pub api_version: String,
    /// Number of invocations in a subgroup. 0 if the device lacks Vulkan 1.3.
    pub subgroup_size: u32,
    /// Size of the device's own memory, bytes. On a device that shares the memory of the host, it is that memory.
    pub memory_bytes: u64,
    /// Features that kdray needs and the device lacks. The list of a usable device is empty.
    pub missing: Vec<String>,
}

impl DeviceInfo {
    /// Whether the driver computes on the CPU.
    pub fn is_software(&self) -> bool {
        self.kind == "CPU"
    }
}

/// A user's choice of a device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DeviceSelector {
    /// Index in the loader's list.
    Index(usize),
    /// Part of the name. Case is ignored.
    Name(String),
}

impl fmt::Display for DeviceSelector {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Index(index) => write!(f, "{index}"),
            Self::Name(name) => f.write_str(name),
        }
    }
}

/// Limits of a device, against which sizes are checked.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Greatest size of a bound storage buffer, bytes.
    pub storage_range: u64,
    /// Greatest number of texels in a texel view of a buffer.
    pub n_texels: u32,
    /// Greatest size of a buffer that need not be bound as a whole, such as one that kernels read by address, bytes.
    pub buffer_bytes: u64,
    /// Greatest width and height of a render target, pixels.
    pub target_size: u32,
    /// Greatest number of workgroups along x in a dispatch.
    pub n_groups: u32,
    /// Greatest number of invocations along x in a workgroup.
    pub group_size: u32,
}

impl Limits {
    /// Queries the limits of a device with Vulkan 1.3.
    pub(super) fn of(instance: &Instance, device: vk::PhysicalDevice) -> Self {
        let mut of_1_1 = vk::PhysicalDeviceVulkan11Properties::default();
        let mut of_1_3 = vk::PhysicalDeviceVulkan13Properties::default();
        let mut all = vk::PhysicalDeviceProperties2::default().push_next(&mut of_1_1).push_next(&mut of_1_3);
        // SAFETY: the device belongs to the instance, and Vulkan 1.3 defines both structs.
        unsafe { instance.raw.get_physical_device_properties2(device, &mut all) };
        let limits = all.properties.limits;
        Self {
            storage_range: u64::from(limits.max_storage_buffer_range),
            n_texels: limits.max_texel_buffer_elements,
            buffer_bytes: of_1_3.max_buffer_size.min(of_1_1.max_memory_allocation_size),
            target_size: limits
                .max_framebuffer_width
                .min(limits.max_framebuffer_height)
                .min(limits.max_image_dimension2_d),
            n_groups: limits.max_compute_work_group_count[0],
            group_size: limits.max_compute_work_group_invocations.min(limits.max_compute_work_group_size[0]),
        }
    }

    /// Returns these limits, each reduced to its override if that is smaller.
    pub(super) fn reduced_to(self, overrides: &DeviceOverrides) -> Self {
        Self {
            storage_range: overrides.storage_range.map_or(self.storage_range, |bytes| bytes.min(self.storage_range)),
            n_texels: overrides.n_texels.map_or(self.n_texels, |n| n.min(self.n_texels)),
            ..self
        }
    }
}

/// Lists all devices, usable or not.
///
/// # Errors
/// There is no loader or no driver, or a call fails.
pub fn devices() -> Result<Vec<DeviceInfo>, GpuError> {
    let instance = Instance::new(false)?;
    Ok(list(&instance)?.into_iter().map(|(_, info)| info).collect())
}

/// Returns the device that [`Device::open`](super::Device::open) would open, without opening it.
///
/// # Errors
/// There is no loader, driver or device of that name; the device lacks a feature; or a call fails.
pub fn chosen_device(selector: Option<&DeviceSelector>) -> Result<DeviceInfo, GpuError> {
    Ok(select(&*Instance::new(false)?, selector, |_| true)?.1)
}

pub(super) fn list(instance: &Instance) -> Result<Vec<(vk::PhysicalDevice, DeviceInfo)>, GpuError> {
    // SAFETY: the instance is alive.
    let devices = unsafe { instance.raw.enumerate_physical_devices() }
        .map_err(GpuError::call("vkEnumeratePhysicalDevices", "kdray"))?;
    let list: Vec<_> =
        devices.into_iter().enumerate().map(|(index, device)| (device, describe(instance, device, index))).collect();
    if list.is_empty() { Err(GpuError::NoDriver) } else { Ok(list) }
}

/// Selects a device: the named one, or the best of those that lack nothing. `presents` says whether a device can show
/// pictures in the window; without a window, it is always true.
pub(super) fn select(
    instance: &Instance,
    selector: Option<&DeviceSelector>,
    presents: impl Fn(vk::PhysicalDevice) -> bool,
) -> Result<(vk::PhysicalDevice, DeviceInfo), GpuError> {
    let mut list = list(instance)?;
    for (device, info) in &mut list {
        if info.missing.is_empty() && !presents(*device) {
            info.missing.push("presentation to this window".to_owned());
        }
    }
    let chosen = match selector {
        Some(DeviceSelector::Index(index)) => list.iter().find(|(_, info)| info.index == *index),
        Some(DeviceSelector::Name(name)) => {
            list.iter().find(|(_, info)| info.name.to_lowercase().contains(&name.to_lowercase()))
        }
        // Among devices of equal kinds the first is chosen, since users can set the loader's order.
        None => list.iter().min_by_key(|(_, info)| (!info.missing.is_empty(), rank(&info.kind), info.index)),
    };
    let Some((device, info)) = chosen else {
        let available: Vec<_> = list.iter().map(|(_, info)| format!("{} {}", info.index, info.name)).collect();
        let wanted = selector.map(ToString::to_string).unwrap_or_default();
        return Err(GpuError::NoSuchDevice { wanted, available: available.join(", ") });
    };
    if !info.missing.is_empty() {
        return Err(GpuError::Lacks { device: info.name.clone(), missing: info.missing.join(", ") });
    }
    Ok((*device, info.clone()))
}

/// Returns the kind's place in [`KINDS`], 0 for the best.
fn rank(kind: &str) -> usize {
    KINDS.iter().position(|(_, name)| *name == kind).unwrap_or(KINDS.len())
}

/// Kinds of devices, the best first.
const KINDS: [(vk::PhysicalDeviceType, &str); 4] = [
    (vk::PhysicalDeviceType::DISCRETE_GPU, "discrete GPU"),
    (vk::PhysicalDeviceType::INTEGRATED_GPU, "integrated GPU"),
    (vk::PhysicalDeviceType::VIRTUAL_GPU, "virtual GPU"),
    (vk::PhysicalDeviceType::CPU, "CPU"),
];

fn describe(instance: &Instance, device: vk::PhysicalDevice, index: usize) -> DeviceInfo {
    // SAFETY: the device belongs to the instance.
    let properties = unsafe { instance.raw.get_physical_device_properties(device) };
    let version = properties.api_version;
    let is_1_3 = version >= vk::API_VERSION_1_3;
    let kind = KINDS.iter().find(|(kind, _)| *kind == properties.device_type).map_or("other", |(_, name)| name);
    let mut info = DeviceInfo {
        index,
        name: text(properties.device_name_as_c_str().unwrap_or_default()),
        kind: kind.to_owned(),
        driver: String::new(),
        api_version: format!(
            "{}.{}.{}",
            vk::api_version_major(version),
            vk::api_version_minor(version),
            vk::api_version_patch(version)
        ),
        subgroup_size: 0,
        memory_bytes: memory_bytes(instance, device),
        missing: Vec::new(),
    };
    if !is_1_3 {
        info.missing.push(format!("Vulkan 1.3 (it has {})", info.api_version));
        return info;
    }
    let mut driver = vk::PhysicalDeviceDriverProperties::default();
    let mut subgroup = vk::PhysicalDeviceSubgroupProperties::default();
    let mut all = vk::PhysicalDeviceProperties2::default().push_next(&mut driver).push_next(&mut subgroup);
    // SAFETY: the device supports Vulkan 1.3, which defines both structs.
    unsafe { instance.raw.get_physical_device_properties2(device, &mut all) };
    info.driver = format!(
        "{} {}",
        text(driver.driver_name_as_c_str().unwrap_or_default()),
        text(driver.driver_info_as_c_str().unwrap_or_default())
    );
    info.subgroup_size = subgroup.subgroup_size;
    info.missing.extend(missing(instance, device, &subgroup));
    info
}

/// Returns the size of all heaps that are local to the device.
fn memory_bytes(instance: &Instance, device: vk::PhysicalDevice) -> u64 {
    // SAFETY: the device belongs to the instance.
    let memory = unsafe { instance.raw.get_physical_device_memory_properties(device) };
    let is_local = |heap: &&vk::MemoryHeap| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL);
    memory.memory_heaps_as_slice().iter().filter(is_local).map(|heap| heap.size).sum()
}

pub(super) fn text(raw: &CStr) -> String {
    raw.to_string_lossy().trim().to_owned()
}

/// Lists the features that kdray needs and the device lacks.
fn missing(
    instance: &Instance,
    device: vk::PhysicalDevice,
    subgroup: &vk::PhysicalDeviceSubgroupProperties,
) -> Vec<String> {
    let mut features_1_2 = vk::PhysicalDeviceVulkan12Features::default();
    let mut features_1_3 = vk::PhysicalDeviceVulkan13Features::default();
    let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut features_1_2).push_next(&mut features_1_3);
    // SAFETY: the device belongs to the instance and supports Vulkan 1.3, which defines the structs.
    let (families, targets) = unsafe {
        instance.raw.get_physical_device_features2(device, &mut features);
        (
            instance.raw.get_physical_device_queue_family_properties(device),
            instance.raw.get_physical_device_format_properties(device, vk::Format::D32_SFLOAT).optimal_tiling_features,
        )
    };
    let operations = vk::SubgroupFeatureFlags::BASIC | vk::SubgroupFeatureFlags::ARITHMETIC;
    let needs = [
        (features_1_2.buffer_device_address == vk::TRUE, "bufferDeviceAddress"),
        (features_1_3.dynamic_rendering == vk::TRUE, "dynamicRendering"),
        (features_1_3.synchronization2 == vk::TRUE, "synchronization2"),
        (features_1_3.compute_full_subgroups == vk::TRUE, "computeFullSubgroups"),
        (subgroup.supported_operations.contains(operations), "subgroup arithmetic"),
        (subgroup.supported_stages.contains(vk::ShaderStageFlags::COMPUTE), "subgroup operations in compute"),
        // The bounds are those of scan.glsl: workgroups have 128 invocations, and an array with one total per
        // subgroup has room for 32 subgroups.
        ((4..=128).contains(&subgroup.subgroup_size), "a subgroup size from 4 to 128"),
        (targets.contains(vk::FormatFeatureFlags::DEPTH_STENCIL_ATTACHMENT), "D32_SFLOAT depth targets"),
        (queue_family(&families).is_some(), "a queue for graphics and compute"),
    ];
    needs.iter().filter(|(has, _)| !has).map(|(_, name)| (*name).to_owned()).collect()
}

/// Returns the first family for copies alone. On GPUs with memory of their own, its queues are engines that copy while
/// kernels run.
pub(super) fn copy_family(families: &[vk::QueueFamilyProperties]) -> Option<usize> {
    let other = vk::QueueFlags::SPARSE_BINDING | vk::QueueFlags::PROTECTED;
    families.iter().position(|family| family.queue_flags & !other == vk::QueueFlags::TRANSFER)
}

/// Returns the first family that supports graphics and compute.
pub(super) fn queue_family(families: &[vk::QueueFamilyProperties]) -> Option<usize> {
    let both = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
    families.iter().position(|family| family.queue_flags.contains(both))
}
