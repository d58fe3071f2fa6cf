//! The driver's own acceleration structure over triangles, with which kdray's structures are compared.

use std::sync::Arc;

use ash::vk;
use bytemuck::Pod;

use super::{
    Access, Buffer, BufferUse, CommandBuffer, Commands, Context, GpuError, Timer, ray_tracing::RayTracingCalls,
};

/// The driver's acceleration structure: a bottom level over all triangles and a top level of one instance.
pub struct DriverAccel {
    top: Level,
    _bottom: Level,
    build_ms: Option<f64>,
}

/// One level of the structure and its memory.
struct Level {
    raw: vk::AccelerationStructureKHR,
    _bytes: Buffer<u8>,
    context: Arc<Context>,
}

/// Inputs of a level's build: the level's name and type, its geometry and the number of primitives in the geometry.
struct Contents<'a> {
    name: &'static str,
    ty: vk::AccelerationStructureTypeKHR,
    geometry: vk::AccelerationStructureGeometryKHR<'a>,
    n_primitives: u32,
}

impl DriverAccel {
    /// Builds both levels for fast tracing. An element of `triangles` must have 48 bytes: three 16-byte rows, each of
    /// which begins with a vertex position.
    ///
    /// # Errors
    /// Memory is exhausted.
    ///
    /// # Panics
    /// The context was opened without ray tracing.
    pub fn new<T: Pod>(context: &Arc<Context>, triangles: &[T]) -> Result<Self, GpuError> {
        let corners = Buffer::with(context, "driver_accel corners", triangles, BufferUse::Structure)?;
        let (bottom, build_ms) = Level::build(context, &Contents::of_triangles(&corners, triangles.len()))?;
        let instances =
            Buffer::with(context, "driver_accel instance", &[instance_of(bottom.address())], BufferUse::Structure)?;
        let data = vk::AccelerationStructureGeometryInstancesDataKHR::default()
            .data(vk::DeviceOrHostAddressConstKHR { device_address: instances.any().address() });
        let top = Contents {
            name: "top level",
            ty: vk::AccelerationStructureTypeKHR::TOP_LEVEL,
            geometry: vk::AccelerationStructureGeometryKHR::default()
                .geometry_type(vk::GeometryTypeKHR::INSTANCES)
                .geometry(vk::AccelerationStructureGeometryDataKHR { instances: data }),
            n_primitives: 1,
        };
        let (top, _) = Level::build(context, &top)?;
        Ok(Self { top, _bottom: bottom, build_ms })
    }

    /// Builds a bottom level that can be refitted, and refits it `n_times` to the same triangles. Returns the GPU times
    /// of the refits, milliseconds; none without timestamps. `triangles`: see [`DriverAccel::new`].
    ///
    /// # Errors
    /// Memory is exhausted.
    ///
    /// # Panics
    /// The context was opened without ray tracing.
    pub fn refits<T: Pod>(context: &Arc<Context>, triangles: &[T], n_times: usize) -> Result<Vec<f64>, GpuError> {
        let corners = Buffer::with(context, "driver_accel corners", triangles, BufferUse::Structure)?;
        let contents = Contents::of_triangles(&corners, triangles.len());
        let (_, ms) = Level::build_and_refit(context, &contents, n_times)?;
        Ok(ms.into_iter().skip(1).flatten().collect())
    }

    /// Returns the address of the top level, which a ray generation shader takes as `accelerationStructureEXT`.
    pub fn address(&self) -> u64 {
        self.top.address()
    }

    /// Returns the GPU time of the bottom level's build, milliseconds. `None` without timestamps.
    pub fn build_ms(&self) -> Option<f64> {
        self.build_ms
    }
}

/// Returns a `VkAccelerationStructureInstanceKHR` as 16 words, with the identity transform, the mask 0xff, no custom
/// index and the bottom level's address.
fn instance_of(address: u64) -> [u32; 16] {
    let one = 1f32.to_bits();
    let rows = [one, 0, 0, 0, 0, one, 0, 0, 0, 0, one, 0];
    let mut words = [0; 16];
    words[..12].copy_from_slice(&rows);
    words[12] = 0xff << 24;
    words[14] = address as u32;
    words[15] = (address >> 32) as u32;
    words
}

impl Contents<'_> {
    /// Inputs of a bottom level. `corners`: those of [`DriverAccel::new`].
    fn of_triangles<T: Pod>(corners: &Buffer<T>, n: usize) -> Self {
        let data = vk::AccelerationStructureGeometryTrianglesDataKHR::default()
            .vertex_format(vk::Format::R32G32B32_SFLOAT)
            .vertex_data(vk::DeviceOrHostAddressConstKHR { device_address: corners.any().address() })
            .vertex_stride(16)
            .max_vertex((3 * n as u32).saturating_sub(1))
            .index_type(vk::IndexType::NONE_KHR);
        Self {
            name: "bottom level",
            ty: vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL,
            geometry: vk::AccelerationStructureGeometryKHR::default()
                .geometry_type(vk::GeometryTypeKHR::TRIANGLES)
                .geometry(vk::AccelerationStructureGeometryDataKHR { triangles: data })
                .flags(vk::GeometryFlagsKHR::OPAQUE),
            n_primitives: n as u32,
        }
    }
}

impl Level {
    /// Builds a level on the device and waits for it. Also returns the GPU time of the build, milliseconds, unless
    /// the queue writes no timestamps.
    fn build(context: &Arc<Context>, contents: &Contents) -> Result<(Self, Option<f64>), GpuError> {
        let (level, ms) = Self::build_and_refit(context, contents, 0)?;
        Ok((level, ms[0]))
    }

    /// Builds a level, which can be refitted unless `n_refits` is 0, and refits it so often. Returns the GPU times of
    /// the build and of each refit.
    fn build_and_refit(
        context: &Arc<Context>,
        contents: &Contents,
        n_refits: usize,
    ) -> Result<(Self, Vec<Option<f64>>), GpuError> {
        let calls = RayTracingCalls::of(context);
        let geometries = [contents.geometry];
        let mut flags = vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_TRACE;
        if n_refits > 0 {
            flags |= vk::BuildAccelerationStructureFlagsKHR::ALLOW_UPDATE;
        }
        let mut info = vk::AccelerationStructureBuildGeometryInfoKHR::default()
            .ty(contents.ty)
            .flags(flags)
            .mode(vk::BuildAccelerationStructureModeKHR::BUILD)
            .geometries(&geometries);
        let mut sizes = vk::AccelerationStructureBuildSizesInfoKHR::default();
        let by_device = vk::AccelerationStructureBuildTypeKHR::DEVICE;
        // SAFETY: `info` has one geometry, and one count is given for it.
        unsafe {
            calls.structures.get_acceleration_structure_build_sizes(
                by_device,
                &info,
                &[contents.n_primitives],
                &mut sizes,
            );
        }
        let bytes = sizes.acceleration_structure_size;
        let bytes = Buffer::<u8>::new(context, contents.name, bytes as usize, BufferUse::Structure)?;
        let create = vk::AccelerationStructureCreateInfoKHR::default()
            .buffer(bytes.any().raw())
            .size(sizes.acceleration_structure_size)
            .ty(contents.ty);
        // SAFETY: the buffer has the size that the driver requires, and lives as long as the level.
        let raw = unsafe { calls.structures.create_acceleration_structure(&create, None) }
            .map_err(GpuError::call("vkCreateAccelerationStructureKHR", contents.name))?;
        context.device.set_name(raw, contents.name);
        let level = Self { raw, _bytes: bytes, context: context.clone() };

        // The extra bytes leave room to round the address up.
        let alignment = u64::from(calls.scratch_alignment);
        let n_scratch = (sizes.build_scratch_size.max(sizes.update_scratch_size) + alignment) as usize;
        let scratch = Buffer::<u8>::new(context, "scratch", n_scratch, BufferUse::Structure)?;
        let device_address = scratch.any().address().next_multiple_of(alignment);
        info = info.dst_acceleration_structure(raw).scratch_data(vk::DeviceOrHostAddressKHR { device_address });
        let timer = Timer::new(context, 1)?;
        let mut all_ms = Vec::new();
        for i in 0..=n_refits {
            if i > 0 {
                info = info.mode(vk::BuildAccelerationStructureModeKHR::UPDATE).src_acceleration_structure(raw);
            }
            all_ms.push(level.time(&timer, calls, contents, &info)?);
        }
        Ok((level, all_ms))
    }

    /// Runs a build or a refit and waits for it.
    fn time(
        &self,
        timer: &Timer,
        calls: &RayTracingCalls,
        contents: &Contents,
        info: &vk::AccelerationStructureBuildGeometryInfoKHR,
    ) -> Result<Option<f64>, GpuError> {
        let context = &self.context;
        let buffer = CommandBuffer::record(context, contents.name, Some(timer), |commands| {
            commands.reset_timer();
            commands.barrier(Access::TransferWrite, Access::StructureBuild); // corners, instances
            commands.barrier(Access::StructureBuild, Access::StructureBuild); // the level below
            commands.pass(contents.name, None, || build(commands, calls, info, contents.n_primitives));
            commands.barrier(Access::StructureBuild, Access::RayTracingUpdate); // this level
        })?;
        context.wait_for(context.submit(vec![buffer])?)?;
        Ok(timer.rows()?[0].span_ms.map(|(begin, end)| end - begin))
    }

    fn address(&self) -> u64 {
        let info = vk::AccelerationStructureDeviceAddressInfoKHR::default().acceleration_structure(self.raw);
        // SAFETY: the structure is alive.
        unsafe { RayTracingCalls::of(&self.context).structures.get_acceleration_structure_device_address(&info) }
    }
}

fn build(
    commands: &Commands,
    calls: &RayTracingCalls,
    info: &vk::AccelerationStructureBuildGeometryInfoKHR,
    n_primitives: u32,
) {
    let range = vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(n_primitives);
    // SAFETY: inputs, scratch and destination are buffers of the required sizes, which live until the device has
    // ended the build.
    unsafe {
        calls.structures.cmd_build_acceleration_structures(commands.raw, std::slice::from_ref(info), &[&[range]]);
    }
}

impl Drop for Level {
    fn drop(&mut self) {
        // SAFETY: the device has ended all work with the structure: builds and benchmarks wait for it.
        unsafe { RayTracingCalls::of(&self.context).structures.destroy_acceleration_structure(self.raw, None) };
    }
}
