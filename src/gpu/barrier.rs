//! Named accesses to memory, between which barriers are recorded.

use ash::vk::{AccessFlags2 as A, PipelineStageFlags2 as S};

/// An access to memory: its pipeline stages, and whether it reads or writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Reads by a kernel, from storage and uniform buffers.
    ComputeRead,
    /// Writes by a kernel.
    ComputeWrite,
    /// Reads and writes by a kernel that updates a buffer in place.
    ComputeUpdate,
    /// Reads and writes by a kernel, and the device's reads of the workgroup counts of the kernel's indirect
    /// dispatch.
    KernelUpdate,
    /// Reads by a fragment shader, from storage buffers.
    FragmentRead,
    /// The device's reads of the workgroup counts of an indirect dispatch.
    IndirectRead,
    /// Reads by a copy command.
    TransferRead,
    /// Writes by a command that copies, updates or fills a buffer.
    TransferWrite,
    /// Reads by the host.
    HostRead,
    /// Reads and writes by a ray generation shader, including reads of the driver's acceleration structure. The
    /// access is valid only on a context with ray tracing.
    RayTracingUpdate,
    /// Reads and writes by a build of the driver's acceleration structure. The access is valid only on a context with
    /// ray tracing.
    StructureBuild,
    /// Uses of buffers in a frame: reads of indices and workgroup counts, reads by vertex shaders, reads and writes
    /// by kernels, and reads and writes by transfers. Fragment shaders are not included. The access serves barriers
    /// between an upload and the commands that use the uploaded data, and between a frame and the uploads of the next
    /// frame.
    AnyUse,
}

impl Access {
    pub(super) fn stages(self) -> S {
        match self {
            Self::ComputeRead | Self::ComputeWrite | Self::ComputeUpdate => S::COMPUTE_SHADER,
            Self::KernelUpdate => S::COMPUTE_SHADER | S::DRAW_INDIRECT,
            Self::FragmentRead => S::FRAGMENT_SHADER,
            Self::IndirectRead => S::DRAW_INDIRECT,
            Self::TransferRead => S::COPY,
            // Vulkan counts updates and fills of buffers as clears, not as copies.
            Self::TransferWrite => S::COPY | S::CLEAR,
            Self::HostRead => S::HOST,
            Self::RayTracingUpdate => S::RAY_TRACING_SHADER_KHR,
            Self::StructureBuild => S::ACCELERATION_STRUCTURE_BUILD_KHR,
            Self::AnyUse => {
                S::INDEX_INPUT
                    | S::VERTEX_SHADER
                    | S::FRAGMENT_SHADER
                    | S::COMPUTE_SHADER
                    | S::DRAW_INDIRECT
                    | S::COPY
                    | S::CLEAR
            }
        }
    }

    pub(super) fn accesses(self) -> A {
        match self {
            Self::ComputeRead => A::SHADER_STORAGE_READ | A::UNIFORM_READ,
            Self::ComputeWrite => A::SHADER_STORAGE_WRITE,
            Self::ComputeUpdate => A::SHADER_STORAGE_READ | A::SHADER_STORAGE_WRITE,
            Self::KernelUpdate => A::SHADER_STORAGE_READ | A::SHADER_STORAGE_WRITE | A::INDIRECT_COMMAND_READ,
            Self::FragmentRead => A::SHADER_STORAGE_READ,
            Self::IndirectRead => A::INDIRECT_COMMAND_READ,
            Self::TransferRead => A::TRANSFER_READ,
            Self::TransferWrite => A::TRANSFER_WRITE,
            Self::HostRead => A::HOST_READ,
            Self::RayTracingUpdate => {
                A::SHADER_STORAGE_READ | A::SHADER_STORAGE_WRITE | A::ACCELERATION_STRUCTURE_READ_KHR
            }
            // Vulkan counts the reads of the build's inputs, corners and instances, as shader reads.
            Self::StructureBuild => {
                A::SHADER_READ | A::ACCELERATION_STRUCTURE_READ_KHR | A::ACCELERATION_STRUCTURE_WRITE_KHR
            }
            Self::AnyUse => {
                A::SHADER_STORAGE_READ
                    | A::SHADER_STORAGE_WRITE
                    | A::SHADER_SAMPLED_READ
                    | A::UNIFORM_READ
                    | A::INDEX_READ
                    | A::INDIRECT_COMMAND_READ
                    | A::TRANSFER_READ
                    | A::TRANSFER_WRITE
            }
        }
    }
}
