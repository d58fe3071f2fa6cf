//! Compute and raster pipelines.

use std::{ffi::CStr, sync::Arc};

use ash::vk;

use super::{
    BindingLayout, Constants, Context, GpuError, Shader, TargetKind, raw_device::RawDevice, robustness::without_checks,
    shader::ShaderModule, specialization::Specialization, statistics::capture_flags,
};

pub(super) const ENTRY_POINT: &CStr = c"main";

/// Vulkan's pipeline of any kind.
pub(super) struct RawPipeline {
    pub raw: vk::Pipeline,
    pub device: Arc<RawDevice>,
}

impl RawPipeline {
    /// Takes over a pipeline, and names it.
    pub fn new(context: &Context, raw: vk::Pipeline, name: &str) -> Arc<Self> {
        context.device.set_name(raw, name);
        Arc::new(Self { raw, device: Arc::clone(&context.device) })
    }
}

impl Drop for RawPipeline {
    fn drop(&mut self) {
        // SAFETY: the device has ended all work with the pipeline, since commands that bind it keep it.
        unsafe { self.device.raw.destroy_pipeline(self.raw, None) };
    }
}

/// Description of a compute pipeline: a kernel and its variant.
pub struct ComputeDesc<'a> {
    /// Name of the pipeline, of its debug label and of its row of the timer.
    pub name: &'static str,
    /// The compute shader.
    pub shader: Shader,
    /// Values of specialization constants that the shader declares.
    pub constants: &'a Constants,
    /// Whether every subgroup has all its invocations. If so, the workgroup's width must be a multiple of the
    /// subgroup size.
    pub full_subgroups: bool,
}

/// A compute pipeline: a kernel that is ready to run.
pub struct ComputePipeline {
    pub(super) raw: Arc<RawPipeline>,
    pub(super) bindings: Arc<BindingLayout>,
    pub(super) name: &'static str,
}

impl ComputePipeline {
    /// Creates the pipeline.
    ///
    /// # Errors
    /// The driver refuses the module or is out of memory.
    pub fn new(context: &Arc<Context>, bindings: &Arc<BindingLayout>, desc: &ComputeDesc) -> Result<Self, GpuError> {
        let device = &context.device;
        device.count_creation("vkCreateComputePipelines", desc.name)?;
        let module = ShaderModule::new(device, desc.shader)?;
        let constants = Specialization::new(desc.constants, bindings);
        let constants = constants.info();
        let flags = if desc.full_subgroups {
            vk::PipelineShaderStageCreateFlags::REQUIRE_FULL_SUBGROUPS
        } else {
            vk::PipelineShaderStageCreateFlags::empty()
        };
        let stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(module.raw)
            .name(ENTRY_POINT)
            .flags(flags)
            .specialization_info(&constants);
        let mut info = vk::ComputePipelineCreateInfo::default()
            .flags(capture_flags(device))
            .stage(stage)
            .layout(bindings.pipeline_layout);
        let mut without_checks = without_checks();
        if device.unchecked {
            info = info.push_next(&mut without_checks);
        }
        // SAFETY: all that `info` points to lives until the call returns.
        let raw = unsafe { device.raw.create_compute_pipelines(device.pipeline_cache, &[info], None) }
            .map_err(|(_, result)| GpuError::call("vkCreateComputePipelines", desc.name)(result))?[0];
        Ok(Self { raw: RawPipeline::new(context, raw, desc.name), bindings: bindings.clone(), name: desc.name })
    }
}

/// Targets of a raster pass.
#[derive(Clone, Copy)]
pub enum RasterTargets {
    /// An ID target, with reverse-Z depth.
    Uint,
    /// A colour image of the given format, without depth.
    Color(vk::Format),
}

impl RasterTargets {
    fn color_format(self) -> vk::Format {
        match self {
            Self::Uint => TargetKind::Uint.format(),
            Self::Color(format) => format,
        }
    }

    fn depth_format(self) -> vk::Format {
        match self {
            Self::Uint => TargetKind::Depth.format(),
            Self::Color(_) => vk::Format::UNDEFINED,
        }
    }
}

/// Description of a raster pipeline: its shaders and its targets.
pub struct RasterDesc {
    /// Name of the pipeline, of its debug label and of its row of the timer.
    pub name: &'static str,
    /// The vertex shader.
    pub vertex: Shader,
    /// The fragment shader.
    pub fragment: Shader,
    /// The targets that the pass draws to.
    pub targets: RasterTargets,
}

/// A raster pipeline for triangle lists, two-sided and without vertex buffers.
pub struct RasterPipeline {
    pub(super) raw: Arc<RawPipeline>,
    #[cfg(feature = "view")]
    pub(super) bindings: Arc<BindingLayout>,
    pub(super) name: &'static str,
}

impl RasterPipeline {
    /// Creates the pipeline.
    ///
    /// # Errors
    /// The driver refuses a module or is out of memory.
    pub fn new(context: &Arc<Context>, bindings: &Arc<BindingLayout>, desc: &RasterDesc) -> Result<Self, GpuError> {
        let device = &context.device;
        device.count_creation("vkCreateGraphicsPipelines", desc.name)?;
        let vertex = ShaderModule::new(device, desc.vertex)?;
        let fragment = ShaderModule::new(device, desc.fragment)?;
        let constants = Specialization::new(&Constants::new(), bindings);
        let constants = constants.info();
        let stages = [(vk::ShaderStageFlags::VERTEX, vertex.raw), (vk::ShaderStageFlags::FRAGMENT, fragment.raw)].map(
            |(stage, module)| {
                vk::PipelineShaderStageCreateInfo::default()
                    .stage(stage)
                    .module(module)
                    .name(ENTRY_POINT)
                    .specialization_info(&constants)
            },
        );
        let vertex_input = vk::PipelineVertexInputStateCreateInfo::default();
        let assembly =
            vk::PipelineInputAssemblyStateCreateInfo::default().topology(vk::PrimitiveTopology::TRIANGLE_LIST);
        let viewport = vk::PipelineViewportStateCreateInfo::default().viewport_count(1).scissor_count(1);
        let raster = vk::PipelineRasterizationStateCreateInfo::default()
            .polygon_mode(vk::PolygonMode::FILL)
            .cull_mode(vk::CullModeFlags::NONE)
            .line_width(1.0);
        let samples =
            vk::PipelineMultisampleStateCreateInfo::default().rasterization_samples(vk::SampleCountFlags::TYPE_1);
        let has_depth = desc.targets.depth_format() != vk::Format::UNDEFINED;
        let depth = vk::PipelineDepthStencilStateCreateInfo::default()
            .depth_test_enable(has_depth)
            .depth_write_enable(has_depth)
            .depth_compare_op(vk::CompareOp::GREATER);
        let write = [vk::PipelineColorBlendAttachmentState::default().color_write_mask(vk::ColorComponentFlags::RGBA)];
        let blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&write);
        let dynamic = [vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR];
        let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(&dynamic);
        let formats = [desc.targets.color_format()];
        let mut rendering = vk::PipelineRenderingCreateInfo::default()
            .color_attachment_formats(&formats)
            .depth_attachment_format(desc.targets.depth_format());
        let info = [vk::GraphicsPipelineCreateInfo::default()
            .stages(&stages)
            .vertex_input_state(&vertex_input)
            .input_assembly_state(&assembly)
            .viewport_state(&viewport)
            .rasterization_state(&raster)
            .multisample_state(&samples)
            .depth_stencil_state(&depth)
            .color_blend_state(&blend)
            .dynamic_state(&dynamic)
            .layout(bindings.pipeline_layout)
            .push_next(&mut rendering)];
        // SAFETY: all that `info` points to lives until the call returns.
        let raw = unsafe { device.raw.create_graphics_pipelines(device.pipeline_cache, &info, None) }
            .map_err(|(_, result)| GpuError::call("vkCreateGraphicsPipelines", desc.name)(result))?[0];
        Ok(Self {
            raw: RawPipeline::new(context, raw, desc.name),
            #[cfg(feature = "view")]
            bindings: bindings.clone(),
            name: desc.name,
        })
    }
}
