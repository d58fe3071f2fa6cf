//! The window: handles its events, and defines the order of work in a frame.

use std::{
    path::Path,
    sync::Arc,
    time::{Duration, Instant},
};

use winit::{
    application::ApplicationHandler,
    dpi::PhysicalSize,
    event::WindowEvent,
    event_loop::{ActiveEventLoop, ControlFlow},
    window::{Window, WindowId},
};

use super::{
    display::{PaceReport, ViewOptions, ViewReport},
    error::ViewError,
    gpu_session::GpuSession,
    input::{Action, Input},
    loaded_scene::LoadedScene,
    message::Topic,
    panel::{Layers, Settings},
    reload::{Reloader, Wake},
    script::Script,
    session::Session,
    ui::{Layout, Ui, is_press, is_tab, lay_out},
};
use crate::{
    engine::choices::{Choices, Request},
    frame::{FrameRenderer, RenderOptions},
    gpu::GpuError,
};

/// The viewer's state, driven by the event loop.
pub(super) struct App {
    session: Session,
    options: ViewOptions,
    script: Option<Script>,
    reloader: Reloader,
    input: Input,
    /// None until the window is open.
    shown: Option<Shown>,
    /// Choices made when the window was opened; none before.
    choices: Option<Choices>,
    layers: Layers,
    is_occluded: bool,
    /// Whether the device was lost and opened again, and no frame has been shown since.
    is_reopened: bool,
    outcome: Result<(), ViewError>,
}

/// An open window with its device and overlay.
struct Shown {
    gpu: GpuSession,
    ui: Ui,
    window: Arc<Window>,
}

impl App {
    pub fn new(session: Session, options: ViewOptions, script: Option<Script>, reloader: Reloader) -> Self {
        Self {
            session,
            layers: Layers {
                panel: options.overlay,
                keys: false,
                hint: options.overlay && script.is_none(),
                messages: options.overlay,
                start: false,
            },
            options,
            script,
            reloader,
            input: Input::default(),
            shown: None,
            choices: None,
            is_occluded: false,
            is_reopened: false,
            outcome: Ok(()),
        }
    }

    fn open(&mut self, event_loop: &ActiveEventLoop) -> Result<Shown, ViewError> {
        let Settings { options, vsync, .. } = &self.session.settings;
        let attributes = Window::default_attributes()
            .with_title(self.title())
            .with_inner_size(PhysicalSize::new(options.width, options.height));
        let window = event_loop.create_window(attributes).map_err(|error| ViewError::Window(error.to_string()))?;
        let window = Arc::new(window);
        let (device, loaded) = (&self.options.device, &self.session.loaded);
        let gpu =
            GpuSession::open(window.clone(), device, loaded, options, loaded.load_settings.builder.request, *vsync)?;
        self.choices = Some(gpu.choices.clone());
        self.session.settings.options = gpu.renderer.options().clone();
        Ok(Shown { gpu, ui: Ui::new(&window), window })
    }

    fn title(&self) -> String {
        let loaded = &self.session.loaded;
        if loaded.is_open() { format!("kdray: {}", loaded.scene().name) } else { "kdray".to_owned() }
    }

    /// Returns the layers that show something now.
    fn seen_layers(&self) -> Layers {
        if !self.session.loaded.is_open() {
            return Layers { start: true, panel: false, messages: false, ..self.layers };
        }
        Layers { messages: self.layers.messages && self.session.message.is_some(), ..self.layers }
    }

    /// Opens a file that the user has dropped on the window. A tour goes on with its own scene.
    fn open_file(&mut self, path: &Path) {
        if self.script.is_some() {
            return;
        }
        self.session.note_opening(path);
        self.reloader.open(path);
        if let Some(Shown { window, .. }) = &self.shown {
            window.request_redraw();
        }
    }

    /// Shows the file that was opened, or the error.
    fn opened(&mut self, opened: Result<LoadedScene, String>) {
        if let Some(Shown { gpu, window, .. }) = &mut self.shown {
            if self.session.open_scene(gpu, opened) {
                self.reloader.follow(&self.session.loaded);
            }
            window.request_redraw();
        }
        if let Some(Shown { window, .. }) = &self.shown {
            window.set_title(&self.title());
        }
        self.reloader.done();
    }

    fn end(&mut self, event_loop: &ActiveEventLoop, outcome: Result<(), ViewError>) {
        if self.outcome.is_ok() {
            self.outcome = outcome;
        }
        event_loop.exit();
    }

    /// Draws one frame: lays out the overlay, draws a sample and shows both.
    fn frame(&mut self, event_loop: &ActiveEventLoop) {
        let Some(mut shown) = self.shown.take() else { return };
        let result = self.draw(&mut shown);
        match result {
            Ok(true) => self.end(event_loop, Ok(())),
            Ok(false) => {}
            // A device that is lost again before it has shown a frame is not opened once more.
            Err(ViewError::Device(error)) if error.is_device_lost() && !self.is_reopened => {
                self.recover(shown, event_loop, error);
                return;
            }
            Err(error) => self.end(event_loop, Err(error)),
        }
        self.shown = Some(shown);
    }

    /// Draws and shows a frame. Returns true when the script has ended.
    fn draw(&mut self, shown: &mut Shown) -> Result<bool, ViewError> {
        let layers = self.seen_layers();
        let Shown { gpu, ui, window } = shown;
        let size = window.inner_size();
        let size = (size.width, size.height);
        if size.0 == 0 || size.1 == 0 {
            return Ok(false);
        }
        // A script's pictures have the size of the options, whatever size the window manager gives the window.
        let picture = match &mut self.script {
            Some(script) => {
                script.direct(&mut self.session);
                (self.options.settings.options.width, self.options.settings.options.height)
            }
            None => size,
        };
        let session = &mut self.session;
        if layers.panel {
            session.point_at(gpu, size, self.input.pointer())?;
        }
        let layout = layers.any().then(|| lay_out(session, gpu, (ui, window, layers), self.input.is_flying()));
        session.draw(gpu, picture)?;
        session.save_if_due(gpu, picture);
        let frame = match layout {
            Some(Layout { frame, textures }) => {
                gpu.update_textures(textures)?;
                Some(frame)
            }
            None => None,
        };
        if !gpu.show(size, frame.as_ref())? {
            return Ok(false);
        }
        let RenderOptions { width, height, .. } = *gpu.renderer.options();
        session.shown((width, height));
        self.is_reopened = false;
        match &mut self.script {
            Some(script) => Ok(script.shown(session, gpu)?),
            None => Ok(false),
        }
    }

    /// Opens the device again after it was lost. Ends the viewer if that fails.
    fn recover(&mut self, shown: Shown, event_loop: &ActiveEventLoop, error: GpuError) {
        let Shown { gpu, ui, window } = shown;
        drop((gpu, ui));
        self.session.show_error(Topic::Device, &format!("{error}; the device was opened again"));
        let Settings { options, vsync, .. } = &self.session.settings;
        let loaded = &self.session.loaded;
        let (traversal, primary) = (Some(options.traversal), Some(options.primary));
        let request = Request { traversal, primary, ..loaded.load_settings.builder.request };
        match GpuSession::open(window.clone(), &self.options.device, loaded, options, request, *vsync) {
            Ok(gpu) => {
                self.is_reopened = true;
                // Replaced shaders were lost with the device, so they are compiled again.
                self.reloader.compile_shaders();
                self.shown = Some(Shown { gpu, ui: Ui::new(&window), window });
            }
            Err(error) => self.end(event_loop, Err(error.into())),
        }
    }

    fn act(&mut self, event_loop: &ActiveEventLoop, action: Action) {
        let Some(Shown { gpu, window, .. }) = &mut self.shown else { return };
        let size = window.inner_size();
        match action {
            Action::Quit if self.layers.keys => self.layers.keys = false,
            Action::Quit => self.quit(event_loop),
            Action::ToggleKeys => self.layers.keys = !self.layers.keys,
            _ if !self.session.loaded.is_open() => {}
            Action::TogglePanel => self.layers.panel = !self.layers.panel,
            action => self.session.act(action, gpu, (size.width.max(1), size.height.max(1))),
        }
    }

    /// Ends the viewer because the user closes it. A save that is due is begun first; [`App::report`] waits for it.
    fn quit(&mut self, event_loop: &ActiveEventLoop) {
        if let Some(Shown { gpu, .. }) = &self.shown {
            self.session.save_as_it_is(gpu);
        }
        self.end(event_loop, Ok(()));
    }

    /// Handles an event of the user. The overlay may take the event. Otherwise the event moves the camera or triggers
    /// an action.
    fn handle_input(&mut self, event_loop: &ActiveEventLoop, event: &WindowEvent) {
        let layers = self.seen_layers();
        let Some(Shown { ui, window, .. }) = &mut self.shown else { return };
        let is_overlays = layers.any() && !is_tab(event) && ui.take_event(window, event);
        self.layers.hint &= !is_press(event);
        window.request_redraw();
        if is_overlays || self.script.is_some() {
            return;
        }
        let (now, size) = (Instant::now(), window.inner_size());
        let effect = self.input.handle(event, (size.width, size.height), &mut self.session.controller);
        if effect.moves {
            self.session.pace.moved(now);
        }
        if effect.moves || effect.action.is_some() {
            self.session.pace.note_input(now);
        }
        if let Some(action) = effect.action {
            self.act(event_loop, action);
        }
    }

    /// Returns the report after the event loop has ended.
    pub fn report(mut self) -> Result<ViewReport, ViewError> {
        self.session.finish_saves();
        self.outcome?;
        let frames = &self.session.all_frames;
        let pace =
            PaceReport { frame_ms: frames.pace(), input_to_present_ms: frames.latency(), moving: frames.moving() };
        let (Some(Shown { gpu, ui, window }), Some(choices)) = (self.shown, self.choices) else {
            return Err(ViewError::Window("it closed before it opened".to_owned()));
        };
        let context = gpu.context.clone();
        // The validation layer may also report errors of the release, so its messages are read after it.
        drop((gpu, ui, window));
        let (device, validation) = (context.info().name.clone(), context.validation_messages());
        Ok(ViewReport { device, choices, pace, validation })
    }
}

impl ApplicationHandler<Wake> for App {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if self.shown.is_none() {
            match self.open(event_loop) {
                Ok(shown) => {
                    self.shown = Some(shown);
                }
                Err(error) => self.end(event_loop, Err(error)),
            }
        }
    }

    fn user_event(&mut self, _: &ActiveEventLoop, wake: Wake) {
        match wake {
            Wake::Changed => self.reloader.load(),
            Wake::Reloaded(loaded) => {
                if let Some(Shown { gpu, window, .. }) = &mut self.shown {
                    self.session.replace_scene(gpu, *loaded);
                    window.request_redraw();
                }
                self.reloader.done();
            }
            Wake::Progress(text) => {
                if let (true, Some(Shown { window, .. })) = (self.reloader.is_loading(), &self.shown) {
                    self.session.note_progress(&text);
                    window.request_redraw();
                }
            }
            Wake::Opened(opened) => self.opened(*opened),
            Wake::Saved => {
                self.session.report_saves();
                if let Some(Shown { window, .. }) = &self.shown {
                    window.request_redraw();
                }
            }
            Wake::ShadersChanged => self.reloader.compile_shaders(),
            Wake::Compiled(shaders) => {
                if let Some(Shown { gpu, window, .. }) = &mut self.shown {
                    self.session.replace_shaders(gpu, shaders);
                    window.request_redraw();
                }
                self.reloader.shaders_compiled();
            }
        }
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        match event {
            WindowEvent::CloseRequested => self.quit(event_loop),
            WindowEvent::RedrawRequested => self.frame(event_loop),
            WindowEvent::DroppedFile(path) => self.open_file(&path),
            WindowEvent::Occluded(is_occluded) => self.is_occluded = is_occluded,
            WindowEvent::Resized(_) | WindowEvent::ScaleFactorChanged { .. } => {
                if let Some(Shown { gpu, .. }) = &mut self.shown {
                    gpu.presenter.mark_stale();
                    // While the user resizes the window, pictures are drawn small and fast.
                    self.session.pace.moved(Instant::now());
                }
                self.handle_input(event_loop, &event);
            }
            event => self.handle_input(event_loop, &event),
        }
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        let Some(Shown { gpu, ui, window }) = &self.shown else { return };
        let (now, size) = (Instant::now(), window.inner_size());
        let is_busy = self.script.is_some() || self.session.is_busy(gpu, now, (size.width, size.height));
        let wait = if is_busy || !self.seen_layers().any() { Duration::MAX } else { ui.repaint_after() };
        let has_area = size.width > 0 && size.height > 0;
        // A script goes on even if its window is hidden.
        let is_seen = self.script.is_some() || !(self.is_occluded || window.is_minimized() == Some(true));
        if !is_seen || !has_area {
            event_loop.set_control_flow(ControlFlow::Wait);
        } else if is_busy || wait.is_zero() {
            window.request_redraw();
            event_loop.set_control_flow(ControlFlow::Poll);
        } else {
            self.session.pace.pause();
            event_loop.set_control_flow(match now.checked_add(wait) {
                Some(at) => ControlFlow::WaitUntil(at),
                None => ControlFlow::Wait,
            });
        }
    }
}
