//! Draws a world's pictures, on the device or on the CPU.

use std::{borrow::Cow, sync::Arc};

use super::{
    group::RendererGroup,
    noise::{self, NoiseGoal, NoisePicture},
};
use crate::{
    cpu::{self, Batching},
    frame::{
        BadOptions, Denoise, Drawn, DrawnNoiseTiles, FrameRenderer, Goal, Integrator, NoiseTileSamples, NoiseTiles,
        PathOptions, Picture, RangeSums, RenderOptions, SampleRange, Unending, Watcher,
    },
    gpu::{Context, DeviceInfo, ExternalImage, GpuError, TimelinePoint},
    render::BandedRenderer,
    scene::Camera,
    world::World,
};

/// A picture, with the measurements and AOVs of its drawing.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// The picture.
    pub picture: Picture,
    /// Times, counts and AOVs.
    pub drawn: Drawn,
}

/// Draws pictures of a world, on the device or on the CPU.
pub struct Renderer {
    backend: Backend,
    options: RenderOptions,
}

enum Backend {
    Device(Box<BandedRenderer>),
    Group(Box<RendererGroup>),
    Cpu(Box<cpu::CpuRenderer>),
}

impl Renderer {
    /// Creates a renderer on the devices. If there are none, the renderer runs on the CPU.
    pub(super) fn new(contexts: &[Arc<Context>], world: &World, options: &RenderOptions) -> Result<Self, GpuError> {
        options.check()?;
        let backend = match contexts {
            [] => Backend::Cpu(Box::new(cpu::CpuRenderer::new(world, options, Batching::default()))),
            [context] => Backend::Device(Box::new(BandedRenderer::new(Arc::clone(context), world, options)?)),
            contexts => Backend::Group(Box::new(RendererGroup::new(contexts, world, options)?)),
        };
        Ok(Self { backend, options: options.clone() })
    }

    /// Returns what is known of the device. `None` for several devices and the CPU.
    pub fn device(&self) -> Option<&DeviceInfo> {
        if let Backend::Device(renderer) = &self.backend { Some(renderer.device()) } else { None }
    }

    /// Returns the number of bands: parts of the picture that are drawn one after the other.
    pub fn n_bands(&self) -> u32 {
        match &self.backend {
            Backend::Device(renderer) => renderer.n_bands(),
            Backend::Group(_) | Backend::Cpu(_) => 1,
        }
    }

    /// Draws another world from now on. If the world was made of this renderer's by
    /// [`World::with_instances_changed`], only the instances are uploaded, and emitters that have changed. If it is
    /// another moment of the same film, and devices build the structures of kept meshes, deformed meshes are uploaded
    /// in addition, and devices build their structures. The camera of the next picture is the one that
    /// [`Renderer::draw`] is given.
    ///
    /// # Errors
    /// The world exceeds the limits or the memory of all devices. Then nothing has changed, unless several meshes are
    /// deformed: some of them may have changed until a world is set again. If the world exceeds the limits of some
    /// devices, these draw nothing more, and a warning says so.
    pub fn set_world(&mut self, world: &World) -> Result<(), GpuError> {
        match &mut self.backend {
            Backend::Device(renderer) => renderer.set_world(world),
            Backend::Group(group) => group.set_world(world),
            Backend::Cpu(renderer) => {
                renderer.set_world(world);
                Ok(())
            }
        }
    }

    /// Sets the random numbers of the next pictures ([`PathOptions::seed`]). Only pictures of paths have any.
    ///
    /// # Errors
    /// The seed is out of its range, or a Vulkan call fails.
    pub fn set_seed(&mut self, seed: u32) -> Result<(), GpuError> {
        let paths = PathOptions { seed, ..self.options.paths };
        let options = RenderOptions { paths, ..self.options.clone() };
        options.check()?;
        if options.integrator == Integrator::Path {
            match &mut self.backend {
                Backend::Device(renderer) => renderer.set_seed(seed)?,
                Backend::Group(group) => group.set_seed(seed)?,
                Backend::Cpu(renderer) => renderer.set_seed(seed),
            }
        }
        self.options = options;
        Ok(())
    }

    /// Draws what a camera sees. The watcher is notified of each sample of each band. If it uses
    /// [`Watcher::sample_progress`], it is also notified of the progress within a sample. It can end the picture with
    /// fewer samples than the goal ([`Watcher::ends`]).
    ///
    /// # Errors
    /// The camera shows no picture, the goal is more than [`SampleRange::MOST`] samples, a call fails, one pixel alone
    /// makes more rays than a queue holds, or memory runs out.
    pub fn draw(&mut self, camera: &Camera, goal: Goal, mut watcher: impl Watcher) -> Result<Drawn, GpuError> {
        self.draw_watched(camera, goal, &mut watcher)
    }

    /// Draws the samples of a range with the path tracer, one aligned block after the other. Returns their sums, from
    /// which [`SampleSums::mean`](crate::frame::SampleSums::mean) makes the picture. The AOVs are those of the
    /// first block, with the noise of all. Layers that are means are those of all blocks.
    ///
    /// # Errors
    /// Fails as [`Renderer::draw`] does, or as [`SampleRange::check`] does.
    pub fn draw_range(
        &mut self,
        camera: &Camera,
        samples: SampleRange,
        mut watcher: impl Watcher,
    ) -> Result<(Drawn, RangeSums), GpuError> {
        samples.check()?;
        let mut all = DrawnBlocks::default();
        for block in samples.blocks() {
            self.draw_block(camera, block, &mut watcher, &mut all)?;
        }
        Ok(all.end())
    }

    /// Draws the samples of a range as [`Renderer::draw_range`] does, each at a moment of its own: `show` prepares the
    /// renderer for a sample, such as by [`Renderer::set_world`], and returns its camera. So what moves between the
    /// moments is blurred. The first sample's moment decides the AOVs. The watcher can end the picture after each
    /// sample.
    ///
    /// # Errors
    /// Fails as [`Renderer::draw_range`] and `show` do.
    pub fn draw_moments<E: From<GpuError>>(
        &mut self,
        samples: SampleRange,
        mut show: impl FnMut(&mut Self, u32) -> Result<Camera, E>,
        mut watcher: impl Watcher,
    ) -> Result<(Drawn, RangeSums), E> {
        samples.check().map_err(GpuError::from)?;
        let mut all = DrawnBlocks::default();
        for first in samples.first..samples.end {
            let camera = show(self, first)?;
            self.draw_block(&camera, SampleRange { first, end: first + 1 }, &mut watcher, &mut all)?;
            if watcher.ends() {
                break;
            }
        }
        Ok(all.end())
    }

    /// Draws an aligned block of samples.
    fn draw_block(
        &mut self,
        camera: &Camera,
        block: SampleRange,
        watcher: &mut impl Watcher,
        all: &mut DrawnBlocks,
    ) -> Result<(), GpuError> {
        match &mut self.backend {
            Backend::Device(renderer) => renderer.set_first_sample(block.first)?,
            Backend::Group(group) => group.set_first_sample(block.first),
            Backend::Cpu(renderer) => renderer.set_first_sample(block.first),
        }
        let drawn = self.draw_watched(camera, Goal::Samples(block.len()), &mut Unending(watcher))?;
        all.push(block, &self.picture()?.radiance, drawn);
        Ok(())
    }

    /// Draws what a camera sees until the noise of each tile of the picture is low, or the tile has the most samples.
    /// The watcher is notified as if the whole picture were one sample, which [`Renderer::draw`] draws band by band. It
    /// can end the picture while some tiles have more noise ([`Watcher::ends`]).
    ///
    /// # Errors
    /// Fails as [`Renderer::draw`] and [`NoiseGoal::check`] do, or if the options do not ask for paths, have a noise
    /// filter or another first sample than 0.
    pub fn draw_until(
        &mut self,
        camera: &Camera,
        goal: NoiseGoal,
        mut watcher: impl Watcher,
    ) -> Result<NoisePicture, GpuError> {
        let options = self.options.clone();
        goal.check()?;
        let is_unfiltered = options.integrator == Integrator::Path && options.noise_filter() == Denoise::Off;
        if !is_unfiltered || options.paths.first_sample != 0 || options.noise_tiles.is_some() {
            let needed = "the integrator path from sample 0 on, without noise filter and noise_tiles";
            return Err(BadOptions(format!("pictures of low noise need {needed}")).into());
        }
        self.set_camera(camera)?;
        let mut progress = BandProgress { n_bands: self.n_bands(), n_told: 0, watcher: &mut watcher };
        let n_devices = if let Backend::Group(group) = &self.backend { group.n_devices() } else { 1 };
        let mut draw = |tiles: &[NoiseTileSamples]| self.draw_noise_tiles(tiles);
        let drawn = noise::draw_until(goal, &options, (&mut draw, n_devices), |share| progress.set(share));
        // Also after an error, what is drawn next are rectangles.
        match &mut self.backend {
            Backend::Device(renderer) => {
                renderer.set_crop(options.crop_or_whole())?;
                renderer.set_first_sample(0)?;
            }
            Backend::Group(group) => group.leave_noise_tiles()?,
            Backend::Cpu(renderer) => renderer.set_window(None, 0),
        }
        progress.end();
        drawn
    }

    /// Draws samples of noise tiles.
    fn draw_noise_tiles(&mut self, tiles: &[NoiseTileSamples]) -> Result<DrawnNoiseTiles, GpuError> {
        match &mut self.backend {
            Backend::Device(renderer) => renderer.draw_noise_tiles(tiles),
            Backend::Group(group) => group.draw_noise_tiles(tiles),
            Backend::Cpu(renderer) => renderer.draw_noise_tiles(tiles, NoiseTiles::MOST),
        }
    }

    fn set_camera(&mut self, camera: &Camera) -> Result<(), BadOptions> {
        camera.check().map_err(|what| BadOptions(format!("camera: {what}")))?;
        match &mut self.backend {
            Backend::Device(renderer) => renderer.set_camera(camera),
            Backend::Group(group) => group.set_camera(camera),
            Backend::Cpu(renderer) => renderer.set_camera(camera),
        }
        Ok(())
    }

    fn draw_watched(&mut self, camera: &Camera, goal: Goal, watcher: &mut impl Watcher) -> Result<Drawn, GpuError> {
        goal.check()?;
        self.set_camera(camera)?;
        match &mut self.backend {
            Backend::Device(renderer) => renderer.draw(goal, watcher),
            Backend::Group(group) => group.draw(goal, watcher),
            Backend::Cpu(renderer) => renderer.draw_window(goal, watcher),
        }
    }

    /// Copies the displayed picture that was drawn last into the upper left corner of the caller's image: sRGB, 8
    /// bits a channel. The copy waits for the point `after` and signals the point `then`. The host does
    /// not wait for the copy.
    ///
    /// # Errors
    /// The renderer runs on the CPU or on several devices. The picture was drawn in several bands, so it is not on the
    /// device. The image is smaller than the picture. A call fails. In all these cases nothing is signalled.
    pub fn copy_picture_to(
        &self,
        image: &ExternalImage,
        after: Option<TimelinePoint>,
        then: Option<TimelinePoint>,
    ) -> Result<(), GpuError> {
        match &self.backend {
            Backend::Device(renderer) => renderer.copy_picture_to(image, after, then),
            Backend::Group(_) | Backend::Cpu(_) => {
                let device = if matches!(self.backend, Backend::Cpu(_)) { "CPU" } else { "several devices" };
                let missing = "images to copy a picture into".to_owned();
                Err(GpuError::Lacks { device: device.to_owned(), missing })
            }
        }
    }

    /// Returns the picture that was drawn last.
    ///
    /// # Errors
    /// The copy from the device fails.
    pub fn picture(&self) -> Result<Cow<'_, Picture>, GpuError> {
        match &self.backend {
            Backend::Device(renderer) => renderer.picture(),
            Backend::Group(group) => Ok(Cow::Borrowed(group.picture())),
            Backend::Cpu(renderer) => Ok(Cow::Owned(renderer.picture())),
        }
    }
}

/// Aligned blocks of samples that have been drawn one after the other.
#[derive(Default)]
struct DrawnBlocks {
    drawn: Option<Drawn>,
    sums: RangeSums,
}

impl DrawnBlocks {
    fn push(&mut self, block: SampleRange, radiance: &[[f32; 4]], next: Drawn) {
        self.sums.push_mean(block, radiance, &next.layers);
        match &mut self.drawn {
            None => self.drawn = Some(next),
            Some(all) => {
                all.profile.add(&next.profile);
                all.n_samples += next.n_samples;
                all.pixel_aovs.iter_mut().zip(&next.pixel_aovs).for_each(|(all, next)| all.join_noise(next));
            }
        }
    }

    fn end(self) -> (Drawn, RangeSums) {
        (Drawn { layers: self.sums.mean_of_layers(), ..self.drawn.unwrap_or_default() }, self.sums)
    }
}

/// Tells a watcher of the progress of one sample of a picture, as if the picture were drawn band by band.
struct BandProgress<'a, W> {
    n_bands: u32,
    /// Number of bands of which the watcher knows that they are done.
    n_told: u32,
    watcher: &'a mut W,
}

impl<W: Watcher> BandProgress<'_, W> {
    /// Notes which share of the picture is done, 0 to 1. A share that is less than before tells the watcher of no band.
    /// Returns whether the watcher ends the picture.
    fn set(&mut self, share: f32) -> bool {
        let n_done = share * self.n_bands as f32;
        // The last band is done when the picture is.
        self.tell_bands((n_done as u32).min(self.n_bands - 1));
        self.watcher.sample_progress((n_done - self.n_told as f32).clamp(0.0, 1.0));
        self.watcher.ends()
    }

    fn end(&mut self) {
        self.tell_bands(self.n_bands);
    }

    fn tell_bands(&mut self, n_done: u32) {
        (self.n_told..n_done).for_each(|_| self.watcher.sample());
        self.n_told = self.n_told.max(n_done);
    }
}
