//! Allocation of a device's memory, and a report of its uses.

use std::sync::PoisonError;

use ash::vk;
use gpu_allocator::{
    AllocationSizes, AllocatorDebugSettings, MemoryLocation,
    vulkan::{Allocation, AllocationCreateDesc, AllocationScheme, Allocator, AllocatorCreateDesc},
};

use super::{Context, GpuError, instance::Instance};

/// Memory that the buffers and images of one name take.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MemoryUse {
    /// Name of the buffers and images.
    pub name: String,
    /// Size of their memory, bytes.
    pub bytes: u64,
}

impl Context {
    /// Allocates memory for the object `name`. `linear` is true for buffers and false for images with optimal tiling.
    pub(super) fn allocate(
        &self,
        name: &str,
        requirements: vk::MemoryRequirements,
        location: MemoryLocation,
        linear: bool,
    ) -> Result<Allocation, GpuError> {
        let desc = AllocationCreateDesc {
            name,
            requirements,
            location,
            linear,
            allocation_scheme: AllocationScheme::GpuAllocatorManaged,
        };
        self.allocator.lock().unwrap_or_else(PoisonError::into_inner).allocate(&desc).map_err(|source| {
            GpuError::Memory { object: name.to_owned(), bytes: requirements.size, source: source.into() }
        })
    }

    /// Lists the uses of memory, the largest first. Objects of one name share an entry.
    pub fn memory(&self) -> Vec<MemoryUse> {
        let report = self.allocator.lock().unwrap_or_else(PoisonError::into_inner).generate_report();
        let mut uses: Vec<MemoryUse> = Vec::new();
        for allocation in report.allocations {
            // egui's renderer gives its allocations no names.
            let name = if allocation.name.is_empty() { "overlay".to_owned() } else { allocation.name };
            match uses.iter_mut().find(|known| known.name == name) {
                Some(known) => known.bytes += allocation.size,
                None => uses.push(MemoryUse { name, bytes: allocation.size }),
            }
        }
        uses.sort_by(|a, b| b.bytes.cmp(&a.bytes).then_with(|| a.name.cmp(&b.name)));
        uses
    }

    pub(super) fn free(&self, allocation: Allocation) {
        let freed = self.allocator.lock().unwrap_or_else(PoisonError::into_inner).free(allocation);
        freed.expect("an allocation is freed once, by its owner");
    }
}

pub(super) fn create_allocator(
    instance: &Instance,
    device: &ash::Device,
    physical_device: vk::PhysicalDevice,
) -> Result<Allocator, GpuError> {
    const MIB: u64 = 1 << 20;
    // Blocks grow with use, so that a small scene takes little memory.
    let sizes = AllocationSizes::new(16 * MIB, 16 * MIB)
        .with_max_device_memblock_size(256 * MIB)
        .with_max_host_memblock_size(64 * MIB);
    Allocator::new(&AllocatorCreateDesc {
        instance: instance.raw.clone(),
        device: device.clone(),
        physical_device,
        debug_settings: AllocatorDebugSettings::default(),
        buffer_device_address: true,
        allocation_sizes: sizes,
    })
    .map_err(|source| GpuError::Memory { object: "allocator".into(), bytes: 0, source: source.into() })
}
