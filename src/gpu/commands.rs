//! Command buffers, and the commands that are recorded in them.

use std::{
    any::Any,
    cell::{Cell, RefCell},
    ffi::CString,
    sync::Arc,
};

use ash::vk;
use bytemuck::Pod;

use super::{
    Access, AnyBuffer, BindingLayout, BindingSet, Buffer, ComputePipeline, Context, ExternalImage, GpuError,
    RasterPipeline, Target, Timer,
    raw_device::{CommandPool, RawDevice},
};

/// An object that must not be released before the device has ended the commands that use it.
pub(super) type Kept = Arc<dyn Any + Send + Sync>;

/// A recorded command buffer, with all that its commands use.
pub struct CommandBuffer {
    pool: CommandPool,
    name: String,
    _kept: Vec<Kept>,
    device: Arc<RawDevice>,
}

/// A command buffer that is being recorded. [`CommandBuffer::record`] passes it to the closure that records commands.
pub struct Commands<'a> {
    pub(super) raw: vk::CommandBuffer,
    pub(super) device: &'a RawDevice,
    timer: Option<&'a Timer>,
    /// Whether the commands get debug labels. Queues that only copy do not know them.
    has_labels: bool,
    /// Whether a pass has been recorded. The timer needs to know the first pass of a command buffer.
    has_passes: Cell<bool>,
    /// What the commands use.
    kept: RefCell<Vec<Kept>>,
}

/// The grid of a dispatch.
#[derive(Clone, Copy)]
pub enum Dispatch<'a> {
    /// Numbers of invocations along x, y and z, and the workgroup's size along x, y and z. The dispatch rounds the
    /// numbers up to whole workgroups. With the size `[1, 1, 1]`, the numbers are those of workgroups, whatever size
    /// the kernel declares.
    Threads([u32; 3], [u32; 3]),
    /// A buffer and the byte offset at which it holds the numbers of workgroups along x, y and z.
    Indirect(&'a Arc<AnyBuffer>, u64),
}

/// A rectangle of pixels. Rows and columns count from the upper left corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Area {
    /// The first column.
    pub x: u32,
    /// The first row.
    pub y: u32,
    /// The number of columns.
    pub width: u32,
    /// The number of rows.
    pub height: u32,
}

/// Description of a draw: its triangles and its targets.
pub struct DrawDesc<'a> {
    /// Takes the index of each pixel's triangle.
    pub ids: &'a Arc<Target>,
    /// Takes the depth of each pixel during the draw. The depths are undefined afterwards.
    pub depth: &'a Arc<Target>,
    /// Width and height of the picture that clip space spans, pixels. The targets must be at least as large.
    pub picture: (u32, u32),
    /// The part of the picture to draw. Its pixels are the same, bit for bit, as if the whole picture were drawn. The
    /// rest of the targets is left unchanged.
    pub area: Area,
    /// Number of triangles. It is used only if `indices` is empty.
    pub n_triangles: u32,
    /// Vertex indices, three for each triangle. If the buffer is empty, the indices are 0, 1, 2 and so on.
    pub indices: &'a Buffer<u32>,
}

impl CommandBuffer {
    /// Records `body` under a debug label. With a timer, each pass in it gets a row.
    ///
    /// # Errors
    /// Memory is exhausted.
    pub fn record(
        context: &Arc<Context>,
        name: &str,
        timer: Option<&Timer>,
        body: impl FnOnce(&Commands),
    ) -> Result<Self, GpuError> {
        Self::record_for(context.device.family, context, name, timer, body)
    }

    /// Does what [`CommandBuffer::record`] does for the queues of a family.
    pub(super) fn record_for(
        family: u32,
        context: &Arc<Context>,
        name: &str,
        timer: Option<&Timer>,
        body: impl FnOnce(&Commands),
    ) -> Result<Self, GpuError> {
        let mut body = Some(body);
        Self::record_once(family, context, name, timer, &mut |commands| {
            if let Some(body) = body.take() {
                body(commands);
            }
        })
    }

    /// Does what [`CommandBuffer::record_for`] does. Its many callers would each get a copy of this code.
    fn record_once(
        family: u32,
        context: &Arc<Context>,
        name: &str,
        timer: Option<&Timer>,
        body: &mut dyn FnMut(&Commands),
    ) -> Result<Self, GpuError> {
        let device = &context.device;
        device.count_creation("vkAllocateCommandBuffers", name)?;
        let pool = device.take_pool(name, family)?;
        let mut buffer = Self { pool, name: name.to_owned(), _kept: Vec::new(), device: Arc::clone(device) };
        let raw = pool.buffer;
        device.set_name(raw, name);
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the pool and its buffer are this recorder's alone, and the device does not use them.
        unsafe {
            (device.raw.reset_command_pool(pool.raw, vk::CommandPoolResetFlags::empty()))
                .map_err(GpuError::call("vkResetCommandPool", name))?;
            device.raw.begin_command_buffer(raw, &begin).map_err(GpuError::call("vkBeginCommandBuffer", name))?;
        }
        let has_labels = device.has_labels && family == device.family;
        let commands = Commands { timer, has_labels, ..Commands::new(device, raw) };
        commands.labelled(name, || body(&commands));
        buffer._kept = commands.kept.into_inner();
        // SAFETY: the buffer is being recorded.
        unsafe { device.raw.end_command_buffer(raw) }.map_err(GpuError::call("vkEndCommandBuffer", name))?;
        Ok(buffer)
    }

    /// Returns the buffer's debug label.
    pub fn name(&self) -> &str {
        &self.name
    }

    pub(super) fn raw(&self) -> vk::CommandBuffer {
        self.pool.buffer
    }
}

impl Drop for CommandBuffer {
    fn drop(&mut self) {
        // SAFETY: the buffer was not submitted, or the queue has kept it until the device has ended its commands.
        unsafe { self.device.give_pool(self.pool) };
    }
}

impl<'a> Commands<'a> {
    fn new(device: &'a RawDevice, raw: vk::CommandBuffer) -> Self {
        let (has_labels, has_passes, kept) = (device.has_labels, Cell::new(false), RefCell::default());
        Self { raw, device, timer: None, has_labels, has_passes, kept }
    }

    /// Wraps a command buffer that the caller records and submits. Its passes are not timed, and its caller keeps what
    /// the commands use.
    pub(super) fn to_external(context: &'a Context, raw: vk::CommandBuffer) -> Self {
        Self::new(&context.device, raw)
    }
}

impl Commands<'_> {
    /// Keeps an object until the device has ended the commands.
    pub(super) fn keep<T: Any + Send + Sync>(&self, object: &Arc<T>) {
        self.kept.borrow_mut().push(Arc::clone(object) as Kept);
    }
}

impl Commands<'_> {
    /// Records one pass. `name` is the debug label of the pass. If there is a timer, the pass gets a row with `name`
    /// and `number`.
    pub(super) fn pass(&self, name: &'static str, number: Option<u32>, body: impl FnOnce()) {
        if let Some(timer) = self.timer {
            timer.begin(self, name, number, !self.has_passes.replace(true));
        }
        self.labelled(name, body);
        if let Some(timer) = self.timer {
            timer.end(self);
        }
    }

    /// Records `body` under a debug label, if commands get labels.
    fn labelled(&self, name: &str, body: impl FnOnce()) {
        self.begin_label(name);
        body();
        self.end_label();
    }

    fn begin_label(&self, name: &str) {
        let Some(debug_utils) = self.debug_utils() else { return };
        let name = CString::new(name).unwrap_or_default();
        let label = vk::DebugUtilsLabelEXT::default().label_name(&name);
        // SAFETY: the commands are being recorded.
        unsafe { debug_utils.cmd_begin_debug_utils_label(self.raw, &label) };
    }

    fn end_label(&self) {
        let Some(debug_utils) = self.debug_utils() else { return };
        // SAFETY: the commands are being recorded, and a label has begun.
        unsafe { debug_utils.cmd_end_debug_utils_label(self.raw) };
    }

    fn debug_utils(&self) -> Option<&ash::ext::debug_utils::Device> {
        self.device.debug_utils.as_ref().filter(|_| self.has_labels)
    }

    /// Resets the timer, if there is one: its rows are then those of the passes that follow.
    pub fn reset_timer(&self) {
        if let Some(timer) = self.timer {
            timer.reset(self);
        }
    }

    /// Binds the set for all pipelines of this command buffer.
    pub fn bind(&self, set: &BindingSet) {
        self.keep(&set.raw);
        // SAFETY: the set is complete, and all pipelines have its layout.
        unsafe {
            let ray_tracing = self.device.ray_tracing.as_ref().map(|_| vk::PipelineBindPoint::RAY_TRACING_KHR);
            let points = [vk::PipelineBindPoint::COMPUTE, vk::PipelineBindPoint::GRAPHICS];
            for point in points.into_iter().chain(ray_tracing) {
                let layout = set.bindings.pipeline_layout;
                self.device.raw.cmd_bind_descriptor_sets(self.raw, point, layout, 0, &[set.raw.raw], &[]);
            }
        }
    }

    /// Runs a kernel with the bound set, as a pass of the kernel's name. `number` is shown beside the name in the
    /// timer's row.
    pub fn dispatch(&self, pipeline: &ComputePipeline, number: Option<u32>, push: &impl Pod, dispatch: Dispatch) {
        self.dispatch_after(|| (), pipeline, number, push, dispatch);
    }

    /// Runs a kernel as [`Commands::dispatch`] does, after the transfers and barriers that `prepare` records in the
    /// same pass.
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
        let device = &self.device.raw;
        self.keep(&pipeline.raw);
        // SAFETY: the set is bound, and the buffer of workgroup counts holds them.
        unsafe {
            device.cmd_bind_pipeline(self.raw, vk::PipelineBindPoint::COMPUTE, pipeline.raw.raw);
            self.push(&pipeline.bindings, push);
            match dispatch {
                Dispatch::Threads([nx, ny, nz], [x, y, z]) => {
                    device.cmd_dispatch(self.raw, nx.div_ceil(x), ny.div_ceil(y), nz.div_ceil(z));
                }
                Dispatch::Indirect(buffer, offset) => {
                    let end = offset + size_of::<[u32; 3]>() as u64;
                    assert!(end <= buffer.bytes() && offset.is_multiple_of(4), "workgroup counts in the buffer");
                    self.keep(buffer);
                    device.cmd_dispatch_indirect(self.raw, buffer.raw(), offset);
                }
            }
        }
    }

    /// Sets push constants for pipelines of a layout.
    ///
    /// # Panics
    /// The layout has room for fewer.
    pub(super) fn push(&self, bindings: &BindingLayout, push: &impl Pod) {
        let bytes = bytemuck::bytes_of(push);
        assert!(bytes.len() as u32 <= bindings.push_bytes, "push constants of at most {} bytes", bindings.push_bytes);
        // SAFETY: the layout has room for the constants, and all its stages are named.
        unsafe {
            let (layout, stages) = (bindings.pipeline_layout, self.device.stages());
            self.device.raw.cmd_push_constants(self.raw, layout, stages, 0, bytes);
        }
    }

    /// Clears the area of the targets, IDs to `u32::MAX` and depth to 0 (far), and rasterizes triangles into it.
    pub fn draw(&self, pipeline: &RasterPipeline, desc: &DrawDesc) {
        self.pass(pipeline.name, None, || self.rasterize(pipeline, desc));
    }

    fn rasterize(&self, pipeline: &RasterPipeline, desc: &DrawDesc) {
        let device = &self.device.raw;
        let Area { x, y, width, height } = desc.area;
        let size = [desc.ids, desc.depth].map(|target| target.size());
        assert!(size.iter().all(|size| x + width <= size.0 && y + height <= size.1), "an area of the targets");
        self.keep(&pipeline.raw);
        self.keep(desc.indices.any());
        self.keep(desc.ids);
        self.keep(desc.depth);
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
        // SAFETY: `begin_targets` has put the targets into the named layouts, and the set is bound.
        unsafe {
            device.cmd_begin_rendering(self.raw, &rendering);
            device.cmd_bind_pipeline(self.raw, vk::PipelineBindPoint::GRAPHICS, pipeline.raw.raw);
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

    /// Makes later accesses of the kind `destination` wait for earlier ones of the kind `source`, and see what these
    /// wrote. The barrier is not limited to a buffer.
    pub fn barrier(&self, source: Access, destination: Access) {
        if self.device.failure_injection.leaves_barrier_out() {
            return;
        }
        let barrier = [vk::MemoryBarrier2::default()
            .src_stage_mask(source.stages())
            .src_access_mask(source.accesses())
            .dst_stage_mask(destination.stages())
            .dst_access_mask(destination.accesses())];
        let info = vk::DependencyInfo::default().memory_barriers(&barrier);
        // SAFETY: the commands are being recorded, and no rendering is open.
        unsafe { self.device.raw.cmd_pipeline_barrier2(self.raw, &info) };
    }

    /// Prepares the targets for drawing and discards their contents.
    pub fn begin_targets(&self, ids: &Arc<Target>, depth: &Arc<Target>) {
        let tests = vk::PipelineStageFlags2::EARLY_FRAGMENT_TESTS | vk::PipelineStageFlags2::LATE_FRAGMENT_TESTS;
        // Kernels of the previous frame may still read the IDs, and its depth tests may still write the depth.
        self.transition(
            ids,
            (vk::PipelineStageFlags2::COMPUTE_SHADER, vk::AccessFlags2::NONE, vk::ImageLayout::UNDEFINED),
            DRAWN_COLOR,
        );
        let depth_access =
            vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_READ | vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_WRITE;
        self.transition(
            depth,
            (tests, vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_WRITE, vk::ImageLayout::UNDEFINED),
            (tests, depth_access, vk::ImageLayout::DEPTH_ATTACHMENT_OPTIMAL),
        );
    }

    /// Makes drawn IDs visible to kernels.
    pub fn color_to_compute(&self, ids: &Arc<Target>) {
        self.transition(ids, DRAWN_COLOR, READ_BY_KERNELS);
    }

    /// Prepares an ID target for kernels and discards its contents.
    pub fn discard_for_compute(&self, ids: &Arc<Target>) {
        let before = (vk::PipelineStageFlags2::NONE, vk::AccessFlags2::NONE, vk::ImageLayout::UNDEFINED);
        self.transition(ids, before, READ_BY_KERNELS);
    }

    fn transition(&self, target: &Arc<Target>, from: LayoutState, to: LayoutState) {
        self.keep(target);
        self.transition_image(target.raw, target.range(), from, to);
    }

    /// Records a layout transition between two states of an image.
    pub(super) fn transition_image(
        &self,
        image: vk::Image,
        range: vk::ImageSubresourceRange,
        from: LayoutState,
        to: LayoutState,
    ) {
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
        // SAFETY: the commands are being recorded, and no rendering is open.
        unsafe { self.device.raw.cmd_pipeline_barrier2(self.raw, &info) };
    }

    /// Overwrites the first bytes of a buffer with data that is stored in the command buffer.
    ///
    /// # Panics
    /// The data exceeds the buffer, or is not a multiple of 4 bytes.
    pub fn update_buffer(&self, destination: &Arc<AnyBuffer>, data: &[impl Pod]) {
        self.update_buffer_at((destination, 0), data);
    }

    /// Does what [`Commands::update_buffer`] does, from the byte `first` on.
    ///
    /// # Panics
    /// The data exceeds the buffer, or `first` or the data is not a multiple of 4 bytes.
    pub fn update_buffer_at(&self, (destination, first): (&Arc<AnyBuffer>, u64), data: &[impl Pod]) {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        assert!(first + bytes.len() as u64 <= destination.bytes());
        assert!(first.is_multiple_of(4) && bytes.len().is_multiple_of(4));
        self.keep(destination);
        // Vulkan's limit of an update.
        for (ix, part) in bytes.chunks(1 << 16).enumerate() {
            let begin = first + ((ix as u64) << 16);
            // SAFETY: the commands are being recorded, no rendering is open, and the buffer holds that many bytes.
            unsafe { self.device.raw.cmd_update_buffer(self.raw, destination.raw(), begin, part) };
        }
    }

    /// Fills a buffer with zeros.
    pub fn clear_buffer(&self, buffer: &Arc<AnyBuffer>) {
        self.fill_buffer(buffer, 0);
    }

    /// Fills a buffer with copies of a word.
    pub fn fill_buffer(&self, buffer: &Arc<AnyBuffer>, word: u32) {
        self.keep(buffer);
        // SAFETY: the commands are being recorded, and no rendering is open.
        unsafe { self.device.raw.cmd_fill_buffer(self.raw, buffer.raw(), 0, vk::WHOLE_SIZE, word) };
    }

    /// Copies the source's first `bytes` bytes to the beginning of the destination.
    pub fn copy_buffer(&self, source: &Arc<AnyBuffer>, destination: &Arc<AnyBuffer>, bytes: u64) {
        self.copy_buffer_to((destination, 0), source, bytes);
    }

    /// Copies the source's first `bytes` bytes to the destination, from its byte `begin` on.
    pub fn copy_buffer_to(&self, destination: (&Arc<AnyBuffer>, u64), source: &Arc<AnyBuffer>, bytes: u64) {
        self.copy_buffer_range((source, 0), destination, bytes);
    }

    /// Copies `bytes` bytes. Both buffers come with the byte at which the copy begins.
    ///
    /// # Panics
    /// A buffer does not hold the bytes.
    pub fn copy_buffer_range(
        &self,
        (source, source_begin): (&Arc<AnyBuffer>, u64),
        (destination, begin): (&Arc<AnyBuffer>, u64),
        bytes: u64,
    ) {
        let region = [vk::BufferCopy::default().src_offset(source_begin).dst_offset(begin).size(bytes)];
        assert!(
            source_begin + bytes <= source.bytes() && begin + bytes <= destination.bytes(),
            "bytes of both buffers"
        );
        self.keep(source);
        self.keep(destination);
        // SAFETY: both buffers hold that many bytes.
        unsafe { self.device.raw.cmd_copy_buffer(self.raw, source.raw(), destination.raw(), &region) };
    }
}

/// A rectangle of pixels in a buffer of rows, 4 bytes a pixel.
#[derive(Clone, Copy, Debug)]
pub struct PixelRows {
    /// Offset of the first pixel, bytes.
    pub offset: u64,
    /// Distance from one row to the next, pixels.
    pub stride: u32,
    /// Width and height, pixels.
    pub size: (u32, u32),
}

impl Commands<'_> {
    /// Copies pixels to the upper left corner of an image that the caller owns. Before, a barrier to
    /// [`Access::TransferRead`] has to make the buffer's contents visible. Afterwards, the image is in the second
    /// layout of [`ExternalImage::new`]. Whoever waits for the end of the commands sees the pixels.
    ///
    /// # Panics
    /// The image is smaller than the rectangle.
    pub fn copy_to_external(&self, source: &Arc<AnyBuffer>, rows: &PixelRows, image: &ExternalImage) {
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
        self.transition_image(image.raw, COLOR_RANGE, (copy, vk::AccessFlags2::NONE, before), (copy, written, copying));
        let n_pixels = u64::from(rows.stride) * u64::from(height.saturating_sub(1)) + u64::from(width);
        assert!(width <= rows.stride && rows.offset + 4 * n_pixels <= source.bytes(), "the buffer holds the rows");
        self.keep(source);
        // SAFETY: the buffer holds the rows, and the image is in this layout.
        unsafe { self.device.raw.cmd_copy_buffer_to_image(self.raw, source.raw(), image.raw, copying, &region) };
        // `Context::submit_copies` signals its semaphore at the stage COPY, so the transition ends at this stage.
        self.transition_image(image.raw, COLOR_RANGE, (copy, written, copying), (copy, vk::AccessFlags2::NONE, after));
    }
}

/// The whole of a colour image, which has one mip level and one layer.
pub(super) const COLOR_RANGE: vk::ImageSubresourceRange = vk::ImageSubresourceRange {
    aspect_mask: vk::ImageAspectFlags::COLOR,
    base_mip_level: 0,
    level_count: 1,
    base_array_layer: 0,
    layer_count: 1,
};

/// Stages, accesses and image layout on one side of a layout transition.
type LayoutState = (vk::PipelineStageFlags2, vk::AccessFlags2, vk::ImageLayout);

/// A colour image that rendering writes, or has written.
pub(super) const DRAWN_COLOR: LayoutState = (
    vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT,
    vk::AccessFlags2::COLOR_ATTACHMENT_WRITE,
    vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL,
);

/// An image that kernels read.
const READ_BY_KERNELS: LayoutState =
    (vk::PipelineStageFlags2::COMPUTE_SHADER, vk::AccessFlags2::SHADER_STORAGE_READ, vk::ImageLayout::GENERAL);
