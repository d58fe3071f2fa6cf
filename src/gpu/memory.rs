//! Allocation of a device's memory, and a report of its uses.

use ash::vk;
use gpu_allocator::{
    AllocationSizes, AllocatorDebugSettings, MemoryLocation,
    vulkan::{Allocation, AllocationCreateDesc, AllocationScheme, Allocator, AllocatorCreateDesc},
};

use super::{
    Context, GpuError,
    instance::Instance,
    lock::{Rank, lock, lock_anyway},
    raw_device::RawDevice,
};

/// What released memory holds if a test asks for it: as an index or an address, it is far beyond everything.
const RELEASED: u8 = 0xa5;

/// Memory that the buffers and images of one name take.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MemoryUse {
    /// Name of the buffers and images.
    pub name: String,
    /// Size of their memory, bytes.
    pub bytes: u64,
}

/// An object that memory is allocated for.
#[derive(Clone, Copy)]
pub(super) enum Object {
    Buffer(vk::Buffer),
    /// An image with optimal tiling.
    Image,
}

impl RawDevice {
    /// Allocates memory for the object `name`.
    pub fn allocate(
        &self,
        name: &str,
        requirements: vk::MemoryRequirements,
        location: MemoryLocation,
        object: Object,
    ) -> Result<Allocation, GpuError> {
        let shared = AllocationScheme::GpuAllocatorManaged;
        let (linear, allocation_scheme, location) = match object {
            Object::Image => (false, shared, location),
            // The host overwrites the memory when it is released, so it has to see it.
            Object::Buffer(raw) if self.overrides.marks_released => {
                let visible = if location == MemoryLocation::GpuOnly { MemoryLocation::CpuToGpu } else { location };
                (true, AllocationScheme::DedicatedBuffer(raw), visible)
            }
            Object::Buffer(_) => (true, shared, location),
        };
        let desc = AllocationCreateDesc { name, requirements, location, linear, allocation_scheme };
        lock(Rank::Allocator, &self.allocator)?.allocate(&desc).map_err(|source| GpuError::Memory {
            object: name.to_owned(),
            bytes: requirements.size,
            source: source.into(),
        })
    }

    /// Releases memory. It is lost if a thread has panicked within the allocator.
    pub fn free(&self, mut allocation: Allocation) {
        if self.overrides.marks_released
            && let Some(bytes) = allocation.mapped_slice_mut()
        {
            bytes.fill(RELEASED);
        }
        if let Ok(mut allocator) = lock(Rank::Allocator, &self.allocator) {
            allocator.free(allocation).expect("an allocation is freed once, by its owner");
        }
    }
}

impl Context {
    /// Lists the uses of memory, the largest first. Objects of one name share an entry.
    pub fn memory(&self) -> Vec<MemoryUse> {
        let report = lock_anyway(Rank::Allocator, &self.device.allocator).generate_report();
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
