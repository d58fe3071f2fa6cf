//! Named accesses to memory, between which barriers are recorded.

use ash::vk::{AccessFlags2 as A, PipelineStageFlags2 as S};

/// An access to memory: its pipeline stages, and whether it reads or writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Reads of a kernel, from storage and uniform buffers.
    ComputeRead,
    /// Writes of a kernel.
    ComputeWrite,
    /// Reads and writes of a kernel that updates in place.
    ComputeUpdate,
    /// Reads and writes of a kernel, and reads of its indirect dispatch's workgroup counts.
    KernelUpdate,
    /// A fragment shader's reads of storage.
    FragmentRead,
    /// Reads of an indirect dispatch's workgroup counts.
    IndirectRead,
    /// Reads of a copy.
    TransferRead,
    /// Writes of a copy, or of an update or a fill of a buffer.
    TransferWrite,
    /// Reads of the host.
    HostRead,
    /// Reads and writes of a ray generation shader, and its reads of the driver's acceleration structure. Like
    /// `StructureBuild`, it is valid only on a context with ray tracing.
    RayTracingUpdate,
    /// Reads and writes of a build of the driver's acceleration structure.
    StructureBuild,
    /// Index, vertex, compute, uniform and indirect reads, compute writes and transfers. It is for barriers between
    /// an upload and whatever uses it, and between a frame and the next one's uploads.
    AllReads,
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
            Self::AllReads => {
                S::INDEX_INPUT | S::VERTEX_SHADER | S::COMPUTE_SHADER | S::DRAW_INDIRECT | S::COPY | S::CLEAR
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
            Self::AllReads => {
                A::SHADER_STORAGE_READ
                    | A::SHADER_STORAGE_WRITE
                    | A::UNIFORM_READ
                    | A::INDEX_READ
                    | A::INDIRECT_COMMAND_READ
                    | A::TRANSFER_READ
                    | A::TRANSFER_WRITE
            }
        }
    }
}
