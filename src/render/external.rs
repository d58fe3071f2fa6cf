//! Copies the picture into an image that the caller owns.

use super::GpuRenderer;
use crate::gpu::{Access, CommandBuffer, ExternalImage, GpuError, PixelRows, TimelinePoint};

impl GpuRenderer {
    /// Copies the displayed picture, as [`GpuRenderer::picture`] returns it, into the upper left corner of an image.
    /// The device waits for `after`, copies, and signals `then`. The host does not wait.
    ///
    /// # Errors
    /// The image is smaller than the picture; out of memory; a call fails. Then nothing is signalled.
    pub fn copy_picture_to(
        &self,
        image: &ExternalImage,
        after: Option<TimelinePoint>,
        then: Option<TimelinePoint>,
    ) -> Result<(), GpuError> {
        let (window, crop) = (self.in_use.window(), self.in_use.crop_or_whole());
        let (width, height) = image.size();
        if crop.width() > width || crop.height() > height {
            let (value, limit) = (u64::from(crop.width().max(crop.height())), u64::from(width.min(height)));
            return Err(GpuError::Limit { what: "pixels of a side of the picture, in this image", value, limit });
        }
        let first = u64::from(crop.y0 - window.y0) * u64::from(window.width()) + u64::from(crop.x0 - window.x0);
        let rows = PixelRows { offset: 4 * first, stride: window.width(), size: (crop.width(), crop.height()) };
        let display = self.resources.pixels.pixel_display.any();
        let copy = CommandBuffer::record(&self.context, "copy picture", None, |commands| {
            commands.barrier(Access::ComputeWrite, Access::TransferRead); // pixel_display
            commands.copy_to_external(display, &rows, image);
            commands.barrier(Access::TransferRead, Access::ComputeWrite); // pixel_display, for the next frame
        })?;
        // Nobody waits for the copy here: the queue keeps the picture until it has ended.
        self.context.submit_copies(copy, after, then).map(drop)
    }
}
