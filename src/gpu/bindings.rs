//! Descriptor set layouts, each shared by several pipelines, and their sets.

use std::sync::{Arc, PoisonError};

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
#[derive(Clone)]
pub struct BindingLayout {
    pub(super) set_layout: vk::DescriptorSetLayout,
    pub(super) pipeline_layout: vk::PipelineLayout,
    /// Binding numbers and their kinds.
    kinds: Vec<(u32, BindingKind)>,
    /// Specialization constants that have the same values in all pipelines.
    pub(super) constants: Constants,
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
        let Layouts { set_layout, pipeline_layout, .. } = Layouts::of(context, kinds, push_bytes)?;
        let (kinds, context) = (kinds.to_vec(), context.clone());
        Ok(Arc::new(Self { set_layout, pipeline_layout, kinds, constants, context }))
    }
}

/// Vulkan's layouts of a descriptor set and of the pipelines that use it. A context makes them once and keeps them: a
/// driver can find a compiled pipeline in the context's cache only by the same layout.
#[derive(Clone)]
pub(super) struct Layouts {
    kinds: Vec<(u32, BindingKind)>,
    push_bytes: u32,
    set_layout: vk::DescriptorSetLayout,
    pipeline_layout: vk::PipelineLayout,
}

impl Layouts {
    /// Returns the context's layouts of the bindings. They are created if it has none yet.
    fn of(context: &Context, kinds: &[(u32, BindingKind)], push_bytes: u32) -> Result<Self, GpuError> {
        let mut made = context.layouts.lock().unwrap_or_else(PoisonError::into_inner);
        let known = made.iter().find(|known| known.kinds == kinds && known.push_bytes == push_bytes);
        if let Some(known) = known {
            return Ok(known.clone());
        }
        let layouts = Self::new(context, kinds, push_bytes)?;
        made.push(layouts.clone());
        Ok(layouts)
    }

    fn new(context: &Context, kinds: &[(u32, BindingKind)], push_bytes: u32) -> Result<Self, GpuError> {
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
        // SAFETY: all that the infos point to lives until the calls return.
        unsafe {
            let set_layout = (context.device.create_descriptor_set_layout(&info, None))
                .map_err(GpuError::call("vkCreateDescriptorSetLayout", "bindings"))?;
            let set_layouts = [set_layout];
            let push = [vk::PushConstantRange::default().stage_flags(stages).size(push_bytes)];
            let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&set_layouts).push_constant_ranges(&push);
            match context.device.create_pipeline_layout(&info, None) {
                Ok(pipeline_layout) => Ok(Self { kinds: kinds.to_vec(), push_bytes, set_layout, pipeline_layout }),
                Err(error) => {
                    context.device.destroy_descriptor_set_layout(set_layout, None);
                    Err(GpuError::call("vkCreatePipelineLayout", "bindings")(error))
                }
            }
        }
    }

    /// Destroys the layouts.
    ///
    /// # Safety
    /// No pipeline or set of the layouts is left, and nobody uses the layouts any more.
    pub(super) unsafe fn destroy(self, device: &ash::Device) {
        // SAFETY: the caller guarantees it.
        unsafe {
            device.destroy_pipeline_layout(self.pipeline_layout, None);
            device.destroy_descriptor_set_layout(self.set_layout, None);
        }
    }
}

impl BindingLayout {
    /// Returns the same layout with another value of one constant. Descriptor sets of either layout serve the pipelines
    /// of both.
    #[must_use]
    pub fn with_constant<T: ConstantValue>(&self, constant: Constant<T>, value: T) -> Arc<Self> {
        Arc::new(Self { constants: self.constants.with(constant, value), ..self.clone() })
    }

    /// Returns the bits of the value that a constant has in all pipelines of the layout. They are 0 if the layout does
    /// not set it.
    pub fn value<T>(&self, constant: Constant<T>) -> u32 {
        self.constants.value(constant).unwrap_or(0)
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
        assert_eq!(objects.len(), bindings.kinds.len(), "one object a binding");
        let context = &bindings.context;
        context.count_creation("vkCreateDescriptorPool", name)?;
        let sizes: Vec<_> = bindings
            .kinds
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
            let layouts = [bindings.set_layout];
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
        let most_bytes = self.bindings.context.limits().storage_range;
        for (binding, object) in objects {
            let known = self.bindings.kinds.iter().find(|(known, _)| known == binding);
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
            unsafe { self.bindings.context.device.update_descriptor_sets(&[write], &[]) };
        }
    }
}

impl Drop for BindingSet {
    fn drop(&mut self) {
        // SAFETY: the device has ended all work with the set, which is freed with its pool.
        unsafe { self.bindings.context.device.destroy_descriptor_pool(self.pool, None) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::ContextOptions;

    #[test]
    fn equal_bindings_share_their_layouts() {
        let context = Context::new(&ContextOptions::new(None, true)).expect("a device with validation");
        let layout = |kinds: &[_], push_bytes| BindingLayout::new(&context, kinds, push_bytes).expect("a layout");
        let kinds = [(0, BindingKind::Uniform), (3, BindingKind::Storage)];
        let first = layout(&kinds, 16).pipeline_layout;
        assert_eq!(layout(&kinds, 16).pipeline_layout, first);
        assert_ne!(layout(&kinds, 20).pipeline_layout, first);
        assert_ne!(layout(&kinds[..1], 16).pipeline_layout, first);
        assert_eq!(context.validation_messages(), Vec::<String>::new());
    }
}
