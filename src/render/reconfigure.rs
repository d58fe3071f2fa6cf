//! Changes between frames: of the camera, the size, the crop and the options. The scene and its acceleration
//! structure stay on the device; a change of the traversal adds the links that it reads.

use std::{ptr, sync::Arc};

use super::{GpuRenderer, in_use, lanes_to_share, schedule::Schedule};
use crate::{
    buffers::{Needs, Resources},
    frame::{Crop, FrameRenderer, Integrator, RenderOptions},
    gpu::GpuError,
    layout::{Frame, constants},
    passes::FramePasses,
    scene::Camera,
    world::{Emitters, World},
};

impl GpuRenderer {
    /// Sets the camera. The next sample is the first of a new picture.
    pub fn set_camera(&mut self, camera: &Camera) {
        self.camera = *camera;
        self.reset_samples();
    }

    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Sets the picture's size, pixels, and removes its crop. If either changes, the next sample is the first of a
    /// new picture. The buffers of the largest picture so far are kept, so that changes below its size are cheap.
    ///
    /// # Errors
    /// The size is out of its range, or the picture exceeds the device's limits or memory. Then nothing has changed,
    /// and a pending sample stays pending.
    pub fn resize(&mut self, width: u32, height: u32) -> Result<(), GpuError> {
        let options = RenderOptions { width, height, crop: None, ..self.options.clone() };
        self.set_options(&options)
    }

    /// Sets the part of the picture to render. If it changes, the next sample is the first of a new picture. Buffers
    /// are kept as [`GpuRenderer::resize`] keeps them.
    ///
    /// # Errors
    /// The crop is empty or exceeds the picture, or the part exceeds the device's limits or memory. Then nothing has
    /// changed.
    pub fn set_crop(&mut self, crop: Crop) -> Result<(), GpuError> {
        self.set_options(&RenderOptions { crop: Some(crop), ..self.options.clone() })
    }

    /// Creates all kernels again, from shaders that have changed. The next sample is the first of a new picture.
    ///
    /// # Errors
    /// The driver refuses a shader. Then all kernels are as before.
    #[cfg(feature = "view")]
    pub fn remake_passes(&mut self) -> Result<(), GpuError> {
        let passes = FramePasses::new(&self.context, &self.resources.bindings, &self.in_use)?;
        self.reset_samples();
        self.passes = passes;
        Ok(())
    }

    /// Draws another world from now on. The next sample is the first of a new picture. If the world was made of this
    /// renderer's by [`World::with_instances_changed`], only the instances are uploaded, and emitters that have
    /// changed. If it is another moment of the same film, and the device builds the structures of kept meshes, only
    /// these and deformed meshes are uploaded, and only the structures of those meshes are built. The picture that is
    /// displayed stays so until another one is drawn.
    ///
    /// # Errors
    /// The world exceeds the device's limits or memory, or the driver refuses a kernel. Then nothing has changed,
    /// unless several meshes are deformed: some of them may have changed until a world is set again.
    pub fn set_world(&mut self, world: &World) -> Result<(), GpuError> {
        if world.is_pose_of(&self.world) && self.set_pose(world)? {
            return Ok(());
        }
        let scene = (self.context.clone(), world);
        let mut next = Self::with_capacity(scene, &self.options, self.budget.fixed_capacity, None)?;
        if let Some(resources) = next.resources.with_pixels_of(&self.resources, &self.in_use)? {
            (next.resources, next.displayed) = (resources, self.displayed);
        }
        self.become_other(next);
        Ok(())
    }

    /// Uploads what differs in another pose of the world, and builds the structures of deformed meshes. Returns whether
    /// that was possible.
    fn set_pose(&mut self, world: &World) -> Result<bool, GpuError> {
        let lights = [world, &self.world].map(|world| &world.scene().lights);
        let has_device_structures = self.resources.accel.shared().is_some();
        if lights[0].len() != lights[1].len() || !(has_device_structures || world.shares_geometries(&self.world)) {
            return Ok(false);
        }
        let of_paths = self.in_use.integrator == Integrator::Path;
        let emitters = || [world, &self.world].map(World::emitters);
        let are_same = |[now, before]: [&Emitters; 2]| ptr::eq(now, before) || now == before;
        let differs = [lights[0] != lights[1], of_paths && !are_same(emitters())];
        let mut resources = self.resources.with_instances(&self.context, world, differs)?;
        let mut constants = *resources.constants();
        constants.set_light_of(&world.frame_constants(&self.in_use));
        resources.set_constants(&constants);
        // Kernels are made for kinds of emitters.
        let kinds = if of_paths { world.emitters().kinds() } else { 0 };
        let passes = if of_paths && kinds != self.world.emitters().kinds() {
            resources.bindings = resources.bindings.with_constant(constants::EMITTERS, kinds);
            Some(FramePasses::new(&self.context, &resources.bindings, &self.in_use)?)
        } else {
            None
        };
        if has_device_structures && !resources.accel.set_pose(&self.context, world, &self.resources.accel)? {
            return Ok(false);
        }
        self.reset_samples();
        (self.resources, self.world) = (resources, world.clone());
        if let Some(passes) = passes {
            self.passes = passes;
        }
        Ok(true)
    }

    /// Sets the options of the next samples. Only kernels that depend on a changed option are created again. Samples
    /// are kept if only their display changes: the exposure, the tone curve or the filter's threshold.
    /// [`GpuRenderer::show`] then displays them by the new options, unless a pending sample has overwritten some of
    /// their radiance. A pending sample is dropped.
    ///
    /// # Errors
    /// An option is out of its range, the options exceed the device's limits or memory, or the driver refuses a kernel.
    /// Then nothing has changed, and a pending sample stays pending.
    pub fn set_options(&mut self, options: &RenderOptions) -> Result<(), GpuError> {
        // What the changed options need is created first, and then installed by steps that cannot fail.
        options.check_ranges()?;
        let (asked, options) = (options.clone(), &in_use(options));
        if options.integrator != self.in_use.integrator {
            return self.replace(&asked);
        }
        let (context, before) = (&self.context, &self.in_use);
        let mut constants = *self.resources.constants();
        constants.set_options(options);
        let room = (!same_samples(before, options)).then(|| self.with_room(constants, options)).transpose()?;
        let passes = self.passes.with_options(context, &self.resources.bindings, before, options)?;

        // The commands of a pending sample use pipelines and descriptor sets that are released here.
        self.pending = None;
        match room {
            None => self.resources.set_constants(&constants),
            Some((resources, schedule)) => {
                if !Arc::ptr_eq(resources.pixels.pixel_display.any(), self.resources.pixels.pixel_display.any()) {
                    self.displayed = None;
                }
                self.reset_samples();
                (self.resources, self.schedule) = (resources, schedule);
            }
        }
        (self.passes, self.in_use, self.options) = (passes, options.clone(), asked);
        Ok(())
    }

    /// Becomes another renderer of the same world, for another integrator.
    fn replace(&mut self, options: &RenderOptions) -> Result<(), GpuError> {
        let next = self.sharing(options)?;
        self.become_other(next);
        Ok(())
    }

    /// Becomes another renderer, which keeps the camera and the view.
    fn become_other(&mut self, mut next: Self) {
        next.set_camera(&self.camera);
        next.false_color = self.false_color;
        next.needs_primary_rays_only = self.needs_primary_rays_only;
        *self = next;
    }

    /// Creates the buffers and the batches for options that need other ones, such as another size or number of
    /// bounces. Buffers that are large enough are shared with the current resources.
    fn with_room(&self, constants: Frame, options: &RenderOptions) -> Result<(Resources, Schedule), GpuError> {
        let queue_capacity = self.budget.queue_capacity(self.context.limits(), self.context.info(), &constants);
        let n_lanes = lanes_to_share(&self.context, options)?;
        let constants = Frame { queue_capacity, n_lanes, ..constants };
        let spans = self.budget.spans(&constants, self.most_pixels);
        let schedule = Schedule::new(&self.context, &constants, spans, options)?;
        let needs = Needs { constants: &constants, options, n_bounces: schedule.n_rows() };
        let links = (self.in_use.traversal != options.traversal).then(|| self.world.geometry());
        Ok((self.resources.for_frame(&self.context, links, &needs)?, schedule))
    }
}

/// Whether the samples and buffers of options `a` serve options `b`, too. They do if the options differ at most in
/// the exposure, the tone curve and the filter's threshold.
fn same_samples(a: &RenderOptions, b: &RenderOptions) -> bool {
    let (denoise, tonemap) = (a.denoise, a.tonemap);
    let of_samples = |options: &RenderOptions| RenderOptions { exposure: 1.0, denoise, tonemap, ..options.clone() };
    of_samples(a) == of_samples(b) && std::mem::discriminant(&a.denoise) == std::mem::discriminant(&b.denoise)
}
