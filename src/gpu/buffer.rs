//! Typed buffers in the device's memory, with uploads and downloads.

use std::{marker::PhantomData, mem::ManuallyDrop, ptr::NonNull, slice, sync::Arc};

use ash::vk;
use bytemuck::Pod;
use gpu_allocator::{MemoryLocation, vulkan::Allocation};
use rayon::prelude::*;

use super::{Access, Binding, Context, GpuError, memory::Object, raw_device::RawDevice};

/// Greatest size of one chunk of an upload or download, bytes. Staging buffers of this size are cut from a block of
/// memory that the allocator keeps. Memory for larger ones would be mapped and pinned for each copy, which takes longer
/// than the copy itself.
const MOST_STAGING_BYTES: usize = 8 << 20;
/// Number of bytes that a thread copies at a time.
const COPIED_BYTES: usize = 1 << 18;
/// Least alignment of a buffer's memory, bytes: a line of the cache, so that no two buffers share one. On an H200
/// (driver 580.159), where buffers may begin at any multiple of 16, a kernel lost hits or did not end when the buffer
/// that it wrote began in the 32 bytes in which one that it only reads ended (docs/experiments.md). Kernels that read
/// by address load 16 aligned bytes at a time.
const LINE_BYTES: u64 = 128;

/// How kernels use a buffer. Every buffer can also be copied from and to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BufferUse {
    /// A bound storage buffer.
    Storage,
    /// A bound storage buffer that the queue for copies writes.
    Input,
    /// A bound uniform buffer.
    Uniform,
    /// A bound storage buffer that also holds workgroup counts of indirect dispatches.
    Indirect,
    /// Vertex indices of draws. Kernels cannot read the buffer.
    Index,
    /// Storage that kernels may fetch as texels. The size of the elements decides whether a texel has four words, two
    /// or one. The buffer may be larger than what can be bound.
    Texels,
    /// Storage as for `Texels`, which kernels may also read by its address.
    Address,
    /// Data that the driver's own ray tracing reads and writes by address.
    Structure,
}

/// Returns the size of the widest texel that divides a `T` evenly: 16, 8 or 4 bytes.
pub const fn texel_bytes<T>() -> u64 {
    match size_of::<T>() % 16 {
        0 => 16,
        8 => 8,
        _ => 4,
    }
}

/// A buffer of `len` elements of `T` in the device's memory. A clone is a second handle to the same memory, which is
/// released with its last handle.
#[derive(Clone)]
pub struct Buffer<T> {
    any: Arc<AnyBuffer>,
    len: usize,
    element: PhantomData<T>,
    context: Arc<Context>,
}

/// A buffer without its element type, as descriptors and copies take it.
pub struct AnyBuffer {
    raw: vk::Buffer,
    allocation: ManuallyDrop<Allocation>,
    bytes: u64,
    /// Texel view of the buffer. Null if its use includes no texels.
    texels: vk::BufferView,
    name: String,
    device: Arc<RawDevice>,
}

impl<T: Pod> Buffer<T> {
    /// Creates a buffer of `len` elements with undefined contents. An empty buffer has room for one element, since
    /// Vulkan has no buffers of 0 bytes.
    ///
    /// # Errors
    /// The buffer exceeds the device's limits, or memory is exhausted.
    pub fn new(context: &Arc<Context>, name: &str, len: usize, usage: BufferUse) -> Result<Self, GpuError> {
        let bytes = (len.max(1) * size_of::<T>()) as u64;
        let any = AnyBuffer::on_device(context, name, bytes, usage, texel_bytes::<T>())?;
        Ok(Self { any: Arc::new(any), len, element: PhantomData, context: Arc::clone(context) })
    }

    /// Creates a buffer that holds `data`.
    ///
    /// # Errors
    /// Fails as [`Buffer::new`] does, or if a copy fails.
    pub fn with(context: &Arc<Context>, name: &str, data: &[T], usage: BufferUse) -> Result<Self, GpuError> {
        let buffer = Self::new(context, name, data.len(), usage)?;
        buffer.upload(data)?;
        Ok(buffer)
    }

    /// Creates a buffer of `len` elements and fills it chunk by chunk. Each call of `write(first, chunk)` has to set
    /// `chunk` to the elements from index `first` on. At most 8 MiB of the elements are in the host's memory at a
    /// time.
    ///
    /// # Errors
    /// Fails as [`Buffer::new`] does, or if a copy fails.
    pub fn written_by(
        context: &Arc<Context>,
        name: &str,
        len: usize,
        usage: BufferUse,
        write: impl FnMut(usize, &mut [T]),
    ) -> Result<Self, GpuError> {
        let buffer = Self::new(context, name, len, usage)?;
        buffer.upload_by(len, write)?;
        Ok(buffer)
    }

    /// Returns the number of elements.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are no elements.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Overwrites the first `data.len()` elements and waits for the device.
    ///
    /// # Panics
    /// The buffer has fewer elements.
    pub fn upload(&self, data: &[T]) -> Result<(), GpuError> {
        assert!(data.len() <= self.len, "`{}` holds {} elements, not {}", self.any.name, self.len, data.len());
        self.upload_by(data.len(), |first, chunk| {
            let from = &data[first..][..chunk.len()];
            copy_by_threads(bytemuck::cast_slice_mut(chunk), bytemuck::cast_slice(from));
        })
    }

    /// Overwrites the elements from index `first` on, and waits for the device. Commands that were submitted before
    /// still read the previous ones.
    ///
    /// # Panics
    /// The buffer has fewer elements.
    pub fn upload_at(&self, first: usize, data: &[T]) -> Result<(), GpuError> {
        let end = first + data.len();
        assert!(end <= self.len, "`{}` holds {} elements, not {end}", self.any.name, self.len);
        self.upload_from((first, true), data.len(), |first, chunk| {
            let from = &data[first..][..chunk.len()];
            copy_by_threads(bytemuck::cast_slice_mut(chunk), bytemuck::cast_slice(from));
        })
    }

    /// Overwrites the first `len` elements, chunk by chunk, and waits for the device. `write` is that of
    /// [`Buffer::written_by`].
    fn upload_by(&self, len: usize, write: impl FnMut(usize, &mut [T])) -> Result<(), GpuError> {
        self.upload_from((0, false), len, write)
    }

    /// Overwrites `len` elements as [`Buffer::upload_by`] does, from the index `begin` on. `is_read`: whether commands
    /// that were submitted before read the buffer.
    fn upload_from(
        &self,
        (begin, is_read): (usize, bool),
        len: usize,
        mut write: impl FnMut(usize, &mut [T]),
    ) -> Result<(), GpuError> {
        if len == 0 {
            return Ok(());
        }
        let context = &self.context;
        let most = (MOST_STAGING_BYTES / size_of::<T>()).min(len);
        let staging_bytes = (most * size_of::<T>()) as u64;
        let mut staging = Staging::new(context, &self.any.name, staging_bytes, MemoryLocation::CpuToGpu)?;
        for first in (0..len).step_by(most) {
            let bytes = most.min(len - first) * size_of::<T>();
            write(first, bytemuck::cast_slice_mut(&mut staging.bytes()[..bytes]));
            let begin = ((begin + first) * size_of::<T>()) as u64;
            context.run("upload", |commands| {
                if is_read {
                    commands.barrier(Access::AnyUse, Access::TransferWrite); // the buffer
                }
                commands.copy_buffer_to((&self.any, begin), &staging.buffer, bytes as u64);
                commands.barrier(Access::TransferWrite, Access::AnyUse); // the buffer
            })?;
        }
        Ok(())
    }

    /// Downloads all elements and waits for the device.
    pub fn download(&self) -> Result<Vec<T>, GpuError> {
        self.download_first(self.len)
    }

    /// Downloads the first `len` elements and waits for the device.
    ///
    /// # Panics
    /// The buffer has fewer elements.
    pub fn download_first(&self, len: usize) -> Result<Vec<T>, GpuError> {
        self.download_range(0, len)
    }

    /// Downloads `len` elements from index `first` on and waits for the device.
    ///
    /// # Panics
    /// The buffer has fewer elements.
    pub fn download_range(&self, first: usize, len: usize) -> Result<Vec<T>, GpuError> {
        let end = first + len;
        assert!(end <= self.len, "`{}` holds {} elements, not {end}", self.any.name, self.len);
        let mut data = vec![T::zeroed(); len];
        self.download_bytes(first * size_of::<T>(), bytemuck::cast_slice_mut(&mut data))?;
        Ok(data)
    }

    /// Downloads bytes from the byte `first` on, a multiple of 4, and waits for the device.
    ///
    /// # Panics
    /// The buffer has fewer bytes.
    pub fn download_bytes(&self, first: usize, to: &mut [u8]) -> Result<(), GpuError> {
        assert!((first + to.len()) as u64 <= self.any.bytes, "`{}` holds {} bytes", self.any.name, self.any.bytes);
        if to.is_empty() {
            return Ok(());
        }
        let context = &self.context;
        let staging_bytes = MOST_STAGING_BYTES.min(to.len());
        let location = MemoryLocation::GpuToCpu;
        let mut staging = Staging::new(context, &self.any.name, staging_bytes as u64, location)?;
        let mut begin = first as u64;
        for chunk in to.chunks_mut(staging_bytes) {
            let n_bytes = chunk.len() as u64;
            context.run("download", |commands| {
                commands.barrier(Access::ComputeWrite, Access::TransferRead); // the buffer
                commands.copy_buffer_range((&self.any, begin), (&staging.buffer, 0), n_bytes);
                commands.barrier(Access::TransferWrite, Access::HostRead); // staging
            })?;
            begin += n_bytes;
            let from = &staging.bytes()[..chunk.len()];
            copy_by_threads(chunk, from);
        }
        Ok(())
    }

    /// Returns the buffer without its element type.
    pub fn any(&self) -> &Arc<AnyBuffer> {
        &self.any
    }

    /// Returns the buffer as the object at a binding number.
    pub(crate) fn as_binding(&self) -> Binding<'_> {
        Binding::Buffer(&self.any)
    }

    /// Returns the address of a buffer for [`BufferUse::Address`], low word first, as kernels take it. It is a
    /// multiple of 16.
    pub fn address(&self) -> [u32; 2] {
        let address = self.any.address();
        [address as u32, (address >> 32) as u32]
    }
}

impl BufferUse {
    fn flags(self) -> vk::BufferUsageFlags {
        let own = match self {
            Self::Storage | Self::Input => vk::BufferUsageFlags::STORAGE_BUFFER,
            Self::Uniform => vk::BufferUsageFlags::UNIFORM_BUFFER,
            Self::Indirect => vk::BufferUsageFlags::STORAGE_BUFFER | vk::BufferUsageFlags::INDIRECT_BUFFER,
            Self::Index => vk::BufferUsageFlags::INDEX_BUFFER,
            Self::Texels => vk::BufferUsageFlags::STORAGE_BUFFER | vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER,
            Self::Address => {
                vk::BufferUsageFlags::STORAGE_BUFFER
                    | vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER
                    | vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS
            }
            Self::Structure => {
                vk::BufferUsageFlags::STORAGE_BUFFER
                    | vk::BufferUsageFlags::ACCELERATION_STRUCTURE_STORAGE_KHR
                    | vk::BufferUsageFlags::ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_KHR
                    | vk::BufferUsageFlags::SHADER_BINDING_TABLE_KHR
                    | vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS
            }
        };
        own | vk::BufferUsageFlags::TRANSFER_SRC | vk::BufferUsageFlags::TRANSFER_DST
    }
}

impl AnyBuffer {
    /// Does the work of [`Buffer::new`]. `texel_bytes`: the size of a texel, if the use includes texels.
    pub(super) fn on_device(
        context: &Arc<Context>,
        name: &str,
        bytes: u64,
        usage: BufferUse,
        texel_bytes: u64,
    ) -> Result<Self, GpuError> {
        let is_bound =
            matches!(usage, BufferUse::Storage | BufferUse::Input | BufferUse::Uniform | BufferUse::Indirect);
        let limit = if is_bound { context.limits().storage_range } else { context.limits().buffer_bytes };
        if bytes > limit {
            return Err(GpuError::TooLarge { object: name.to_owned(), bytes, limit });
        }
        let device = &context.device;
        let sharing = device.copy_family.filter(|_| usage == BufferUse::Input).map(|copies| [device.family, copies]);
        let mut buffer = Self::new(device, name, bytes, usage.flags(), sharing, MemoryLocation::GpuOnly)?;
        if matches!(usage, BufferUse::Texels | BufferUse::Address) {
            buffer.add_texels(texel_bytes)?;
        }
        Ok(buffer)
    }

    /// `sharing`: the families whose queues use the buffer, if they are two.
    fn new(
        device: &Arc<RawDevice>,
        name: &str,
        bytes: u64,
        usage: vk::BufferUsageFlags,
        sharing: Option<[u32; 2]>,
        location: MemoryLocation,
    ) -> Result<Self, GpuError> {
        device.count_creation("vkCreateBuffer", name)?;
        let mut info = vk::BufferCreateInfo::default().size(bytes).usage(usage);
        if let Some(families) = &sharing {
            info = info.sharing_mode(vk::SharingMode::CONCURRENT).queue_family_indices(families);
        }
        // SAFETY: the raw buffer is destroyed on every path that does not hand it to an owner.
        unsafe {
            let raw = device.raw.create_buffer(&info, None).map_err(GpuError::call("vkCreateBuffer", name))?;
            let mut requirements = device.raw.get_buffer_memory_requirements(raw);
            requirements.alignment = requirements.alignment.max(LINE_BYTES);
            let allocation = match device.allocate(name, requirements, location, Object::Buffer(raw)) {
                Ok(allocation) => ManuallyDrop::new(allocation),
                Err(error) => {
                    device.raw.destroy_buffer(raw, None);
                    return Err(error);
                }
            };
            let buffer = Self {
                raw,
                allocation,
                bytes,
                texels: vk::BufferView::null(),
                name: name.to_owned(),
                device: Arc::clone(device),
            };
            (device.raw)
                .bind_buffer_memory(raw, buffer.allocation.memory(), buffer.allocation.offset())
                .map_err(GpuError::call("vkBindBufferMemory", name))?;
            device.set_name(raw, name);
            Ok(buffer)
        }
    }

    /// Adds a texel view of the buffer. If the buffer has more texels than the device allows in one view, the view
    /// covers only the first texels.
    fn add_texels(&mut self, texel_bytes: u64) -> Result<(), GpuError> {
        self.device.count_creation("vkCreateBufferView", &self.name)?;
        let format = match texel_bytes {
            16 => vk::Format::R32G32B32A32_UINT,
            8 => vk::Format::R32G32_UINT,
            _ => vk::Format::R32_UINT,
        };
        let range = self.bytes.min(u64::from(self.device.limits.n_texels) * texel_bytes);
        let info = vk::BufferViewCreateInfo::default().buffer(self.raw).format(format).range(range);
        // SAFETY: the buffer was created with the usage that allows texel views, and all devices have these formats.
        self.texels = unsafe { self.device.raw.create_buffer_view(&info, None) }
            .map_err(GpuError::call("vkCreateBufferView", &self.name))?;
        Ok(())
    }

    pub(super) fn raw(&self) -> vk::Buffer {
        self.raw
    }

    /// Returns the texel view of a buffer for [`BufferUse::Texels`] or [`BufferUse::Address`].
    pub(super) fn texels(&self) -> vk::BufferView {
        self.texels
    }

    /// Returns the address of a buffer for [`BufferUse::Address`] or [`BufferUse::Structure`].
    pub(super) fn address(&self) -> vk::DeviceAddress {
        let info = vk::BufferDeviceAddressInfo::default().buffer(self.raw);
        // SAFETY: the buffer was created with the usage that allows addresses.
        unsafe { self.device.raw.get_buffer_device_address(&info) }
    }

    /// Returns the buffer's debug label.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the size in bytes.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }
}

impl Drop for AnyBuffer {
    fn drop(&mut self) {
        // SAFETY: the device has ended all work on the buffer, since commands that use it keep it.
        unsafe {
            self.device.raw.destroy_buffer_view(self.texels, None);
            self.device.raw.destroy_buffer(self.raw, None);
            self.device.free(ManuallyDrop::take(&mut self.allocation));
        }
    }
}

/// Copies bytes by several threads. One alone does not use the memory's whole bandwidth, and fresh pages are mapped one
/// by one when they are first written.
fn copy_by_threads(to: &mut [u8], from: &[u8]) {
    let chunks = to.par_chunks_mut(COPIED_BYTES).zip(from.par_chunks(COPIED_BYTES));
    chunks.for_each(|(to, from)| to.copy_from_slice(from));
}

/// A host-visible buffer for an upload or a download. Kernels may also access it, as storage.
pub(super) struct Staging {
    buffer: Arc<AnyBuffer>,
    /// The buffer's memory, which stays mapped.
    mapped: NonNull<u8>,
}

// SAFETY: the memory belongs to no thread, and a shared reference leads to no access.
unsafe impl Send for Staging {}
// SAFETY: for the same reason.
unsafe impl Sync for Staging {}

impl Staging {
    pub fn new(context: &Arc<Context>, name: &str, bytes: u64, location: MemoryLocation) -> Result<Self, GpuError> {
        let usage = vk::BufferUsageFlags::STORAGE_BUFFER
            | vk::BufferUsageFlags::TRANSFER_SRC
            | vk::BufferUsageFlags::TRANSFER_DST;
        let buffer = AnyBuffer::new(&context.device, &format!("{name} staging"), bytes, usage, None, location)?;
        let mapped = buffer.allocation.mapped_ptr().expect("host-visible memory stays mapped").cast();
        Ok(Self { buffer: Arc::new(buffer), mapped })
    }

    pub fn buffer(&self) -> &Arc<AnyBuffer> {
        &self.buffer
    }

    /// Returns the address of the buffer's bytes, a multiple of 16.
    pub fn mapped(&self) -> NonNull<u8> {
        self.mapped
    }

    /// Returns the buffer's bytes. The device must not work on the buffer meanwhile: its owner waits for each copy.
    fn bytes(&mut self) -> &mut [u8] {
        // SAFETY: the buffer is as long, and nobody else reads or writes its memory.
        unsafe { slice::from_raw_parts_mut(self.mapped.as_ptr(), self.buffer.bytes as usize) }
    }
}
