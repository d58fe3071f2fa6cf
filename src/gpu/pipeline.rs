//! Compute and raster pipelines.

use std::{collections::HashMap, ffi::CStr, sync::Arc};

use ash::vk;

use super::{
    BindingLayout, Constants, Context, GpuError, Shader, TargetKind,
    lock::{Rank, lock},
    raw_device::RawDevice,
    robustness::without_checks,
    shader::ShaderModule,
    specialization::Specialization,
    statistics::capture_flags,
};

pub(super) const ENTRY_POINT: &CStr = c"main";

/// The compute pipelines of a context, which are kept as long as it.
pub(super) type Made = HashMap<Variant, Arc<RawPipeline>>;

/// What distinguishes the compute pipelines of a device.
#[derive(PartialEq, Eq, Hash)]
pub(super) struct Variant {
    name: &'static str,
    file: &'static str,
    /// See [`Specialization::values`].
    constants: Vec<(u32, u32)>,
    layout: vk::PipelineLayout,
    full_subgroups: bool,
}

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
    /// Creates the pipeline, or returns the one that the context has made of the same description. Drivers keep what
    /// they compile, but not all of it: lavapipe would need more than a second for the pipelines of each renderer.
    ///
    /// # Errors
    /// The driver refuses the module or is out of memory.
    pub fn new(context: &Arc<Context>, bindings: &Arc<BindingLayout>, desc: &ComputeDesc) -> Result<Self, GpuError> {
        context.device.count_creation("vkCreateComputePipelines", desc.name)?;
        let made = |raw| Self { raw, bindings: Arc::clone(bindings), name: desc.name };
        let variant = Variant {
            name: desc.name,
            file: desc.shader.file,
            constants: Specialization::new(desc.constants, bindings).values(),
            layout: bindings.pipeline_layout,
            full_subgroups: desc.full_subgroups,
        };
        let known = lock(Rank::Pipelines, &context.pipelines)?.get(&variant).cloned();
        if let Some(known) = known.filter(|_| !context.device.has_replacement(desc.shader)) {
            return Ok(made(known));
        }
        // The lock is not held meanwhile: other threads compile other pipelines.
        let module = ShaderModule::new(&context.device, desc.shader)?;
        let raw = Self::compile(context, bindings, desc, &module)?;
        if module.is_replacement {
            return Ok(made(raw));
        }
        Ok(made(Arc::clone(lock(Rank::Pipelines, &context.pipelines)?.entry(variant).or_insert(raw))))
    }

    fn compile(
        context: &Context,
        bindings: &BindingLayout,
        desc: &ComputeDesc,
        module: &ShaderModule,
    ) -> Result<Arc<RawPipeline>, GpuError> {
        let device = &context.device;
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
        Ok(RawPipeline::new(context, raw, desc.name))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::{BindingKind, Constant, ContextOptions};

    const LANES: Shader =
        Shader { file: "lanes.comp", spirv: include_bytes!(concat!(env!("OUT_DIR"), "/lanes.comp.spv")) };

    #[test]
    fn equal_descriptions_have_one_pipeline() {
        let context = Context::new(&ContextOptions::new(None, true)).expect("a device with validation");
        let layout = |push_bytes| BindingLayout::new(&context, &[(0, BindingKind::Storage)], push_bytes).unwrap();
        let made = |bindings, constants: &Constants| {
            let desc = ComputeDesc { name: "lanes", shader: LANES, constants, full_subgroups: false };
            ComputePipeline::new(&context, &bindings, &desc).expect("a pipeline").raw.raw
        };
        let constants = Constants::new().set(Constant::new("A", 100), 7);
        let first = made(layout(4), &constants);
        assert_eq!(made(layout(4), &constants), first);
        assert_ne!(made(layout(8), &constants), first);
        assert_ne!(made(layout(4), &Constants::new()), first);
        assert_ne!(made(layout(4), &Constants::new().set(Constant::new("A", 100), 8)), first);
        #[cfg(feature = "view")]
        {
            context.replace_shaders([(LANES.file.to_owned(), LANES.spirv.to_vec())].into());
            assert_ne!(made(layout(4), &constants), first, "a module that is replaced makes a pipeline of its own");
        }
        assert_eq!(context.validation_messages(), Vec::<String>::new());
    }
}
