//! Descriptor set layouts, each shared by several pipelines, and their sets.

use std::sync::Arc;

use ash::vk;

use super::{AnyBuffer, Constant, ConstantValue, Constants, Context, GivenBuffer, GpuError, Target};

/// Kind of the object at a binding number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BindingKind {
    /// A uniform buffer.
    Uniform,
    /// A storage buffer.
    Storage,
    /// A uniform texel buffer.
    Texels,
    /// A storage image.
    Image,
}

impl BindingKind {
    fn descriptor(self) -> vk::DescriptorType {
        match self {
            Self::Uniform => vk::DescriptorType::UNIFORM_BUFFER,
            Self::Storage => vk::DescriptorType::STORAGE_BUFFER,
            Self::Texels => vk::DescriptorType::UNIFORM_TEXEL_BUFFER,
            Self::Image => vk::DescriptorType::STORAGE_IMAGE,
        }
    }
}

/// Object at a binding number.
#[derive(Clone, Copy)]
pub enum Binding<'a> {
    /// A uniform or storage buffer.
    Buffer(&'a AnyBuffer),
    /// The texels of a buffer for [`BufferUse::Texels`](super::BufferUse::Texels) or
    /// [`BufferUse::Address`](super::BufferUse::Address).
    Texels(&'a AnyBuffer),
    /// A storage image.
    Image(&'a Target),
    /// A storage buffer that the library's caller owns.
    Given(GivenBuffer),
}

/// Layout of a descriptor set. The pipelines that use it also share its specialization constants.
pub struct BindingLayout {
    layouts: Arc<Layouts>,
    /// Specialization constants that have the same values in all pipelines.
    pub(super) constants: Constants,
}

/// The Vulkan objects of a layout.
struct Layouts {
    set_layout: vk::DescriptorSetLayout,
    pipeline_layout: vk::PipelineLayout,
    /// Binding numbers and their kinds.
    kinds: Vec<(u32, BindingKind)>,
    context: Arc<Context>,
}

impl BindingLayout {
    /// Creates a layout. `kinds` lists the binding numbers and their kinds. `push_bytes` is the size of the push
    /// constants, bytes. All stages see the push constants.
    pub fn new(context: &Arc<Context>, kinds: &[(u32, BindingKind)], push_bytes: u32) -> Result<Arc<Self>, GpuError> {
        Self::with_constants(context, kinds, push_bytes, Constants::new())
    }

    /// Creates a layout as [`BindingLayout::new`] does. `constants` are specialization constants that have the same
    /// values in all pipelines. A kernel need not declare them.
    pub fn with_constants(
        context: &Arc<Context>,
        kinds: &[(u32, BindingKind)],
        push_bytes: u32,
        constants: Constants,
    ) -> Result<Arc<Self>, GpuError> {
        let stages = context.stages();
        let bindings: Vec<_> = kinds
            .iter()
            .map(|(binding, kind)| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(*binding)
                    .descriptor_type(kind.descriptor())
                    .descriptor_count(1)
                    .stage_flags(stages)
            })
            .collect();
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        // SAFETY: all that the infos point to lives until the calls return, and `Drop` releases what was made.
        unsafe {
            let set_layout = context
                .device
                .create_descriptor_set_layout(&info, None)
                .map_err(GpuError::call("vkCreateDescriptorSetLayout", "bindings"))?;
            let mut made = Layouts {
                set_layout,
                pipeline_layout: vk::PipelineLayout::null(),
                kinds: kinds.to_vec(),
                context: context.clone(),
            };
            let set_layouts = [set_layout];
            let push = [vk::PushConstantRange::default().stage_flags(stages).size(push_bytes)];
            let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&set_layouts).push_constant_ranges(&push);
            made.pipeline_layout = context
                .device
                .create_pipeline_layout(&info, None)
                .map_err(GpuError::call("vkCreatePipelineLayout", "bindings"))?;
            Ok(Arc::new(Self { layouts: Arc::new(made), constants }))
        }
    }
}

impl BindingLayout {
    /// Returns the same layout with another value of one constant. Descriptor sets of either layout serve the pipelines
    /// of both.
    #[must_use]
    pub fn with_constant<T: ConstantValue>(&self, constant: Constant<T>, value: T) -> Arc<Self> {
        Arc::new(Self { layouts: self.layouts.clone(), constants: self.constants.with(constant, value) })
    }

    /// Returns the pipeline layout.
    pub(super) fn pipeline_layout(&self) -> vk::PipelineLayout {
        self.layouts.pipeline_layout
    }

    /// Returns whether the constant is true in all pipelines of the layout. A constant that the layout does not set is
    /// not.
    pub fn sets(&self, constant: Constant<bool>) -> bool {
        self.constants.value(constant) == Some(1)
    }
}

impl Drop for Layouts {
    fn drop(&mut self) {
        // SAFETY: pipelines and sets hold the layout, so none is left.
        unsafe {
            self.context.device.destroy_pipeline_layout(self.pipeline_layout, None);
            self.context.device.destroy_descriptor_set_layout(self.set_layout, None);
        }
    }
}

/// A complete descriptor set. Its buffers and images must outlive the commands that use it.
pub struct BindingSet {
    pub(super) raw: vk::DescriptorSet,
    pool: vk::DescriptorPool,
    pub(super) bindings: Arc<BindingLayout>,
}

impl BindingSet {
    /// Creates a set. `objects` has each binding number of the layout once, with an object of the binding's kind. If
    /// a buffer exceeds what the device can bind, only its first part is bound. Kernels then have to read the buffer
    /// as texels or by address.
    ///
    /// # Panics
    /// The number of objects is not that of the layout's bindings, or an object has no binding in the layout.
    pub fn new(bindings: &Arc<BindingLayout>, name: &str, objects: &[(u32, Binding)]) -> Result<Self, GpuError> {
        let Layouts { set_layout, kinds, context, .. } = &*bindings.layouts;
        assert_eq!(objects.len(), kinds.len(), "one object a binding");
        context.count_creation("vkCreateDescriptorPool", name)?;
        let sizes: Vec<_> = kinds
            .iter()
            .map(|(_, kind)| vk::DescriptorPoolSize { ty: kind.descriptor(), descriptor_count: 1 })
            .collect();
        let info = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
        // SAFETY: the pool has room for exactly this set, and is destroyed with it.
        unsafe {
            let pool = context
                .device
                .create_descriptor_pool(&info, None)
                .map_err(GpuError::call("vkCreateDescriptorPool", name))?;
            let mut set = Self { raw: vk::DescriptorSet::null(), pool, bindings: bindings.clone() };
            context.count_creation("vkAllocateDescriptorSets", name)?;
            let layouts = [*set_layout];
            let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
            set.raw = context
                .device
                .allocate_descriptor_sets(&info)
                .map_err(GpuError::call("vkAllocateDescriptorSets", name))?[0];
            context.set_name(set.raw, name);
            set.write(objects);
            Ok(set)
        }
    }

    fn write(&self, objects: &[(u32, Binding)]) {
        let Layouts { kinds, context, .. } = &*self.bindings.layouts;
        let most_bytes = context.limits().storage_range;
        for (binding, object) in objects {
            let known = kinds.iter().find(|(known, _)| known == binding);
            let (_, kind) = known.unwrap_or_else(|| panic!("the set has no binding {binding}"));
            let write = vk::WriteDescriptorSet::default()
                .dst_set(self.raw)
                .dst_binding(*binding)
                .descriptor_type(kind.descriptor());
            let buffer_info;
            let texels;
            let image_info;
            let write = match object {
                Binding::Buffer(buffer) => {
                    let bytes = buffer.bytes().min(most_bytes);
                    buffer_info = [vk::DescriptorBufferInfo::default().buffer(buffer.raw()).range(bytes)];
                    write.buffer_info(&buffer_info)
                }
                Binding::Given(GivenBuffer { raw, offset, bytes }) => {
                    buffer_info = [vk::DescriptorBufferInfo::default().buffer(*raw).offset(*offset).range(*bytes)];
                    write.buffer_info(&buffer_info)
                }
                Binding::Texels(buffer) => {
                    texels = [buffer.texels()];
                    write.texel_buffer_view(&texels)
                }
                Binding::Image(target) => {
                    image_info = [vk::DescriptorImageInfo::default()
                        .image_view(target.view)
                        .image_layout(vk::ImageLayout::GENERAL)];
                    write.image_info(&image_info)
                }
            };
            // SAFETY: the set is not in use yet, and the object is of the binding's kind.
            unsafe { context.device.update_descriptor_sets(&[write], &[]) };
        }
    }
}

impl Drop for BindingSet {
    fn drop(&mut self) {
        // SAFETY: the device has ended all work with the set, which is freed with its pool.
        unsafe { self.bindings.layouts.context.device.destroy_descriptor_pool(self.pool, None) };
    }
}
