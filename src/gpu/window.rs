//! Commands that draw into a window's image.

use ash::vk;
use bytemuck::Pod;

use super::{
    BindingSet, Commands, RasterPipeline, WindowImage,
    commands::{COLOR_RANGE, DRAWN_COLOR},
    swapchain::SwapchainImage,
};

impl Commands<'_> {
    /// Prepares the image for drawing and begins rendering to it, which clears it to black.
    pub(super) fn begin_window(&self, image: &SwapchainImage, extent: vk::Extent2D) {
        // The submit waits at this stage until the image is acquired.
        let output = vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT;
        let access = vk::AccessFlags2::COLOR_ATTACHMENT_READ | vk::AccessFlags2::COLOR_ATTACHMENT_WRITE;
        let before = (output, vk::AccessFlags2::NONE, vk::ImageLayout::UNDEFINED);
        let drawing = (output, access, vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL);
        let color = [vk::RenderingAttachmentInfo::default()
            .image_view(image.view)
            .image_layout(vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL)
            .load_op(vk::AttachmentLoadOp::CLEAR)
            .store_op(vk::AttachmentStoreOp::STORE)];
        let area = vk::Rect2D { extent, ..Default::default() };
        let rendering = vk::RenderingInfo::default().render_area(area).layer_count(1).color_attachments(&color);
        self.transition_image(image.raw, COLOR_RANGE, before, drawing);
        // SAFETY: the commands are being recorded, and the image is in the named layout.
        unsafe { self.device.raw.cmd_begin_rendering(self.raw, &rendering) };
    }

    /// Ends rendering and hands the image to the screen.
    pub(super) fn end_window(&self, image: &SwapchainImage) {
        // SAFETY: `begin_window` has begun the rendering.
        unsafe { self.device.raw.cmd_end_rendering(self.raw) };
        let shown = (DRAWN_COLOR.0, vk::AccessFlags2::NONE, vk::ImageLayout::PRESENT_SRC_KHR);
        self.transition_image(image.raw, COLOR_RANGE, DRAWN_COLOR, shown);
    }

    /// Draws one triangle that covers the window, as a pass of the pipeline's name.
    pub fn cover(&self, pipeline: &RasterPipeline, set: &BindingSet, push: &impl Pod, image: &WindowImage) {
        let device = &self.device.raw;
        self.keep(&pipeline.raw);
        self.keep(&set.raw);
        let (width, height) = image.size();
        let viewport =
            vk::Viewport { width: width as f32, height: height as f32, max_depth: 1.0, ..Default::default() };
        let area = vk::Rect2D { extent: image.extent, ..Default::default() };
        self.pass(pipeline.name, None, || {
            // SAFETY: rendering to the window has begun, and the set's layout is the pipeline's.
            unsafe {
                let layout = set.bindings.pipeline_layout;
                let point = vk::PipelineBindPoint::GRAPHICS;
                device.cmd_bind_pipeline(self.raw, point, pipeline.raw.raw);
                device.cmd_bind_descriptor_sets(self.raw, point, layout, 0, &[set.raw.raw], &[]);
                self.push(&pipeline.bindings, push);
                device.cmd_set_viewport(self.raw, 0, &[viewport]);
                device.cmd_set_scissor(self.raw, 0, &[area]);
                device.cmd_draw(self.raw, 3, 1, 0, 0);
            }
        });
    }
}
