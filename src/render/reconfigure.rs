//! What may change between frames: the scene and its tree stay on the device.

use super::{Renderer, lanes_to_share, schedule::Schedule};
use crate::{
    buffers::{Needs, Resources},
    frame::{Crop, RenderOptions},
    gpu::GpuError,
    layout::Frame,
    scene::Camera,
};

impl Renderer {
    /// Looks from elsewhere from the next sample on, which is the first of a new picture.
    pub fn set_camera(&mut self, camera: &Camera) {
        self.camera = *camera;
        self.reset_samples();
    }

    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The next sample is the first of a new picture.
    pub fn reset_samples(&mut self) {
        self.n_samples = 0;
        self.has_sums = false;
        self.pending = None;
    }

    /// Samples a pixel that the picture is the mean of.
    pub fn n_samples(&self) -> u32 {
        self.n_samples
    }

    pub fn options(&self) -> &RenderOptions {
        &self.options
    }

    /// Renders all of a picture of another size from the next sample on, the first. Memory is kept for the largest yet, so
    /// changes below that are cheap.
    ///
    /// # Errors
    /// Beyond the device's limits or memory; then nothing has changed, and a sample that is begun goes on.
    pub fn resize(&mut self, width: u32, height: u32) -> Result<(), GpuError> {
        let options = RenderOptions { width, height, crop: None, ..self.options.clone() };
        self.remake(&options)
    }

    /// Renders another part of the picture from the next sample on, the first. Memory is kept as [`Renderer::resize`]
    /// keeps it.
    ///
    /// # Errors
    /// Beyond the device's limits or memory; then nothing has changed.
    pub fn set_crop(&mut self, crop: Crop) -> Result<(), GpuError> {
        self.remake(&RenderOptions { crop: Some(crop), ..self.options.clone() })
    }

    /// Renders with other options from the next sample on. Kernels are made anew only where they differ. Samples are kept
    /// where only what is done with them changes: the exposure, the curve, the filter's threshold; [`Renderer::show`] shows that.
    ///
    /// # Errors
    /// Beyond the device's limits or memory, the driver refuses a kernel; then nothing has changed, and a sample that
    /// is begun goes on.
    pub fn set_options(&mut self, options: &RenderOptions) -> Result<(), GpuError> {
        self.remake(options)
    }

    /// Makes all kernels anew, of shaders that have changed. The next sample is the first of a new picture.
    ///
    /// # Errors
    /// The driver refuses a shader; then all are as before.
    #[cfg(feature = "hot-reload")]
    pub fn remake_passes(&mut self) -> Result<(), GpuError> {
        let passes = crate::passes::Passes::new(&self.context, &self.resources.bindings, &self.options)?;
        self.reset_samples();
        self.passes = passes;
        Ok(())
    }

    /// Makes all that other options need, and then puts it in its place by steps that cannot fail.
    fn remake(&mut self, options: &RenderOptions) -> Result<(), GpuError> {
        let (context, before) = (&self.context, &self.options);
        let mut constants = *self.resources.constants();
        constants.set_options(options);
        let room = (!same_samples(before, options)).then(|| self.with_room(constants, options)).transpose()?;
        let passes = self.passes.with_options(context, &self.resources.bindings, before, options)?;

        // Its commands hold pipelines and sets that go now.
        self.pending = None;
        match room {
            None => self.resources.set_constants(&constants),
            Some((resources, schedule)) => {
                if !std::ptr::eq(resources.pixels.pixel_display.any(), self.resources.pixels.pixel_display.any()) {
                    self.displayed = None;
                }
                self.reset_samples();
                (self.resources, self.schedule) = (resources, schedule);
            }
        }
        (self.passes, self.options) = (passes, options.clone());
        Ok(())
    }

    /// Buffers and batches for other sizes, another number of bounces, or other outputs.
    fn with_room(&self, constants: Frame, options: &RenderOptions) -> Result<(Resources, Schedule), GpuError> {
        let queue_capacity = self.budget.queue_capacity(self.context.limits(), &constants);
        let n_lanes = lanes_to_share(&self.context, options)?;
        let constants = Frame { queue_capacity, n_lanes, ..constants };
        let spans = self.budget.spans(&constants, self.most_pixels);
        let schedule = Schedule::new(&self.context, &constants, spans, options)?;
        let needs = Needs { constants: &constants, options, n_bounces: schedule.n_rows() };
        let accel = (self.options.traversal != options.traversal).then(|| self.world.accel());
        Ok((self.resources.for_frame(&self.context, accel, &needs)?, schedule))
    }
}

/// Whether all that differs is what becomes of the samples, with the same buffers.
fn same_samples(a: &RenderOptions, b: &RenderOptions) -> bool {
    let (denoise, tonemap) = (a.denoise, a.tonemap);
    let of_samples = |options: &RenderOptions| RenderOptions { exposure: 1.0, denoise, tonemap, ..options.clone() };
    of_samples(a) == of_samples(b) && std::mem::discriminant(&a.denoise) == std::mem::discriminant(&b.denoise)
}
