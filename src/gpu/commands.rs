//! Recording commands.

use std::{cell::Cell, ffi::CString, sync::Arc};

use ash::vk;
use bytemuck::Pod;

use super::{
    Access, AnyBuffer, BindingSet, Buffer, ComputePipeline, Context, GivenImage, GpuError, RasterPipeline, Target,
    Timer,
};

/// A recorded command buffer.
pub struct CommandBuffer {
    raw: vk::CommandBuffer,
    name: String,
    context: Arc<Context>,
}

/// What is being recorded: the body of [`CommandBuffer::record`].
pub struct Commands<'a> {
    pub(super) raw: vk::CommandBuffer,
    pub(super) context: &'a Context,
    timer: Option<&'a Timer>,
    has_passes: Cell<bool>,
}

/// How many invocations a kernel runs with.
#[derive(Clone, Copy)]
pub enum Dispatch<'a> {
    /// Invocations and workgroup size, each x, y, z.
    Threads([u32; 3], [u32; 3]),
    /// Workgroups x, y, z at a byte offset of a buffer.
    Indirect(&'a AnyBuffer, u64),
}

/// A rectangle of pixels, from the upper left corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Area {
    /// The first column.
    pub x: u32,
    /// The first row.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

/// What is drawn, and where.
pub struct DrawDesc<'a> {
    /// Takes the triangle's index of each pixel.
    pub ids: &'a Target,
    /// Takes the depth of each pixel.
    pub depth: &'a Target,
    /// Width and height of the picture that clip space spans, pixels; the targets are no smaller.
    pub picture: (u32, u32),
    /// The part of it to draw: the same, bit for bit, as if all of it were drawn. The rest stays as it is.
    pub area: Area,
    /// Three vertices a triangle.
    pub n_triangles: u32,
    /// The vertices' numbers; without any, they are 0, 1, 2 and so on.
    pub indices: &'a Buffer<u32>,
}

impl CommandBuffer {
    /// Records `body` under a debug label; with a timer each pass in it gets a row.
    ///
    /// # Errors
    /// Out of memory.
    pub fn record(
        context: &Arc<Context>,
        name: &str,
        timer: Option<&Timer>,
        body: impl FnOnce(&Commands),
    ) -> Result<Self, GpuError> {
        context.count_creation("vkAllocateCommandBuffers", name)?;
        let device = &context.device;
        let info = vk::CommandBufferAllocateInfo::default().command_pool(context.command_pool).command_buffer_count(1);
        // SAFETY: the pool is used by one thread at a time.
        let raw = unsafe { device.allocate_command_buffers(&info) }
            .map_err(GpuError::call("vkAllocateCommandBuffers", name))?[0];
        let buffer = Self { raw, name: name.to_owned(), context: context.clone() };
        context.set_name(raw, name);
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the buffer is new.
        unsafe { device.begin_command_buffer(raw, &begin) }.map_err(GpuError::call("vkBeginCommandBuffer", name))?;
        let commands = Commands { raw, context, timer, has_passes: Cell::new(false) };
        commands.labelled(name, || body(&commands));
        // SAFETY: it is being recorded.
        unsafe { device.end_command_buffer(raw) }.map_err(GpuError::call("vkEndCommandBuffer", name))?;
        Ok(buffer)
    }

    /// The buffer's debug label.
    pub fn name(&self) -> &str {
        &self.name
    }

    pub(super) fn raw(&self) -> vk::CommandBuffer {
        self.raw
    }

    /// Leaves the buffer to the context, which frees it when the device has ended all work.
    pub(super) fn leave(mut self) {
        self.context.leave_commands(std::mem::take(&mut self.raw));
    }
}

impl Drop for CommandBuffer {
    fn drop(&mut self) {
        // SAFETY: its owner has waited for the device, or has left the buffer to the context; then the handle is null.
        unsafe { self.context.device.free_command_buffers(self.context.command_pool, &[self.raw]) };
    }
}

impl<'a> Commands<'a> {
    /// Commands of a buffer that the caller records and submits.
    pub(super) fn to_given(context: &'a Context, raw: vk::CommandBuffer) -> Self {
        Self { raw, context, timer: None, has_passes: Cell::new(false) }
    }
}

impl Commands<'_> {
    /// One pass: its name is the debug label and the timer's row.
    pub(super) fn pass(&self, name: &'static str, number: Option<u32>, body: impl FnOnce()) {
        if let Some(timer) = self.timer {
            timer.begin(self.raw, name, number, !self.has_passes.replace(true));
        }
        self.labelled(name, body);
        if let Some(timer) = self.timer {
            timer.end(self.raw);
        }
    }

    fn labelled(&self, name: &str, body: impl FnOnce()) {
        let label = CString::new(name).unwrap_or_default();
        let debug_utils = self.context.debug_utils.as_ref().filter(|_| self.context.has_labels);
        // SAFETY: the commands are being recorded; begin and end come in pairs.
        unsafe {
            if let Some(debug_utils) = debug_utils {
                let label = vk::DebugUtilsLabelEXT::default().label_name(&label);
                debug_utils.cmd_begin_debug_utils_label(self.raw, &label);
            }
            body();
            if let Some(debug_utils) = debug_utils {
                debug_utils.cmd_end_debug_utils_label(self.raw);
            }
        }
    }

    /// Starts the timer's frame.
    pub fn reset_timer(&self) {
        if let Some(timer) = self.timer {
            timer.reset(self.raw);
        }
    }

    /// Binds the set for all kernels of this command buffer.
    pub fn bind(&self, set: &BindingSet) {
        // SAFETY: the set is complete, and its layout is every pipeline's.
        unsafe {
            let ray_tracing = self.context.ray_tracing.as_ref().map(|_| vk::PipelineBindPoint::RAY_TRACING_KHR);
            let points = [vk::PipelineBindPoint::COMPUTE, vk::PipelineBindPoint::GRAPHICS];
            for point in points.into_iter().chain(ray_tracing) {
                let layout = set.bindings.pipeline_layout;
                self.context.device.cmd_bind_descriptor_sets(self.raw, point, layout, 0, &[set.raw], &[]);
            }
        }
    }

    /// Runs a kernel with the bound set, as a pass of its name. `number` goes beside the name in the timer's row.
    pub fn dispatch(&self, pipeline: &ComputePipeline, number: Option<u32>, push: &impl Pod, dispatch: Dispatch) {
        self.dispatch_after(|| (), pipeline, number, push, dispatch);
    }

    /// As [`Commands::dispatch`], with transfers and barriers that are a part of the pass.
    pub fn dispatch_after(
        &self,
        prepare: impl FnOnce(),
        pipeline: &ComputePipeline,
        number: Option<u32>,
        push: &impl Pod,
        dispatch: Dispatch,
    ) {
        self.pass(pipeline.name, number, || {
            prepare();
            self.launch(pipeline, push, dispatch);
        });
    }

    fn launch(&self, pipeline: &ComputePipeline, push: &impl Pod, dispatch: Dispatch) {
        let device = &self.context.device;
        let stages = self.context.stages();
        // SAFETY: the set is bound; push constants fit the layout's range.
        unsafe {
            device.cmd_bind_pipeline(self.raw, vk::PipelineBindPoint::COMPUTE, pipeline.raw);
            let layout = pipeline.bindings.pipeline_layout;
            device.cmd_push_constants(self.raw, layout, stages, 0, bytemuck::bytes_of(push));
            match dispatch {
                Dispatch::Threads([nx, ny, nz], [x, y, z]) => {
                    device.cmd_dispatch(self.raw, nx.div_ceil(x), ny.div_ceil(y), nz.div_ceil(z));
                }
                Dispatch::Indirect(buffer, offset) => device.cmd_dispatch_indirect(self.raw, buffer.raw(), offset),
            }
        }
    }

    /// Rasterizes triangles into the cleared area of the targets: IDs to u32::MAX, depth to 0 (far).
    pub fn draw(&self, pipeline: &RasterPipeline, desc: &DrawDesc) {
        self.pass(pipeline.name, None, || self.rasterize(pipeline, desc));
    }

    fn rasterize(&self, pipeline: &RasterPipeline, desc: &DrawDesc) {
        let device = &self.context.device;
        let Area { x, y, width, height } = desc.area;
        let area =
            vk::Rect2D { offset: vk::Offset2D { x: x as i32, y: y as i32 }, extent: vk::Extent2D { width, height } };
        let attachment = |target: &Target, layout, clear, store| {
            vk::RenderingAttachmentInfo::default()
                .image_view(target.view)
                .image_layout(layout)
                .load_op(vk::AttachmentLoadOp::CLEAR)
                .store_op(store)
                .clear_value(clear)
        };
        let no_triangle = vk::ClearValue { color: vk::ClearColorValue { uint32: [u32::MAX; 4] } };
        let far = vk::ClearValue { depth_stencil: vk::ClearDepthStencilValue { depth: 0.0, stencil: 0 } };
        let (store, drop) = (vk::AttachmentStoreOp::STORE, vk::AttachmentStoreOp::DONT_CARE);
        let color = [attachment(desc.ids, vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL, no_triangle, store)];
        let depth = attachment(desc.depth, vk::ImageLayout::DEPTH_ATTACHMENT_OPTIMAL, far, drop);
        let rendering = vk::RenderingInfo::default()
            .render_area(area)
            .layer_count(1)
            .color_attachments(&color)
            .depth_attachment(&depth);
        let viewport = vk::Viewport {
            width: desc.picture.0 as f32,
            height: desc.picture.1 as f32,
            max_depth: 1.0,
            ..vk::Viewport::default()
        };
        // SAFETY: the targets are in the named layouts (`begin_targets`), the set is bound.
        unsafe {
            device.cmd_begin_rendering(self.raw, &rendering);
            device.cmd_bind_pipeline(self.raw, vk::PipelineBindPoint::GRAPHICS, pipeline.raw);
            device.cmd_set_viewport(self.raw, 0, &[viewport]);
            device.cmd_set_scissor(self.raw, 0, &[area]);
            if desc.indices.is_empty() {
                device.cmd_draw(self.raw, 3 * desc.n_triangles, 1, 0, 0);
            } else {
                device.cmd_bind_index_buffer(self.raw, desc.indices.any().raw(), 0, vk::IndexType::UINT32);
                device.cmd_draw_indexed(self.raw, desc.indices.len() as u32, 1, 0, 0, 0);
            }
            device.cmd_end_rendering(self.raw);
        }
    }

    /// Everything that `source` did before is seen by `destination` after.
    pub fn barrier(&self, source: Access, destination: Access) {
        let barrier = [vk::MemoryBarrier2::default()
            .src_stage_mask(source.stages())
            .src_access_mask(source.accesses())
            .dst_stage_mask(destination.stages())
            .dst_access_mask(destination.accesses())];
        let info = vk::DependencyInfo::default().memory_barriers(&barrier);
        // SAFETY: the commands are being recorded, outside rendering.
        unsafe { self.context.device.cmd_pipeline_barrier2(self.raw, &info) };
    }

    /// Makes the targets ready to be drawn to; their contents are dropped.
    pub fn begin_targets(&self, ids: &Target, depth: &Target) {
        let tests = vk::PipelineStageFlags2::EARLY_FRAGMENT_TESTS | vk::PipelineStageFlags2::LATE_FRAGMENT_TESTS;
        // Kernels of the frame before may still read the IDs, its tests still write the depth.
        self.transition(
            ids,
            (vk::PipelineStageFlags2::COMPUTE_SHADER, vk::AccessFlags2::NONE, vk::ImageLayout::UNDEFINED),
            (
                vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT,
                vk::AccessFlags2::COLOR_ATTACHMENT_WRITE,
                vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL,
            ),
        );
        let depth_access =
            vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_READ | vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_WRITE;
        self.transition(
            depth,
            (tests, vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_WRITE, vk::ImageLayout::UNDEFINED),
            (tests, depth_access, vk::ImageLayout::DEPTH_ATTACHMENT_OPTIMAL),
        );
    }

    /// Hands drawn IDs to kernels.
    pub fn color_to_compute(&self, ids: &Target) {
        self.transition(
            ids,
            (
                vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT,
                vk::AccessFlags2::COLOR_ATTACHMENT_WRITE,
                vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL,
            ),
            (vk::PipelineStageFlags2::COMPUTE_SHADER, vk::AccessFlags2::SHADER_STORAGE_READ, vk::ImageLayout::GENERAL),
        );
    }

    /// Makes an ID target ready for kernels; its content is dropped.
    pub fn discard_for_compute(&self, ids: &Target) {
        self.transition(
            ids,
            (vk::PipelineStageFlags2::NONE, vk::AccessFlags2::NONE, vk::ImageLayout::UNDEFINED),
            (vk::PipelineStageFlags2::COMPUTE_SHADER, vk::AccessFlags2::SHADER_STORAGE_READ, vk::ImageLayout::GENERAL),
        );
    }

    fn transition(&self, target: &Target, from: LayoutState, to: LayoutState) {
        self.transition_image(target.raw, target.range(), from, to);
    }

    fn transition_image(&self, image: vk::Image, range: vk::ImageSubresourceRange, from: LayoutState, to: LayoutState) {
        let barrier = [vk::ImageMemoryBarrier2::default()
            .image(image)
            .subresource_range(range)
            .src_stage_mask(from.0)
            .src_access_mask(from.1)
            .old_layout(from.2)
            .dst_stage_mask(to.0)
            .dst_access_mask(to.1)
            .new_layout(to.2)];
        let info = vk::DependencyInfo::default().image_memory_barriers(&barrier);
        // SAFETY: the commands are being recorded, outside rendering.
        unsafe { self.context.device.cmd_pipeline_barrier2(self.raw, &info) };
    }

    /// Overwrites the first bytes with data that travels in the command buffer: 64 KiB at most.
    pub fn update_buffer(&self, destination: &AnyBuffer, data: &impl Pod) {
        let bytes = bytemuck::bytes_of(data);
        assert!(bytes.len() as u64 <= destination.bytes() && bytes.len() <= 1 << 16 && bytes.len().is_multiple_of(4));
        // SAFETY: the commands are being recorded, outside rendering, and the buffer holds that many bytes.
        unsafe { self.context.device.cmd_update_buffer(self.raw, destination.raw(), 0, bytes) };
    }

    /// Fills a buffer with zeros.
    pub fn clear_buffer(&self, buffer: &AnyBuffer) {
        self.fill_buffer(buffer, 0);
    }

    /// Fills a buffer with a word.
    pub fn fill_buffer(&self, buffer: &AnyBuffer, word: u32) {
        // SAFETY: the commands are being recorded, outside rendering.
        unsafe { self.context.device.cmd_fill_buffer(self.raw, buffer.raw(), 0, vk::WHOLE_SIZE, word) };
    }

    /// Copies the first `bytes`.
    pub fn copy_buffer(&self, source: &AnyBuffer, destination: &AnyBuffer, bytes: u64) {
        self.copy_buffer_to((destination, 0), source, bytes);
    }

    /// Copies the source's first `bytes` to where the destination's byte `begin` stands.
    pub fn copy_buffer_to(&self, (destination, begin): (&AnyBuffer, u64), source: &AnyBuffer, bytes: u64) {
        let region = [vk::BufferCopy::default().dst_offset(begin).size(bytes)];
        // SAFETY: both buffers hold that many bytes, which their owners have checked.
        unsafe { self.context.device.cmd_copy_buffer(self.raw, source.raw(), destination.raw(), &region) };
    }
}

/// A rectangle of pixels in a buffer of rows, 4 bytes a pixel.
#[derive(Clone, Copy, Debug)]
pub struct PixelRows {
    /// The byte at which the first pixel is.
    pub offset: u64,
    /// Pixels from a row to the next.
    pub stride: u32,
    /// Width and height, pixels.
    pub size: (u32, u32),
}

impl Commands<'_> {
    /// Copies pixels into an image of the caller's own, from its upper left corner on. Needs `Access::TransferRead` of the
    /// buffer. The image has its last layout afterwards, and what waits for the end of the commands sees the pixels.
    pub fn copy_to_given(&self, source: &AnyBuffer, rows: &PixelRows, image: &GivenImage) {
        let (width, height) = rows.size;
        assert!(width <= image.size.0 && height <= image.size.1, "the image has room for the pixels");
        let layers = vk::ImageSubresourceLayers::default().aspect_mask(vk::ImageAspectFlags::COLOR).layer_count(1);
        let region = [vk::BufferImageCopy::default()
            .buffer_offset(rows.offset)
            .buffer_row_length(rows.stride)
            .image_subresource(layers)
            .image_extent(vk::Extent3D { width, height, depth: 1 })];
        let [before, after] = image.layouts;
        let (copy, written) = (vk::PipelineStageFlags2::COPY, vk::AccessFlags2::TRANSFER_WRITE);
        let copying = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
        self.transition_given(image, (copy, vk::AccessFlags2::NONE, before), (copy, written, copying));
        // SAFETY: the buffer holds the rows, which its owner has checked; the image is in this layout.
        unsafe { self.context.device.cmd_copy_buffer_to_image(self.raw, source.raw(), image.raw, copying, &region) };
        // The semaphore that is signalled next waits for copies.
        self.transition_given(image, (copy, written, copying), (copy, vk::AccessFlags2::NONE, after));
    }

    fn transition_given(&self, image: &GivenImage, from: LayoutState, to: LayoutState) {
        let range =
            vk::ImageSubresourceRange::default().aspect_mask(vk::ImageAspectFlags::COLOR).level_count(1).layer_count(1);
        self.transition_image(image.raw, range, from, to);
    }
}

/// Stages and accesses on one side of a layout transition.
type LayoutState = (vk::PipelineStageFlags2, vk::AccessFlags2, vk::ImageLayout);
