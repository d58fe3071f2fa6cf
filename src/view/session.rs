//! The viewer's state without the window: scene, camera and settings. Decides what each frame draws.

use std::time::Instant;

use super::{
    budget::{BATCH_MS, Budget, N_BUDGETS, budget_ix, differs_by_two},
    controller::Controller,
    gpu_session::GpuSession,
    history::{FrameRecord, History},
    in_motion::{InMotion, PictureKind},
    loaded_scene::LoadedScene,
    message::{Message, Topic},
    pace::Pace,
    panel::{Facts, Settings},
    pick::Picked,
    saver::Saver,
    timeline::Timeline,
};
use crate::{
    accel::Statistics,
    frame::{Denoise, Profile, RenderOptions, View},
    gpu::GpuError,
    layout::PixelAovs,
    scene::RenderDefaults,
};

/// Initial number of parts of a full-quality picture, before its cost has been measured.
const FIRST_BATCHES: u32 = 64;
/// Least length in seconds of the history that the panel shows.
const HISTORY_S: f64 = 5.0;
/// A pixel has the cost view's full brightness if its rays read this many nodes per level of the kd-tree. A pixel has
/// several rays, each of which goes down and up the tree several times.
const STEPS_PER_LEVEL: u32 = 16;

/// Returns the number of reads per pixel that the cost view shows at full brightness. In a grid, a ray goes through
/// at most as many cells as the sum of the grid's resolutions along the axes, and a pixel has a few such rays.
fn brightest_cost(statistics: &Statistics) -> u32 {
    match statistics {
        Statistics::KdTree(tree) => STEPS_PER_LEVEL * tree.depth.max(1),
        Statistics::Grid(grid) => 2 * grid.resolution.iter().sum::<u32>().max(8),
    }
}

/// State of the viewer: the scene, the camera, the settings and the history of frames.
pub struct Session {
    pub loaded: LoadedScene,
    pub settings: Settings,
    pub controller: Controller,
    pub pace: Pace,
    /// Frames of the last seconds, with the times of their passes.
    pub history: History,
    /// All frames, without the times of their passes.
    pub all_frames: History,
    /// Budgets by [`budget_ix`].
    pub(super) budgets: [Budget; N_BUDGETS],
    pub(super) profile: Profile,
    /// Whether a user moves the camera. Then a new picture is first drawn small, so that it is shown at once. With a
    /// script, only frames in which the camera moves are drawn small: see `Script::direct`.
    is_interactive: bool,
    /// Whether the last frame was drawn while the camera moved, or an animation played.
    pub(super) is_moving: bool,
    /// Whether the last frame completed a sample.
    has_new_sample: bool,
    /// The kind of the pictures that are drawn now.
    drawing: PictureKind,
    /// For each [`PictureKind`], maximum width and maximum height of all pictures so far, pixels. The buffers of the
    /// kind's renderer are large enough for them.
    pub(super) rooms: [(u32, u32); PictureKind::N],
    /// Size of the window for which the last frame was drawn, pixels.
    window: (u32, u32),
    /// Time spent so far on the sample that is being drawn, milliseconds.
    sample_ms: f64,
    pub(super) picked: Option<Picked>,
    /// The AOVs of the pixel under the pointer, from the last picture with AOVs.
    pub(super) pointed: Option<PixelAovs>,
    /// Whether the user has asked to save the picture. It is saved once a picture of the window's size is displayed,
    /// even if further samples are to come.
    pub(super) is_save_due: bool,
    /// Prints text to the terminal.
    pub(super) print: fn(&str),
    pub(super) saver: Saver,
    pub(super) message: Option<Message>,
    start: Instant,
}

impl Session {
    /// Creates the state of a viewer that prints to the terminal with `print` and saves pictures with `saver`.
    pub fn new(
        loaded: LoadedScene,
        settings: Settings,
        is_interactive: bool,
        (print, saver): (fn(&str), Saver),
    ) -> Self {
        Self {
            controller: Controller::new(loaded.scene().camera, loaded.built.bounds),
            budgets: [(); N_BUDGETS].map(|()| Budget::new(settings.budget_ms)),
            drawing: PictureKind::of(&settings.options),
            loaded,
            settings,
            pace: Pace::default(),
            history: History::new(HISTORY_S),
            all_frames: History::new(f64::INFINITY),
            profile: Profile::default(),
            is_interactive,
            is_moving: false,
            has_new_sample: false,
            sample_ms: 0.0,
            rooms: Default::default(),
            window: (0, 0),
            picked: None,
            pointed: None,
            is_save_due: false,
            print,
            saver,
            message: None,
            start: Instant::now(),
        }
    }

    /// Returns whether the next frame will differ from the last one. `window` is the window's size in pixels.
    pub fn is_busy(&self, gpu: &GpuSession, now: Instant, window: (u32, u32)) -> bool {
        let options = gpu.renderer.options();
        let is_small = window != (options.width, options.height);
        is_small
            || self.controller.flight.is_under_way()
            || self.pace.is_moving(now)
            || self.loaded.timeline.as_ref().is_some_and(Timeline::is_busy)
            || self.is_learning()
            || PictureKind::of(options) != self.at_rest() // the picture at rest is due
            || self.has_new_sample // the overlay shows its figures a frame later
            || !self.is_done(gpu)
    }

    /// Returns whether the time of a picture is still unknown. Small pictures are drawn until it is known.
    fn is_learning(&self) -> bool {
        self.is_interactive && self.budgets[self.budget_ix(self.in_motion())].full_ms().is_none()
    }

    /// Returns the kind of the picture at rest.
    pub(super) fn at_rest(&self) -> PictureKind {
        PictureKind::of(&self.settings.options)
    }

    /// Returns the kind of pictures while the camera moves. Views other than the picture show the numbers of the
    /// picture at rest.
    fn in_motion(&self) -> PictureKind {
        match self.settings.view {
            View::Picture => self.settings.in_motion.kind(&self.settings.options),
            _ => self.at_rest(),
        }
    }

    /// Returns the options of a picture of the window's size, of a kind that is drawn at rest or in motion.
    fn whole(&self, kind: PictureKind, (width, height): (u32, u32)) -> RenderOptions {
        let pixel_aovs = self.settings.view != View::Picture;
        let at_rest = &self.settings.options;
        let whole = RenderOptions { width, height, pixel_aovs, ..at_rest.clone() };
        let integrator = kind.integrator();
        if kind == self.at_rest() {
            return whole;
        }
        if integrator == at_rest.integrator {
            let denoise = if kind == PictureKind::FilteredPath { Denoise::Edge } else { Denoise::Off };
            return RenderOptions { denoise, ..whole };
        }
        // What differs between integrators is what the scene states for this one.
        let RenderDefaults { max_depth, denoise, .. } = self.loaded.scene().defaults.for_integrator(Some(integrator));
        let max_depth = max_depth.min(at_rest.max_depth);
        RenderOptions { integrator, max_depth, denoise, approximates_ambient: true, ..whole }
    }

    /// Returns whether the picture has all its samples.
    pub fn is_done(&self, gpu: &GpuSession) -> bool {
        !gpu.renderer.is_pending() && gpu.renderer.n_samples() >= self.n_wanted()
    }

    /// Returns the number of samples per pixel with which the view is complete. Views of primary hits need a single
    /// sample, and so does the background while no file is open.
    fn n_wanted(&self) -> u32 {
        let needs_one = self.settings.view.needs_primary_rays_only() || !self.loaded.is_open();
        if needs_one { 1 } else { self.settings.max_samples }
    }

    /// Returns the index of the budget of the current view in pictures of a kind.
    fn budget_ix(&self, kind: PictureKind) -> usize {
        budget_ix(kind, self.settings.view.needs_primary_rays_only())
    }

    /// Returns the budget of what is drawn now.
    fn budget(&self) -> &Budget {
        &self.budgets[self.budget_ix(self.drawing)]
    }

    fn budget_mut(&mut self) -> &mut Budget {
        &mut self.budgets[self.budget_ix(self.drawing)]
    }

    /// Draws one more sample or a part of it. While the camera moves, the picture is as much smaller than the window
    /// as the time budget requires. `window` is the window's size in pixels, not 0.
    ///
    /// # Errors
    /// A Vulkan call fails. Settings that the device refuses are not an error: the previous settings return.
    pub fn draw(&mut self, gpu: &mut GpuSession, window: (u32, u32)) -> Result<(), GpuError> {
        let now = Instant::now();
        let seconds = self.pace.begin(now);
        if self.controller.flight.is_under_way() {
            self.controller.advance(seconds);
            self.pace.moved(now);
        }
        // Frames in flight read the objects that change here.
        gpu.wait_for_all()?;
        self.show_moment(gpu, now)?;
        self.budgets.iter_mut().for_each(|budget| budget.set_budget(self.settings.budget_ms));
        self.fit_window(gpu, window)?;
        self.drawing = PictureKind::of(gpu.renderer.options());
        let whole = self.whole(self.drawing, window);
        let (view, brightest) = self.view();
        let is_other_view = gpu.renderer.set_view(view, brightest);
        let makes_room = !self.has_room(gpu, &whole);
        let is_elsewhere = self.controller.camera() != gpu.renderer.camera();
        if is_elsewhere || is_other_view {
            self.save_as_it_is(gpu);
        }
        if self.is_interactive && (is_elsewhere || is_other_view || makes_room) {
            // The new picture is drawn small first, so that it is shown at once.
            gpu.renderer.reset_samples();
            self.pace.moved(now);
        }
        let is_moving = self.pace.is_moving(now) || self.is_learning();
        self.is_moving = self.pace.is_moving(now);
        let kind = if is_moving { self.in_motion() } else { self.at_rest() };
        let whole = self.whole(kind, window);
        let is_changed = kind != self.drawing;
        if is_changed {
            self.change_to(gpu, &whole)?;
        }
        let is_elsewhere = self.controller.camera() != gpu.renderer.camera();
        let makes_room = if is_changed { !self.has_room(gpu, &whole) } else { makes_room };
        let (width, height) = if is_moving { self.budget().size(window) } else { window };
        let asked = RenderOptions { width, height, ..whole.clone() };
        let is_new = asked != *gpu.renderer.options();
        // Buffers for the full-size picture are allocated before a small one is drawn. Allocating them later would
        // discard the small picture.
        let steps = [(is_moving && makes_room).then_some(&whole), is_new.then_some(&asked)];
        for options in steps.into_iter().flatten() {
            if let Err(error) = gpu.renderer.set_options(options) {
                self.take_back(gpu, error)?;
                break;
            }
        }
        if is_elsewhere {
            gpu.renderer.set_camera(self.controller.camera());
        }
        if self.is_learning() {
            gpu.renderer.reset_samples();
        }
        self.has_new_sample = false;
        if !self.is_done(gpu) {
            self.draw_batch(gpu, window, is_moving)?;
        } else if is_new || is_changed {
            gpu.renderer.show()?;
        }
        if gpu.renderer.n_samples() > 0 {
            gpu.note_picture();
        }
        if !self.keeps_both() {
            gpu.drop_other();
        }
        Ok(())
    }

    /// Changes to the renderer of another kind of pictures. If the device refuses it, the one that is used stays.
    fn change_to(&mut self, gpu: &mut GpuSession, whole: &RenderOptions) -> Result<(), GpuError> {
        match gpu.change_to(whole) {
            Ok(()) => {
                self.drawing = PictureKind::of(whole);
                // A renderer that is made anew has room for no more than this.
                self.rooms[self.drawing as usize] = (whole.width, whole.height);
                let (view, brightest) = self.view();
                gpu.renderer.set_view(view, brightest);
                Ok(())
            }
            Err(error) => {
                let now = gpu.renderer.options();
                if PictureKind::of(whole) == self.at_rest() && now.integrator == whole.integrator {
                    // The device refuses another filter of the picture at rest.
                    self.settings.options.denoise = now.denoise;
                } else {
                    // No other picture takes the place of the one at rest any more.
                    self.settings.in_motion = InMotion::Path;
                }
                self.take_back(gpu, error)
            }
        }
    }

    /// Returns whether the picture in motion is of another kind than the one at rest, so that both renderers are kept.
    fn keeps_both(&self) -> bool {
        self.settings.in_motion.kind(&self.settings.options) != self.at_rest()
    }

    /// Adapts the budgets if the window's size has changed.
    fn fit_window(&mut self, gpu: &mut GpuSession, window: (u32, u32)) -> Result<(), GpuError> {
        let before = std::mem::replace(&mut self.window, window);
        if before == window || before == (0, 0) {
            return Ok(());
        }
        let n_pixels = |(width, height): (u32, u32)| f64::from(width) * f64::from(height);
        let ratio = n_pixels(window) / n_pixels(before);
        self.budgets.iter_mut().for_each(|budget| budget.resize(ratio));
        // A large window would consist of too many parts if they stayed as small as those of a small window.
        gpu.renderer.limit_batches(None)
    }

    /// Returns whether the renderer's buffers are large enough for a picture with the options `whole`. Also adds the
    /// picture's size to `rooms`, since the caller enlarges the buffers if they are too small.
    fn has_room(&mut self, gpu: &GpuSession, whole: &RenderOptions) -> bool {
        let now = gpu.renderer.options();
        let room = &mut self.rooms[PictureKind::of(whole) as usize];
        let has_room = whole.width <= room.0 && whole.height <= room.1;
        *room = (room.0.max(whole.width), room.1.max(whole.height));
        let filter = |options: &RenderOptions| std::mem::discriminant(&options.noise_filter());
        has_room && whole.pixel_aovs == now.pixel_aovs && filter(whole) == filter(now)
    }

    /// Draws the rest of the sample recording by recording, until the sample is complete or half of [`BATCH_MS`] is
    /// spent. At rest, parts are so small that input does not wait long; while the camera moves, parts are as large as
    /// possible.
    fn draw_batch(&mut self, gpu: &mut GpuSession, window: (u32, u32), is_moving: bool) -> Result<(), GpuError> {
        let renderer = &mut gpu.renderer;
        if !renderer.is_pending() {
            self.sample_ms = 0.0;
            let most_pixels = self.batch_pixels(window).filter(|_| !is_moving);
            if renderer.n_samples() == 0 || differs_by_two(most_pixels, renderer.most_pixels()) {
                renderer.limit_batches(most_pixels)?;
            }
        }
        let start = Instant::now();
        let spent_ms = || start.elapsed().as_secs_f64() * 1e3;
        let mut complete = renderer.draw_batch()?;
        // A part may take less than expected: estimates from small pictures are too high. Then further parts follow.
        while complete.is_none() && spent_ms() < BATCH_MS / 2.0 {
            complete = renderer.draw_batch()?;
        }
        self.sample_ms += spent_ms();
        if let Some(profile) = complete {
            let share = f64::from(renderer.options().height) / f64::from(window.1);
            let sample_ms = self.sample_ms;
            self.budget_mut().learn(share, sample_ms);
            self.profile = profile;
            self.has_new_sample = true;
        }
        Ok(())
    }

    /// Returns the number of pixels of a part of a picture at rest.
    fn batch_pixels(&self, window: (u32, u32)) -> Option<u32> {
        let is_unknown = self.budget().full_ms().is_none() && self.keeps_both();
        if is_unknown {
            Some((window.0 * window.1).div_ceil(FIRST_BATCHES))
        } else {
            self.budget().batch_pixels(window)
        }
    }

    /// Returns to the options that the device accepted last, and shows a message. The viewer goes on, because the
    /// user may be unable to undo the change, such as the window's size. Returns the error if the device is lost.
    fn take_back(&mut self, gpu: &GpuSession, error: GpuError) -> Result<(), GpuError> {
        if error.is_device_lost() {
            return Err(error);
        }
        if PictureKind::of(gpu.renderer.options()) == self.at_rest() || !self.keeps_both() {
            self.settings.options = gpu.renderer.options().clone();
        } else {
            self.settings.in_motion = InMotion::Path;
        }
        self.show_error(Topic::Settings, &error.to_string());
        Ok(())
    }

    /// Returns whether pictures are still to be saved.
    pub fn has_saves(&self) -> bool {
        self.is_save_due || self.saver.is_busy()
    }

    /// Records the times of a frame that was handed to the screen. `picture` is the size of its picture in pixels.
    pub fn shown(&mut self, picture: (u32, u32)) {
        let now = Instant::now();
        let times = self.pace.shown(now);
        let record = FrameRecord {
            shown_s: now.duration_since(self.start).as_secs_f64(),
            frame_ms: times.frame_ms,
            latency_ms: times.latency_ms,
            moving: self.is_moving.then_some(picture),
            pass_ms: Vec::new(),
        };
        self.all_frames.push(record.clone());
        let passes = self.profile.passes.iter().filter(|_| self.has_new_sample);
        let pass_ms = passes.filter_map(|pass| Some((pass.name, pass.ms?))).collect();
        self.history.push(FrameRecord { pass_ms, ..record });
    }

    /// Returns the current view, and the value that it shows brightest.
    fn view(&self) -> (View, f32) {
        let automatic = match self.settings.view {
            View::Picture | View::Normal | View::Id => 1.0,
            View::Depth => self.controller.radius(),
            View::Rays => (1 + self.loaded.scene().lights.len() as u32 * self.settings.options.max_depth) as f32,
            View::Cost => brightest_cost(&self.loaded.statistics) as f32,
        };
        (self.settings.view, automatic / self.settings.gain)
    }

    /// Returns the facts that the overlay shows. `window` is the window's size in pixels.
    pub fn facts<'a>(&'a self, gpu: &'a GpuSession, window: (u32, u32), is_flying: bool) -> Facts<'a> {
        let options = gpu.renderer.options();
        Facts {
            device: gpu.context.as_ref().map_or("CPU", |context| &context.info().name),
            is_on_cpu: gpu.context.is_none(),
            loaded: &self.loaded,
            window,
            picture: (options.width, options.height),
            n_samples: gpu.renderer.n_samples(),
            n_wanted: self.n_wanted(),
            progress: gpu.renderer.progress(),
            speed: self.controller.flight.speed(),
            is_flying,
            is_save_due: self.is_save_due,
            profile: &self.profile,
            history: &self.history,
            memory: gpu.context.as_ref().map_or_else(Vec::new, |context| context.memory()),
            view: self.view(),
            pointed: self.pointed,
            picked: self.picked.as_ref(),
            message: self.message.as_ref(),
            timeline: self.loaded.timeline.as_ref(),
        }
    }

    /// Shows an error in the overlay, in place of the last one, and on the terminal.
    pub fn show_error(&mut self, topic: Topic, message: &str) {
        tracing::warn!("{message}");
        self.message = Some(Message::error(topic, message));
    }

    /// Clears the overlay's message if it is about this topic, which works again.
    pub fn clear_message(&mut self, topic: Topic) {
        self.message.take_if(|message| message.topic == topic);
    }
}
