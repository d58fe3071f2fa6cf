//! The image that kdray writes, and how the program clears it and reads it back.

use std::error::Error;

use ash::vk;

use super::program::Program;

/// The program's image, and a buffer to read it back.
pub struct Target {
    pub image: vk::Image,
    buffer: vk::Buffer,
    memory: [vk::DeviceMemory; 2],
    n_bytes: u64,
    /// Clears the image.
    pub clear: vk::CommandBuffer,
    /// Copies the image to the buffer.
    pub read_back: vk::CommandBuffer,
}

impl Target {
    pub unsafe fn new(program: &Program, width: u32, height: u32) -> Result<Self, Box<dyn Error>> {
        let device = &program.device;
        let n_bytes = 4 * u64::from(width) * u64::from(height);
        let image = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(vk::Format::R8G8B8A8_SRGB)
            .extent(vk::Extent3D { width, height, depth: 1 })
            .mip_levels(1)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .usage(vk::ImageUsageFlags::TRANSFER_DST | vk::ImageUsageFlags::TRANSFER_SRC);
        let buffer = vk::BufferCreateInfo::default().size(n_bytes).usage(vk::BufferUsageFlags::TRANSFER_DST);
        // SAFETY: the memory is bound before the image and the buffer are used.
        unsafe {
            let (image, buffer) = (device.create_image(&image, None)?, device.create_buffer(&buffer, None)?);
            let of_image = program
                .allocate(&device.get_image_memory_requirements(image), vk::MemoryPropertyFlags::DEVICE_LOCAL)?;
            let on_host = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
            let of_buffer = program.allocate(&device.get_buffer_memory_requirements(buffer), on_host)?;
            device.bind_image_memory(image, of_image, 0)?;
            device.bind_buffer_memory(buffer, of_buffer, 0)?;
            let clear = program.record(|commands| clear(device, commands, image))?;
            let read_back = program.record(|commands| read_back(device, commands, image, buffer, [width, height]))?;
            Ok(Self { image, buffer, memory: [of_image, of_buffer], n_bytes, clear, read_back })
        }
    }

    /// Returns the pixels that were read back, 4 bytes each.
    pub unsafe fn pixels(&self, program: &Program) -> Result<Vec<u8>, vk::Result> {
        let [_, memory] = self.memory;
        // SAFETY: the device has written the buffer, and the memory is coherent.
        unsafe {
            let mapped = program.device.map_memory(memory, 0, self.n_bytes, vk::MemoryMapFlags::empty())?;
            Ok(std::slice::from_raw_parts(mapped.cast::<u8>(), self.n_bytes as usize).to_vec())
        }
    }

    pub unsafe fn destroy(self, program: &Program) {
        // SAFETY: the program has waited for the device.
        unsafe {
            program.device.destroy_image(self.image, None);
            program.device.destroy_buffer(self.buffer, None);
            self.memory.into_iter().for_each(|memory| program.device.free_memory(memory, None));
        }
    }
}

/// Returns the subresource range of a whole colour image with one layer and one mip level.
fn whole() -> vk::ImageSubresourceRange {
    vk::ImageSubresourceRange::default().aspect_mask(vk::ImageAspectFlags::COLOR).level_count(1).layer_count(1)
}

/// Clears the image to a background, in place of what another program might draw before kdray.
unsafe fn clear(device: &ash::Device, commands: vk::CommandBuffer, image: vk::Image) {
    let layout = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
    let barrier = [vk::ImageMemoryBarrier2::default()
        .image(image)
        .subresource_range(whole())
        .new_layout(layout)
        .dst_stage_mask(vk::PipelineStageFlags2::ALL_TRANSFER)
        .dst_access_mask(vk::AccessFlags2::TRANSFER_WRITE)];
    let red = vk::ClearColorValue { float32: [1.0, 0.0, 0.0, 1.0] };
    // SAFETY: the commands are being recorded.
    unsafe {
        device.cmd_pipeline_barrier2(commands, &vk::DependencyInfo::default().image_memory_barriers(&barrier));
        device.cmd_clear_color_image(commands, image, layout, &red, &[whole()]);
    }
}

/// Copies the image to the buffer. The image is in the layout in which kdray leaves it.
unsafe fn read_back(
    device: &ash::Device,
    commands: vk::CommandBuffer,
    image: vk::Image,
    buffer: vk::Buffer,
    [width, height]: [u32; 2],
) {
    let layers = vk::ImageSubresourceLayers::default().aspect_mask(vk::ImageAspectFlags::COLOR).layer_count(1);
    let region = [vk::BufferImageCopy::default().image_subresource(layers).image_extent(vk::Extent3D {
        width,
        height,
        depth: 1,
    })];
    let barrier = [vk::MemoryBarrier2::default()
        .src_stage_mask(vk::PipelineStageFlags2::ALL_TRANSFER)
        .src_access_mask(vk::AccessFlags2::TRANSFER_WRITE)
        .dst_stage_mask(vk::PipelineStageFlags2::HOST)
        .dst_access_mask(vk::AccessFlags2::HOST_READ)];
    // SAFETY: the commands are being recorded.
    unsafe {
        device.cmd_copy_image_to_buffer(commands, image, vk::ImageLayout::TRANSFER_SRC_OPTIMAL, buffer, &region);
        device.cmd_pipeline_barrier2(commands, &vk::DependencyInfo::default().memory_barriers(&barrier));
    }
}
