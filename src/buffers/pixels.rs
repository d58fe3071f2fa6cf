//! Buffers and images of pixels.

use std::sync::Arc;

use crate::{
    frame::{Denoise, Integrator, Primary, RenderOptions},
    gpu::{Buffer, BufferUse, Context, GpuError, Target, TargetKind},
    layout::{Auxiliary, Frame, PixelAovs, SAMPLE_BLOCK_LOG2},
};

/// Sums of samples for which each pixel of a frame of paths has room at least. They are enough for 4096 samples.
const SUMS_OF_PATHS: usize = 8;

/// Buffers and images of the window's pixels, rows from the top. The window is the part of the picture that is
/// rendered ([`Frame`]). Buffers may be longer than the window needs. A clone is a second handle to the same memory.
#[derive(Clone)]
pub struct Pixels {
    /// The radiance of the frame's sample, which the kernel `accumulate` replaces by the mean of all samples. There
    /// are `width * height` elements, as in all buffers here. If the picture has layers of light or of surfaces, as
    /// many elements follow for each of them.
    pub pixel_radiance: Buffer<[f32; 4]>,
    /// The sums of all samples; none before there is a second sample. Frames of paths have several sums for each
    /// element of `pixel_radiance` (glsl/passes/path_accumulate.comp).
    pub pixel_accumulated: Option<Buffer<[f32; 4]>>,
    /// The radiance after the noise filter. None without a noise filter, in which case later kernels read
    /// `pixel_radiance`. For the filter `edge`, it has twice as many elements: the second half is between two
    /// iterations.
    pub pixel_filtered: Option<Buffer<[f32; 4]>>,
    /// The displayed colour, 8 bits each: red in the lowest byte, green, blue, 255.
    pub pixel_display: Buffer<u32>,
    /// The nearest hit: the triangle's index in the lower half, the bits of the distance in the upper half. Empty
    /// unless compute kernels rasterize the primary rays ([`Primary::SoftwareRaster`]).
    pub pixel_nearest: Buffer<u64>,
    /// The first-hit AOVs. Empty unless the options request them.
    pub pixel_aovs: Buffer<PixelAovs>,
    /// What the noise filter `edge` knows of the pixels. Empty unless it runs.
    pub pixel_aux: Buffer<Auxiliary>,
    /// The index of the nearest triangle at each pixel of the whole picture, of which only the window's part is
    /// drawn. If the options do not use the graphics pipeline, this is one pixel that no kernel reads.
    pub triangle_ids: Arc<Target>,
    /// The depth image for `triangle_ids`. None if the options do not use the graphics pipeline.
    pub depth: Option<Arc<Target>>,
    /// 1, and 1 for each layer of light or of surfaces: the number of elements of `pixel_radiance` for each pixel.
    pub n_layers: u32,
}

impl Pixels {
    /// Makes the buffers and images that a frame needs.
    ///
    /// # Errors
    /// A buffer or image is beyond the device's limits, or memory runs out.
    pub fn new(context: &Arc<Context>, frame: &Frame, options: &RenderOptions) -> Result<Self, GpuError> {
        let n_pixels = n_pixels(frame);
        let size = (frame.picture_width, frame.picture_height);
        let storage = BufferUse::Storage;
        let (pixel_aovs, software_raster) = (options.pixel_aovs, options.primary == Primary::SoftwareRaster);
        let n_auxiliary = if options.noise_filter() == Denoise::Edge { n_pixels } else { 0 };
        let n_filtered = n_filtered(frame, options);
        let (triangle_ids, depth) = if uses_graphics_pipeline(options) {
            let target = |name, kind| Target::new(context, name, kind, size).map(Arc::new);
            (target("triangle_ids", TargetKind::Uint)?, Some(target("depth", TargetKind::Depth)?))
        } else {
            (Target::unread(context, "triangle_ids")?, None)
        };
        Ok(Self {
            pixel_radiance: Buffer::new(context, "pixel_radiance", n_pixels * n_layers(options) as usize, storage)?,
            pixel_accumulated: None,
            pixel_filtered: (n_filtered > 0)
                .then(|| Buffer::new(context, "pixel_filtered", n_filtered, storage))
                .transpose()?,
            pixel_display: Buffer::new(context, "pixel_display", n_pixels, storage)?,
            pixel_nearest: Buffer::new(context, "pixel_nearest", if software_raster { n_pixels } else { 0 }, storage)?,
            pixel_aovs: Buffer::new(context, "pixel_aovs", if pixel_aovs { n_pixels } else { 0 }, storage)?,
            pixel_aux: Buffer::new(context, "pixel_aux", n_auxiliary, storage)?,
            triangle_ids,
            depth,
            n_layers: n_layers(options),
        })
    }

    /// Returns the bytes of a pixel in the widest buffer that the options need.
    pub fn bytes_per_pixel(options: &RenderOptions) -> u64 {
        let widest = if options.pixel_aovs { size_of::<PixelAovs>() } else { 0 };
        let n_sums = if options.integrator == Integrator::Path { SUMS_OF_PATHS } else { 1 };
        let sums = n_sums * n_layers(options) as usize * size_of::<[f32; 4]>();
        widest.max(sums).max(size_of::<[f32; 4]>()).max(size_of::<u64>()) as u64
    }

    /// Returns the bytes that a pixel of a frame of paths takes for a picture of `n_samples` samples without a noise
    /// filter and without layers: the mean, the sums, and the colour for display. The memory of the paths themselves
    /// does not grow with the picture.
    pub fn bytes_per_pixel_of_paths(n_samples: u32) -> u64 {
        let blocks = n_samples >> SAMPLE_BLOCK_LOG2;
        // If each frame draws one block, there is a sum for each bit of the number of blocks before the last one, and
        // one more for the last.
        let n_sums = u64::from(blocks.saturating_sub(1).checked_ilog2().map_or(0, |log2| log2 + 1) + 1);
        (1 + n_sums) * size_of::<[f32; 4]>() as u64 + size_of::<u32>() as u64
    }

    /// Whether the buffers and images are large enough for the frame, and exist only if the frame uses them.
    pub fn fit(&self, frame: &Frame, options: &RenderOptions) -> bool {
        let (width, height) = self.triangle_ids.size();
        let has_targets = width >= frame.picture_width && height >= frame.picture_height;
        self.n_layers == n_layers(options)
            && self.pixel_radiance.len() >= n_pixels(frame) * self.n_layers as usize
            && (has_targets || !uses_graphics_pipeline(options))
            && self.depth.is_some() == uses_graphics_pipeline(options)
            && self.pixel_aovs.is_empty() != options.pixel_aovs
            && self.pixel_nearest.is_empty() == (options.primary != Primary::SoftwareRaster)
            && self.pixel_filtered.is_some() == (n_filtered(frame, options) > 0)
            && self.pixel_filtered.as_ref().map_or(0, Buffer::len) >= n_filtered(frame, options)
            && self.pixel_aux.is_empty() == (options.noise_filter() != Denoise::Edge)
    }

    /// The radiance after the noise filter, or without it if there is none.
    pub fn filtered(&self) -> &Buffer<[f32; 4]> {
        self.pixel_filtered.as_ref().unwrap_or(&self.pixel_radiance)
    }

    /// The sums of samples. If there are none yet, `pixel_radiance` takes their place in the descriptor set.
    pub(super) fn accumulated(&self) -> &Buffer<[f32; 4]> {
        self.pixel_accumulated.as_ref().unwrap_or(&self.pixel_radiance)
    }
}

/// The number of elements of `pixel_radiance` for each pixel: the picture's, and those of its layers.
fn n_layers(options: &RenderOptions) -> u32 {
    1 + options.mean_layers().len() as u32
}

/// Whether the graphics pipeline rasterizes the primary rays.
pub(crate) fn uses_graphics_pipeline(options: &RenderOptions) -> bool {
    options.primary == Primary::Raster
}

/// The number of elements of `pixel_filtered` that the noise filter needs.
fn n_filtered(frame: &Frame, options: &RenderOptions) -> usize {
    match options.noise_filter() {
        Denoise::Off => 0,
        Denoise::Paper { .. } => n_pixels(frame),
        Denoise::Edge => 2 * n_pixels(frame),
    }
}

/// The number of the window's pixels.
pub fn n_pixels(frame: &Frame) -> usize {
    frame.width as usize * frame.height as usize
}
