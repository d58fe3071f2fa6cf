//! Render targets.

use std::{mem::ManuallyDrop, sync::Arc};

use ash::vk;
use gpu_allocator::{MemoryLocation, vulkan::Allocation};

use super::{Binding, Context, GpuError, memory::Object, raw_device::RawDevice};

/// Kind of a target's pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TargetKind {
    /// One `u32` per pixel: the ID of a triangle. Such a target is called an ID target. Kernels can read it as a
    /// storage image.
    Uint,
    /// One `f32` per pixel: the depth.
    Depth,
}

impl TargetKind {
    pub(super) fn format(self) -> vk::Format {
        match self {
            Self::Uint => vk::Format::R32_UINT,
            Self::Depth => vk::Format::D32_SFLOAT,
        }
    }

    pub(super) fn aspect(self) -> vk::ImageAspectFlags {
        match self {
            Self::Uint => vk::ImageAspectFlags::COLOR,
            Self::Depth => vk::ImageAspectFlags::DEPTH,
        }
    }

    fn usage(self) -> vk::ImageUsageFlags {
        match self {
            Self::Uint => vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::STORAGE,
            Self::Depth => vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT,
        }
    }
}

/// An image that the rasterizer writes.
pub struct Target {
    pub(super) raw: vk::Image,
    pub(super) view: vk::ImageView,
    pub(super) kind: TargetKind,
    pub(super) width: u32,
    pub(super) height: u32,
    allocation: ManuallyDrop<Allocation>,
    device: Arc<RawDevice>,
}

impl Target {
    /// Returns the image as the object at a binding number.
    pub(crate) fn as_binding(self: &Arc<Self>) -> Binding<'_> {
        Binding::Image(self)
    }

    /// Creates a target with undefined contents.
    ///
    /// # Errors
    /// The size exceeds the device's limits, or memory is exhausted.
    pub fn new(context: &Arc<Context>, name: &str, kind: TargetKind, size: (u32, u32)) -> Result<Self, GpuError> {
        let (width, height) = size;
        let limit = context.limits().target_size;
        if width.max(height) > limit {
            let value = u64::from(width.max(height));
            return Err(GpuError::Limit { what: "picture size in pixels", value, limit: u64::from(limit) });
        }
        let device = &context.device;
        device.count_creation("vkCreateImage", name)?;
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(kind.format())
            .extent(vk::Extent3D { width, height, depth: 1 })
            .mip_levels(1)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(kind.usage());
        // SAFETY: the raw image is destroyed on every path that does not hand it to an owner.
        unsafe {
            let raw = device.raw.create_image(&info, None).map_err(GpuError::call("vkCreateImage", name))?;
            let requirements = device.raw.get_image_memory_requirements(raw);
            let allocation = match device.allocate(name, requirements, MemoryLocation::GpuOnly, Object::Image) {
                Ok(allocation) => ManuallyDrop::new(allocation),
                Err(error) => {
                    device.raw.destroy_image(raw, None);
                    return Err(error);
                }
            };
            let view = vk::ImageView::null();
            let mut target = Self { raw, view, kind, width, height, allocation, device: Arc::clone(device) };
            (device.raw)
                .bind_image_memory(raw, target.allocation.memory(), target.allocation.offset())
                .map_err(GpuError::call("vkBindImageMemory", name))?;
            target.view = target.create_view(name)?;
            device.set_name(raw, name);
            device.set_name(target.view, name);
            Ok(target)
        }
    }

    /// Creates an ID target of one pixel, for descriptor sets whose kernels need an image but never read it. Its
    /// contents are undefined.
    ///
    /// # Errors
    /// Memory is exhausted.
    pub fn unread(context: &Arc<Context>, name: &str) -> Result<Arc<Self>, GpuError> {
        let target = Arc::new(Self::new(context, name, TargetKind::Uint, (1, 1))?);
        context.run(name, |commands| commands.discard_for_compute(&target))?;
        Ok(target)
    }

    /// Returns the width and height, pixels.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    fn create_view(&self, name: &str) -> Result<vk::ImageView, GpuError> {
        self.device.count_creation("vkCreateImageView", name)?;
        let info = vk::ImageViewCreateInfo::default()
            .image(self.raw)
            .view_type(vk::ImageViewType::TYPE_2D)
            .format(self.kind.format())
            .subresource_range(self.range());
        // SAFETY: the image is bound to memory.
        unsafe { self.device.raw.create_image_view(&info, None) }.map_err(GpuError::call("vkCreateImageView", name))
    }

    pub(super) fn range(&self) -> vk::ImageSubresourceRange {
        vk::ImageSubresourceRange::default().aspect_mask(self.kind.aspect()).level_count(1).layer_count(1)
    }
}

impl Drop for Target {
    fn drop(&mut self) {
        // SAFETY: the device has ended all work on the image, since commands that use it keep it. Vulkan ignores a null
        // view.
        unsafe {
            self.device.raw.destroy_image_view(self.view, None);
            self.device.raw.destroy_image(self.raw, None);
            self.device.free(ManuallyDrop::take(&mut self.allocation));
        }
    }
}
