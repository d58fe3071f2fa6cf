//! The buffers and images of pixels.

use std::sync::Arc;

use crate::{
    frame::{Primary, RenderOptions},
    gpu::{Buffer, BufferUse, Context, GpuError, Target, TargetKind},
    layout::{Feature, Frame},
};

/// Room for the window's pixels, rows from the top; buffers may be longer. A clone is a second handle to the same
/// memory.
#[derive(Clone)]
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
    /// The nearest triangles of the whole picture, of which only the window's part is drawn. One pixel that no kernel
    /// reads where the options do not ask for the graphics pipeline.
    pub triangle_ids: Arc<Target>,
    /// Depth that belongs to `triangle_ids`; none where nothing is drawn.
    pub depth: Option<Arc<Target>>,
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
        let (triangle_ids, depth) = if draws(options) {
            let target = |name, kind| Target::new(context, name, kind, size).map(Arc::new);
            (target("triangle_ids", TargetKind::Uint)?, Some(target("depth", TargetKind::Depth)?))
        } else {
            (Arc::new(Target::unread(context, "triangle_ids")?), None)
        };
        Ok(Self {
            pixel_radiance: Buffer::new(context, "pixel_radiance", n_pixels, storage)?,
            pixel_accumulated: None,
            pixel_filtered: filters.then(|| Buffer::new(context, "pixel_filtered", n_pixels, storage)).transpose()?,
            pixel_display: Buffer::new(context, "pixel_display", n_pixels, storage)?,
            pixel_nearest: Buffer::new(context, "pixel_nearest", if by_kernels { n_pixels } else { 0 }, storage)?,
            pixel_features: Buffer::new(context, "pixel_features", if features { n_pixels } else { 0 }, storage)?,
            triangle_ids,
            depth,
        })
    }

    /// Bytes of a pixel in the widest buffer that the options ask for.
    pub fn bytes_a_pixel(options: &RenderOptions) -> u64 {
        let widest = if options.features { size_of::<Feature>() } else { 0 };
        widest.max(size_of::<[f32; 4]>()).max(size_of::<u64>()) as u64
    }

    /// Whether the frame's pixels have room, and no more buffers than the frame uses.
    pub fn fit(&self, frame: &Frame, options: &RenderOptions) -> bool {
        let (width, height) = self.triangle_ids.size();
        let has_targets = width >= frame.picture_width && height >= frame.picture_height;
        self.pixel_radiance.len() >= n_pixels(frame)
            && (has_targets || !draws(options))
            && self.depth.is_some() == draws(options)
            && self.pixel_features.is_empty() != options.features
            && self.pixel_nearest.is_empty() == (options.primary != Primary::Compute)
            && self.pixel_filtered.is_some() == frame.denoise_threshold.is_finite()
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

/// Whether the graphics pipeline draws triangles.
pub(crate) fn draws(options: &RenderOptions) -> bool {
    options.primary == Primary::Raster
}

/// Of the window.
pub fn n_pixels(frame: &Frame) -> usize {
    frame.width as usize * frame.height as usize
}
