//! The driver's own ray tracing pipeline, with which kdray's kernels are compared. Nothing else in kdray uses it.

use std::{ffi::CStr, sync::Arc};

use ash::{khr, vk};
use bytemuck::Pod;

use super::{
    BindingLayout, Buffer, BufferUse, Commands, Constants, Context, GpuError, Shader,
    devices::text,
    instance::Instance,
    pipeline::{ENTRY_POINT, RawPipeline},
    shader::ShaderModule,
    specialization::Specialization,
};

/// Functions and limits of the ray tracing extensions.
pub(super) struct RayTracingCalls {
    pub structures: khr::acceleration_structure::Device,
    /// Alignment of a build's scratch address, bytes.
    pub scratch_alignment: u32,
    pipelines: khr::ray_tracing_pipeline::Device,
    /// Size of a shader group's handle, bytes.
    handle_bytes: usize,
    /// Alignment of a shader group's entry in the shader binding table, bytes.
    table_alignment: usize,
}

impl RayTracingCalls {
    pub const EXTENSIONS: [&'static CStr; 3] =
        [khr::acceleration_structure::NAME, khr::ray_tracing_pipeline::NAME, khr::deferred_host_operations::NAME];

    /// Lists the extensions that a device lacks, separated by commas. `None` if it has all of [`Self::EXTENSIONS`].
    pub fn missing(instance: &Instance, physical: vk::PhysicalDevice) -> Option<String> {
        // SAFETY: the physical device belongs to the instance.
        let extensions = unsafe { instance.raw.enumerate_device_extension_properties(physical) }.unwrap_or_default();
        let has = |name: &CStr| extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(name));
        let missing: Vec<_> = Self::EXTENSIONS.iter().filter(|name| !has(name)).map(|name| text(name)).collect();
        (!missing.is_empty()).then(|| missing.join(", "))
    }

    pub fn new(instance: &Instance, physical: vk::PhysicalDevice, device: &ash::Device) -> Self {
        let mut structures = vk::PhysicalDeviceAccelerationStructurePropertiesKHR::default();
        let mut pipelines = vk::PhysicalDeviceRayTracingPipelinePropertiesKHR::default();
        let mut all = vk::PhysicalDeviceProperties2::default().push_next(&mut structures).push_next(&mut pipelines);
        // SAFETY: the physical device has both extensions, which define the structs.
        unsafe { instance.raw.get_physical_device_properties2(physical, &mut all) };
        Self {
            structures: khr::acceleration_structure::Device::new(&instance.raw, device),
            scratch_alignment: structures.min_acceleration_structure_scratch_offset_alignment,
            pipelines: khr::ray_tracing_pipeline::Device::new(&instance.raw, device),
            handle_bytes: pipelines.shader_group_handle_size as usize,
            table_alignment: pipelines.shader_group_base_alignment as usize,
        }
    }

    pub fn of(context: &Context) -> &Self {
        context.device.ray_tracing.as_ref().expect("a context with ray tracing")
    }
}

/// Description of a ray tracing pipeline: its three shaders.
pub struct RayTracingDesc {
    /// Name of the pipeline, of its debug label and of its row of the timer.
    pub name: &'static str,
    /// The ray generation shader.
    pub generation: Shader,
    /// The miss shader.
    pub miss: Shader,
    /// The closest-hit shader.
    pub closest_hit: Shader,
    /// Values of specialization constants of the ray generation shader.
    pub constants: Constants,
}

/// A ray tracing pipeline with one group for each shader, and its shader binding table.
pub struct RayTracingPipeline {
    raw: Arc<RawPipeline>,
    table: Buffer<u8>,
    bindings: Arc<BindingLayout>,
    name: &'static str,
    context: Arc<Context>,
}

impl RayTracingPipeline {
    /// Creates the pipeline and its table.
    ///
    /// # Errors
    /// The driver refuses a shader or is out of memory.
    ///
    /// # Panics
    /// The context was opened without ray tracing.
    pub fn new(context: &Arc<Context>, bindings: &Arc<BindingLayout>, desc: &RayTracingDesc) -> Result<Self, GpuError> {
        let calls = RayTracingCalls::of(context);
        let stages = [
            (vk::ShaderStageFlags::RAYGEN_KHR, desc.generation),
            (vk::ShaderStageFlags::MISS_KHR, desc.miss),
            (vk::ShaderStageFlags::CLOSEST_HIT_KHR, desc.closest_hit),
        ];
        let modules = stages
            .iter()
            .map(|(_, shader)| ShaderModule::new(&context.device, *shader))
            .collect::<Result<Vec<_>, _>>()?;
        let constants = Specialization::new(&desc.constants, bindings);
        let constants = constants.info();
        let stages: Vec<_> = (stages.iter().zip(&modules))
            .map(|((stage, _), module)| {
                let info =
                    vk::PipelineShaderStageCreateInfo::default().stage(*stage).module(module.raw).name(ENTRY_POINT);
                if *stage == vk::ShaderStageFlags::RAYGEN_KHR { info.specialization_info(&constants) } else { info }
            })
            .collect();
        let groups = [group(0), group(1), hit_group(2)];
        let info = [vk::RayTracingPipelineCreateInfoKHR::default()
            .stages(&stages)
            .groups(&groups)
            .max_pipeline_ray_recursion_depth(1)
            .layout(bindings.pipeline_layout)];
        let (deferred, cache) = (vk::DeferredOperationKHR::null(), context.device.pipeline_cache);
        // SAFETY: all that `info` points to lives until the call returns.
        let raw = unsafe { calls.pipelines.create_ray_tracing_pipelines(deferred, cache, &info, None) }
            .map_err(|(_, result)| GpuError::call("vkCreateRayTracingPipelinesKHR", desc.name)(result))?[0];
        let raw = RawPipeline::new(context, raw, desc.name);
        let table = table(context, calls, raw.raw, groups.len())?;
        Ok(Self { raw, table, bindings: bindings.clone(), name: desc.name, context: context.clone() })
    }

    /// Returns the part of the table that holds a group's entry.
    fn region(&self, group_ix: u64) -> vk::StridedDeviceAddressRegionKHR {
        let stride = RayTracingCalls::of(&self.context).table_alignment as u64;
        // The table has room for one entry more, so that its address can be rounded up.
        let base = self.table.any().address().next_multiple_of(stride);
        vk::StridedDeviceAddressRegionKHR { device_address: base + group_ix * stride, stride, size: stride }
    }
}

fn group(shader_ix: u32) -> vk::RayTracingShaderGroupCreateInfoKHR<'static> {
    vk::RayTracingShaderGroupCreateInfoKHR::default()
        .ty(vk::RayTracingShaderGroupTypeKHR::GENERAL)
        .general_shader(shader_ix)
        .closest_hit_shader(vk::SHADER_UNUSED_KHR)
        .any_hit_shader(vk::SHADER_UNUSED_KHR)
        .intersection_shader(vk::SHADER_UNUSED_KHR)
}

fn hit_group(shader_ix: u32) -> vk::RayTracingShaderGroupCreateInfoKHR<'static> {
    group(vk::SHADER_UNUSED_KHR).ty(vk::RayTracingShaderGroupTypeKHR::TRIANGLES_HIT_GROUP).closest_hit_shader(shader_ix)
}

/// Makes the shader binding table: one handle every `table_alignment` bytes, from the first aligned address on.
fn table(
    context: &Arc<Context>,
    calls: &RayTracingCalls,
    pipeline: vk::Pipeline,
    n_groups: usize,
) -> Result<Buffer<u8>, GpuError> {
    let bytes = n_groups * calls.handle_bytes;
    // SAFETY: the pipeline has that many groups.
    let handles = unsafe { calls.pipelines.get_ray_tracing_shader_group_handles(pipeline, 0, n_groups as u32, bytes) }
        .map_err(GpuError::call("vkGetRayTracingShaderGroupHandlesKHR", "table"))?;
    let stride = calls.table_alignment;
    let table = Buffer::new(context, "shader table", (n_groups + 1) * stride, BufferUse::Structure)?;
    let address = table.any().address();
    let first = (address.next_multiple_of(stride as u64) - address) as usize;
    let mut content = vec![0; (n_groups + 1) * stride];
    for (group_ix, handle) in handles.chunks_exact(calls.handle_bytes).enumerate() {
        let place = first + group_ix * stride;
        content[place..place + handle.len()].copy_from_slice(handle);
    }
    table.upload(&content)?;
    Ok(table)
}

impl Commands<'_> {
    /// Runs `n_rays` invocations of the ray generation shader with the bound set, as a pass of the pipeline's name.
    pub fn trace_rays(&self, pipeline: &RayTracingPipeline, push: &impl Pod, n_rays: u32) {
        let calls = self.device.ray_tracing.as_ref().expect("a context with ray tracing");
        let device = &self.device.raw;
        self.keep(&pipeline.raw);
        self.keep(pipeline.table.any());
        let none = vk::StridedDeviceAddressRegionKHR::default();
        let [generation, miss, hit] = [0, 1, 2].map(|group_ix| pipeline.region(group_ix));
        self.pass(pipeline.name, None, || {
            // SAFETY: the set is bound, the push constants fit the layout's range, and the table has the three
            // groups.
            unsafe {
                device.cmd_bind_pipeline(self.raw, vk::PipelineBindPoint::RAY_TRACING_KHR, pipeline.raw.raw);
                let (layout, stages) = (pipeline.bindings.pipeline_layout, self.device.stages());
                device.cmd_push_constants(self.raw, layout, stages, 0, bytemuck::bytes_of(push));
                calls.pipelines.cmd_trace_rays(self.raw, &generation, &miss, &hit, &none, n_rays, 1, 1);
            }
        });
    }
}
