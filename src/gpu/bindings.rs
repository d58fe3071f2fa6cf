//! Descriptor set layouts, each shared by several pipelines, and their sets.

use std::sync::Arc;

use ash::vk;

use super::{
    AnyBuffer, Constant, ConstantValue, Constants, Context, ExternalBuffer, GpuError, Target,
    commands::Kept,
    lock::{Rank, lock},
    raw_device::RawDevice,
};

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
    Buffer(&'a Arc<AnyBuffer>),
    /// The texels of a buffer for [`BufferUse::Texels`](super::BufferUse::Texels) or
    /// [`BufferUse::Address`](super::BufferUse::Address).
    Texels(&'a Arc<AnyBuffer>),
    /// A storage image.
    Image(&'a Arc<Target>),
    /// A storage buffer that the library's caller owns.
    External(ExternalBuffer),
}

/// Layout of a descriptor set. The pipelines that use it also share its specialization constants.
#[derive(Clone)]
pub struct BindingLayout {
    pub(super) set_layout: vk::DescriptorSetLayout,
    pub(super) pipeline_layout: vk::PipelineLayout,
    /// Binding numbers and their kinds.
    kinds: Vec<(u32, BindingKind)>,
    /// Size of the push constants.
    pub(super) push_bytes: u32,
    /// Specialization constants that have the same values in all pipelines.
    pub(super) constants: Constants,
    device: Arc<RawDevice>,
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
        let Layouts { set_layout, pipeline_layout, .. } = Layouts::of(&context.device, kinds, push_bytes)?;
        let (kinds, device) = (kinds.to_vec(), Arc::clone(&context.device));
        Ok(Arc::new(Self { set_layout, pipeline_layout, kinds, push_bytes, constants, device }))
    }
}

/// Vulkan's layouts of a descriptor set and of the pipelines that use it. A device makes them once and keeps them: a
/// driver can find a compiled pipeline in the device's cache only by the same layout.
#[derive(Clone)]
pub(super) struct Layouts {
    kinds: Vec<(u32, BindingKind)>,
    push_bytes: u32,
    set_layout: vk::DescriptorSetLayout,
    pipeline_layout: vk::PipelineLayout,
}

impl Layouts {
    /// Returns the device's layouts of the bindings. They are created if it has none yet.
    fn of(device: &RawDevice, kinds: &[(u32, BindingKind)], push_bytes: u32) -> Result<Self, GpuError> {
        let mut made = lock(Rank::Layouts, &device.layouts)?;
        let known = made.iter().find(|known| known.kinds == kinds && known.push_bytes == push_bytes);
        if let Some(known) = known {
            return Ok(known.clone());
        }
        let layouts = Self::new(device, kinds, push_bytes)?;
        made.push(layouts.clone());
        Ok(layouts)
    }

    fn new(device: &RawDevice, kinds: &[(u32, BindingKind)], push_bytes: u32) -> Result<Self, GpuError> {
        let stages = device.stages();
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
            let set_layout = (device.raw.create_descriptor_set_layout(&info, None))
                .map_err(GpuError::call("vkCreateDescriptorSetLayout", "bindings"))?;
            let set_layouts = [set_layout];
            let push = [vk::PushConstantRange::default().stage_flags(stages).size(push_bytes)];
            let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&set_layouts).push_constant_ranges(&push);
            match device.raw.create_pipeline_layout(&info, None) {
                Ok(pipeline_layout) => Ok(Self { kinds: kinds.to_vec(), push_bytes, set_layout, pipeline_layout }),
                Err(error) => {
                    device.raw.destroy_descriptor_set_layout(set_layout, None);
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

/// A complete descriptor set, which keeps the buffers and images that it binds.
pub struct BindingSet {
    pub(super) raw: Arc<RawSet>,
    pub(super) bindings: Arc<BindingLayout>,
}

/// Vulkan's set, its pool and what it binds.
pub(super) struct RawSet {
    pub raw: vk::DescriptorSet,
    pool: vk::DescriptorPool,
    _bound: Vec<Kept>,
    device: Arc<RawDevice>,
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
        let device = &bindings.device;
        device.count_creation("vkCreateDescriptorPool", name)?;
        let sizes: Vec<_> = bindings
            .kinds
            .iter()
            .map(|(_, kind)| vk::DescriptorPoolSize { ty: kind.descriptor(), descriptor_count: 1 })
            .collect();
        let info = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
        let _bound = objects.iter().filter_map(|(_, object)| object.kept()).collect();
        // SAFETY: the pool has room for exactly this set, and is destroyed with it.
        let raw = unsafe {
            let pool = device
                .raw
                .create_descriptor_pool(&info, None)
                .map_err(GpuError::call("vkCreateDescriptorPool", name))?;
            let mut set = RawSet { raw: vk::DescriptorSet::null(), pool, _bound, device: Arc::clone(device) };
            device.count_creation("vkAllocateDescriptorSets", name)?;
            let layouts = [bindings.set_layout];
            let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
            set.raw =
                device.raw.allocate_descriptor_sets(&info).map_err(GpuError::call("vkAllocateDescriptorSets", name))?
                    [0];
            device.set_name(set.raw, name);
            set.write(&bindings.kinds, objects);
            set
        };
        Ok(Self { raw: Arc::new(raw), bindings: Arc::clone(bindings) })
    }
}

impl Binding<'_> {
    /// Returns what a set keeps. Who made an external buffer has guaranteed that it lives long enough.
    fn kept(&self) -> Option<Kept> {
        match *self {
            Self::Buffer(buffer) | Self::Texels(buffer) => Some(Arc::clone(buffer) as Kept),
            Self::Image(target) => Some(Arc::clone(target) as Kept),
            Self::External(_) => None,
        }
    }
}

impl RawSet {
    fn write(&self, kinds: &[(u32, BindingKind)], objects: &[(u32, Binding)]) {
        let most_bytes = self.device.limits.storage_range;
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
                Binding::External(ExternalBuffer { raw, offset, bytes }) => {
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
            unsafe { self.device.raw.update_descriptor_sets(&[write], &[]) };
        }
    }
}

impl Drop for RawSet {
    fn drop(&mut self) {
        // SAFETY: the device has ended all work with the set, since commands that bind it keep it. It is freed with its
        // pool.
        unsafe { self.device.raw.destroy_descriptor_pool(self.pool, None) };
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
