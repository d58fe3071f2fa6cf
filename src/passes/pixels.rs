//! The buffers and images of pixels.

use std::sync::Arc;

use crate::{
    frame::{Primary, RenderOptions},
    gpu::{Buffer, BufferUse, Commands, Context, GpuError, Target, TargetKind},
    layout::{Feature, Frame},
};

/// Room for the window's pixels, rows from the top; buffers may be longer.
pub struct Pixels {
    /// `width * height`, like all buffers here: the frame's sample, then the mean of all samples.
    pub pixel_radiance: Buffer<[f32; 4]>,
    /// Sums of samples; none before there is a second one.
    pub pixel_accumulated: Option<Buffer<[f32; 4]>>,
    /// None without a noise filter: what follows it then reads pixel_radiance.
    pub pixel_filtered: Option<Buffer<[f32; 4]>>,
    pub pixel_display: Buffer<u32>,
    /// The nearest hit's triangle, and above it, its distance's bits. Empty where the options do not ask for it.
    pub pixel_nearest: Buffer<u64>,
    /// Empty where the options do not ask for them.
    pub pixel_features: Buffer<Feature>,
    /// Of the whole picture, like depth; only the window's part is drawn to.
    pub triangle_ids: Target,
    pub depth: Target,
}

impl Pixels {
    /// # Errors
    /// Beyond the device's limits, out of memory.
    pub fn new(context: &Arc<Context>, frame: &Frame, options: &RenderOptions) -> Result<Self, GpuError> {
        let n_pixels = n_pixels(frame);
        let size = (frame.picture_width, frame.picture_height);
        let storage = BufferUse::Storage;
        let (features, by_kernels) = (options.features, options.primary == Primary::Compute);
        let filters = frame.denoise_threshold.is_finite();
        Ok(Self {
            pixel_radiance: Buffer::new(context, "pixel_radiance", n_pixels, storage)?,
            pixel_accumulated: None,
            pixel_filtered: filters.then(|| Buffer::new(context, "pixel_filtered", n_pixels, storage)).transpose()?,
            pixel_display: Buffer::new(context, "pixel_display", n_pixels, storage)?,
            pixel_nearest: Buffer::new(context, "pixel_nearest", if by_kernels { n_pixels } else { 0 }, storage)?,
            pixel_features: Buffer::new(context, "pixel_features", if features { n_pixels } else { 0 }, storage)?,
            triangle_ids: Target::new(context, "triangle_ids", TargetKind::Id, size)?,
            depth: Target::new(context, "depth", TargetKind::Depth, size)?,
        })
    }

    /// Whether the frame's pixels have room, and no more buffers than the frame uses.
    pub fn fit(&self, frame: &Frame, options: &RenderOptions) -> bool {
        let (width, height) = self.triangle_ids.size();
        self.pixel_radiance.len() >= n_pixels(frame)
            && (width >= frame.picture_width && height >= frame.picture_height)
            && self.pixel_features.is_empty() != options.features
            && self.pixel_nearest.is_empty() == (options.primary != Primary::Compute)
            && self.pixel_filtered.is_some() == frame.denoise_threshold.is_finite()
    }

    /// Where nothing is drawn to triangle_ids: no kernel reads them then, but they are bound, in the layout of the set.
    pub fn leave_unread(&self, commands: &Commands) {
        commands.begin_targets(&self.triangle_ids, &self.depth);
        commands.ids_to_compute(&self.triangle_ids);
    }

    /// The image after the noise filter, or the one without it.
    pub fn filtered(&self) -> &Buffer<[f32; 4]> {
        self.pixel_filtered.as_ref().unwrap_or(&self.pixel_radiance)
    }

    /// The sums; unread and unwritten before there are any.
    pub(super) fn accumulated(&self) -> &Buffer<[f32; 4]> {
        self.pixel_accumulated.as_ref().unwrap_or(&self.pixel_radiance)
    }
}

/// Of the window.
pub fn n_pixels(frame: &Frame) -> usize {
    frame.width as usize * frame.height as usize
}
