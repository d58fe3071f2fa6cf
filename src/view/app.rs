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
    event_loop::{ActiveEventLoop, ControlFlow, EventLoopProxy},
    keyboard::KeyCode,
    window::{Window, WindowId},
};

use super::{
    away::{Away, Home, Later, PATIENCE, Returned, Then, is_press_of},
    display::{PaceReport, ViewOptions, ViewReport},
    error::ViewError,
    gpu_session::GpuSession,
    input::{Action, Input},
    message::Topic,
    overlay::OverlayFrame,
    panel::Overlays,
    reload::{Reloader, Wake},
    screen::Screen,
    script::Script,
    session::Session,
    ui::{Layout, Ui, is_press, is_tab, lay_out},
};
use crate::{
    engine::choices::{Choices, Request},
    frame::RenderOptions,
    gpu::GpuError,
};

/// The viewer's state, driven by the event loop.
pub(super) struct App {
    /// The session and its renderers; none while a thread works on them.
    home: Option<Box<Home>>,
    /// The work that is under way; none while the session is at home.
    away: Option<Away>,
    proxy: EventLoopProxy<Wake>,
    options: ViewOptions,
    script: Option<Script>,
    reloader: Reloader,
    input: Input,
    /// None until the window is open.
    shown: Option<Shown>,
    /// Choices made when the window was opened; none before.
    choices: Option<Choices>,
    overlays: Overlays,
    is_occluded: bool,
    /// Whether the device was lost and opened again, and no frame has been shown since.
    is_reopened: bool,
    outcome: Result<(), ViewError>,
}

/// An open window with the device that shows pictures in it, and its overlay.
struct Shown {
    screen: Screen,
    ui: Ui,
    window: Arc<Window>,
}

impl App {
    pub fn new(
        session: Session,
        options: ViewOptions,
        script: Option<Script>,
        reloader: Reloader,
        proxy: EventLoopProxy<Wake>,
    ) -> Self {
        Self {
            home: Some(Box::new(Home { session, gpu: None })),
            away: None,
            proxy,
            overlays: Overlays {
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

    /// Opens the window.
    fn open(&mut self, event_loop: &ActiveEventLoop) -> Result<(), ViewError> {
        let Some(Home { session, .. }) = self.home.as_deref() else { return Ok(()) };
        let RenderOptions { width, height, .. } = session.settings.options;
        let attributes =
            Window::default_attributes().with_title(title(session)).with_inner_size(PhysicalSize::new(width, height));
        let window = event_loop.create_window(attributes).map_err(|error| ViewError::Window(error.to_string()))?;
        let request = session.loaded.load_settings.builder.request;
        self.open_device(event_loop, Arc::new(window), request)
    }

    /// Opens the device, whose renderer a thread makes.
    fn open_device(
        &mut self,
        event_loop: &ActiveEventLoop,
        window: Arc<Window>,
        request: Request,
    ) -> Result<(), ViewError> {
        let Some(Home { session, .. }) = self.home.as_deref() else { return Ok(()) };
        let (screen, context) = {
            let (device, on_cpu) = (&self.options.device, self.options.on_cpu);
            Screen::open(window.clone(), device, (session.settings.vsync, on_cpu))?
        };
        self.shown = Some(Shown { screen, ui: Ui::new(&window), window });
        self.lend(event_loop, Then::Begin, move |Home { session, gpu }| {
            let opened = GpuSession::open(context, &session.loaded, &session.settings.options, request)?;
            session.settings.options = opened.renderer.options().clone();
            *gpu = Some(opened);
            Ok(true)
        });
        Ok(())
    }

    /// Lends the session to work, which a thread does, and waits for its end for a moment.
    fn lend(
        &mut self,
        event_loop: &ActiveEventLoop,
        then: Then,
        work: impl FnOnce(&mut Home) -> Result<bool, ViewError> + Send + 'static,
    ) {
        // Events may still follow the one that has ended the viewer. Its report needs the session.
        if event_loop.exiting() {
            return;
        }
        let Some(home) = self.home.take() else { return };
        let away = Away::start(home, then, work, (self.proxy.clone(), self.options.on_cpu));
        let returned = away.wait(PATIENCE);
        self.away = Some(away);
        self.take_back(event_loop, returned);
    }

    /// Lends the session to work on its renderers. Nothing is done if there are none.
    fn lend_renderers(
        &mut self,
        event_loop: &ActiveEventLoop,
        then: Then,
        work: impl FnOnce(&mut Session, &mut GpuSession) -> Result<bool, ViewError> + Send + 'static,
    ) {
        let of_home = move |Home { session, gpu }: &mut Home| gpu.as_mut().map_or(Ok(false), |gpu| work(session, gpu));
        self.lend(event_loop, then, of_home);
    }

    /// Takes the session back from work that has ended, and handles the events that have waited for it.
    fn take_back(&mut self, event_loop: &ActiveEventLoop, returned: Option<Returned>) {
        let Some((home, result)) = returned else { return };
        let Some(Away { then, later, error, .. }) = self.away.take() else { return };
        self.home = Some(home);
        let failed = error.map_or(Ok(()), |error| Err(error.into()));
        let finished =
            result.and_then(|is_good| self.finish(then, is_good)).and_then(|has_ended| failed.map(|()| has_ended));
        match finished {
            Ok(true) => self.end(event_loop, Ok(())),
            Ok(false) => {}
            Err(error) => self.fail(event_loop, error),
        }
        for event in later {
            match event {
                Later::Window(event) => self.handle(event_loop, event),
                Later::Wake(wake) => self.wake(event_loop, wake),
            }
        }
    }

    /// Does what follows work that has ended. Returns true when the script has ended.
    fn finish(&mut self, then: Then, is_good: bool) -> Result<bool, ViewError> {
        let (Some(home), Some(Shown { screen, window, .. })) = (self.home.as_deref_mut(), &mut self.shown) else {
            return Ok(false);
        };
        let Home { session, gpu: Some(gpu) } = home else { return Ok(false) };
        match then {
            Then::Begin => {
                self.choices.get_or_insert_with(|| gpu.choices.clone());
                if self.is_reopened {
                    // Replaced shaders were lost with the device, so they are compiled again.
                    self.reloader.compile_shaders();
                }
            }
            Then::Show { size, overlay } => {
                screen.take_picture(gpu)?;
                if !screen.show(size, overlay.as_ref())? {
                    return Ok(false);
                }
                let RenderOptions { width, height, .. } = *gpu.renderer.options();
                session.shown((width, height));
                self.is_reopened = false;
                return match &mut self.script {
                    Some(script) => Ok(script.shown(session, gpu)?),
                    None => Ok(false),
                };
            }
            Then::Reloaded => self.reloader.done(),
            Then::Opened => {
                if is_good {
                    self.reloader.follow(&session.loaded);
                    window.set_title(&title(session));
                }
                self.reloader.done();
            }
            Then::Shaders(shaders) => {
                if let Some(Err(error)) = shaders.filter(|_| is_good).map(|it| screen.replace_shaders(gpu, it)) {
                    session.show_error(Topic::Shaders, &format!("shaders: {error}"));
                }
                self.reloader.shaders_compiled();
            }
        }
        window.request_redraw();
        Ok(false)
    }

    /// Opens a lost device again, and ends the viewer on any other error. A device that is lost again before it has
    /// shown a frame is not opened once more.
    fn fail(&mut self, event_loop: &ActiveEventLoop, error: ViewError) {
        match error {
            // The user has closed the window meanwhile.
            _ if event_loop.exiting() => {}
            ViewError::Device(error) if error.is_device_lost() && !self.is_reopened => self.recover(event_loop, error),
            error => self.end(event_loop, Err(error)),
        }
    }

    /// Returns the overlays that show something now.
    fn shown_overlays(&self, session: &Session) -> Overlays {
        if !session.loaded.is_open() {
            return Overlays { start: true, panel: false, messages: false, ..self.overlays };
        }
        Overlays { messages: self.overlays.messages && session.message.is_some(), ..self.overlays }
    }

    /// Opens a file that the user has dropped on the window. A tour goes on with its own scene.
    fn open_file(&mut self, path: &Path) {
        let Some(home) = self.home.as_deref_mut().filter(|_| self.script.is_none()) else { return };
        home.session.note_opening(path);
        self.reloader.open(path);
        self.request_redraw();
    }

    fn request_redraw(&self) {
        self.shown.iter().for_each(|shown| shown.window.request_redraw());
    }

    fn end(&mut self, event_loop: &ActiveEventLoop, outcome: Result<(), ViewError>) {
        if self.outcome.is_ok() {
            self.outcome = outcome;
        }
        event_loop.exit();
    }

    /// Draws one frame: lays out the overlay, lets a thread draw a sample, and shows both.
    fn frame(&mut self, event_loop: &ActiveEventLoop) {
        match self.lay_out() {
            Ok(Some((size, picture, overlay))) => {
                let then = Then::Show { size, overlay };
                self.lend_renderers(event_loop, then, move |session, gpu| {
                    session.draw(gpu, picture)?;
                    session.save_if_due(gpu, picture);
                    Ok(true)
                });
            }
            Ok(None) => {}
            Err(error) => self.fail(event_loop, error),
        }
    }

    /// Lays out the overlay. Returns it with the sizes of the window and of the picture, pixels. Returns none if
    /// nothing is drawn now.
    #[expect(clippy::type_complexity, reason = "the tuple is taken apart at once")]
    fn lay_out(&mut self) -> Result<Option<((u32, u32), (u32, u32), Option<OverlayFrame>)>, ViewError> {
        let Some(Home { session, .. }) = self.home.as_deref() else { return Ok(None) };
        let overlays = self.shown_overlays(session);
        let (Some(home), Some(Shown { screen, ui, window })) = (self.home.as_deref_mut(), &mut self.shown) else {
            return Ok(None);
        };
        let Home { session, gpu: Some(gpu) } = home else { return Ok(None) };
        let size = window.inner_size();
        let size = (size.width, size.height);
        if size.0 == 0 || size.1 == 0 {
            return Ok(None);
        }
        // A script's pictures have the size of the options, whatever size the window manager gives the window.
        let picture = match &mut self.script {
            Some(script) => {
                script.direct(session);
                (self.options.settings.options.width, self.options.settings.options.height)
            }
            None => size,
        };
        if overlays.panel {
            session.point_at(gpu, size, self.input.pointer())?;
        }
        let layout = overlays.any().then(|| lay_out(session, gpu, (ui, window, overlays), self.input.is_flying()));
        screen.presenter.set_vsync(session.settings.vsync);
        let overlay = match layout {
            Some(Layout { frame, textures }) => {
                screen.update_textures(textures)?;
                Some(frame)
            }
            None => None,
        };
        Ok(Some((size, picture, overlay)))
    }

    /// Shows the last picture, and what the window waits for, while a thread works on the session.
    fn show_waiting(&mut self) {
        let (Some(away), Some(Shown { screen, ui, window })) = (&mut self.away, &mut self.shown) else { return };
        let says = away.says(Instant::now()).filter(|_| self.overlays.messages);
        let size = window.inner_size();
        if size.width == 0 || size.height == 0 || away.error.is_some() {
            return;
        }
        let layout = says.map(|text| ui.layout_waiting(window, &text));
        let shown = match layout {
            Some(Layout { frame, textures }) => {
                screen.update_textures(textures).and_then(|()| screen.show((size.width, size.height), Some(&frame)))
            }
            None => screen.show((size.width, size.height), None),
        };
        away.error = shown.err();
    }

    /// Opens the device again after it was lost. Ends the viewer if that fails.
    fn recover(&mut self, event_loop: &ActiveEventLoop, error: GpuError) {
        let (Some(home), Some(shown)) = (self.home.as_deref_mut(), self.shown.take()) else { return };
        let Home { session, gpu } = home;
        *gpu = None;
        let Shown { screen, ui, window } = shown;
        drop((screen, ui));
        session.show_error(Topic::Device, &format!("{error}; the device was opened again"));
        let options = &session.settings.options;
        let (traversal, primary) = (Some(options.traversal), Some(options.primary));
        let request = Request { traversal, primary, ..session.loaded.load_settings.builder.request };
        self.is_reopened = true;
        if let Err(error) = self.open_device(event_loop, window, request) {
            self.end(event_loop, Err(error));
        }
    }

    fn act(&mut self, event_loop: &ActiveEventLoop, action: Action) {
        let (Some(home), Some(Shown { window, .. })) = (self.home.as_deref_mut(), &self.shown) else { return };
        let size = window.inner_size();
        match action {
            Action::Quit if self.overlays.keys => self.overlays.keys = false,
            Action::Quit => self.quit(event_loop),
            Action::ToggleKeys => self.overlays.keys = !self.overlays.keys,
            _ if !home.session.loaded.is_open() => {}
            Action::TogglePanel => self.overlays.panel = !self.overlays.panel,
            action => {
                if let Some(gpu) = &home.gpu {
                    home.session.act(action, gpu, (size.width.max(1), size.height.max(1)));
                }
            }
        }
    }

    /// Ends the viewer because the user closes it. A save that is due is begun first; [`App::report`] waits for it.
    /// Work that takes long is not waited for: nothing can end a driver that compiles.
    fn quit(&mut self, event_loop: &ActiveEventLoop) {
        while let Some(returned) = self.away.as_ref().map(Away::wait_to_close) {
            if returned.is_none() {
                break;
            }
            self.take_back(event_loop, returned);
        }
        if let Some(Home { session, gpu: Some(gpu) }) = self.home.as_deref_mut() {
            session.save_as_it_is(gpu);
        }
        self.end(event_loop, Ok(()));
    }

    /// Handles an event of the user. The overlay may take the event. Otherwise the event moves the camera or triggers
    /// an action.
    fn handle_input(&mut self, event_loop: &ActiveEventLoop, event: &WindowEvent) {
        let Some(Home { session, .. }) = self.home.as_deref() else { return };
        let overlays = self.shown_overlays(session);
        let (Some(home), Some(Shown { ui, window, .. })) = (self.home.as_deref_mut(), &mut self.shown) else { return };
        let is_overlays = overlays.any() && !is_tab(event) && ui.take_event(window, event);
        self.overlays.hint &= !is_press(event);
        window.request_redraw();
        if is_overlays || self.script.is_some() {
            return;
        }
        let session = &mut home.session;
        let (now, size) = (Instant::now(), window.inner_size());
        let effect = self.input.handle(event, (size.width, size.height), &mut session.controller);
        if effect.moves {
            session.pace.moved(now);
        }
        if effect.moves || effect.action.is_some() {
            session.pace.note_input(now);
        }
        if let Some(action) = effect.action {
            self.act(event_loop, action);
        }
    }

    /// Returns the report after the event loop has ended.
    pub fn report(mut self) -> Result<ViewReport, ViewError> {
        let Some(home) = self.home else { return self.abandoned() };
        let Home { mut session, gpu } = *home;
        session.finish_saves();
        self.outcome?;
        let frames = &session.all_frames;
        let pace =
            PaceReport { frame_ms: frames.pace(), input_to_present_ms: frames.latency(), moving: frames.moving() };
        let (Some(Shown { screen, ui, window }), Some(gpu)) = (self.shown.take(), gpu) else {
            return Err(ViewError::Window("it closed before it opened".to_owned()));
        };
        let (shows, draws) = (screen.context().clone(), gpu.context.clone());
        let draws = draws.filter(|draws| !Arc::ptr_eq(draws, &shows));
        // The validation layer may also report errors of the release, so its messages are read after it.
        drop((gpu, screen, ui, window));
        let device = if self.options.on_cpu { "CPU".to_owned() } else { shows.info().name.clone() };
        let validation = std::iter::once(shows).chain(draws).flat_map(|it| it.validation_messages()).collect();
        Ok(ViewReport { device, choices: self.choices, pace, validation, is_abandoned: false })
    }

    /// Returns the report of a viewer that was closed while a thread worked on the session. The thread still uses the
    /// device, so nothing is released.
    fn abandoned(mut self) -> Result<ViewReport, ViewError> {
        let context = self.shown.as_ref().map(|shown| shown.screen.context().clone());
        std::mem::forget((self.shown.take(), self.away.take()));
        self.outcome?;
        let context = context.ok_or_else(|| ViewError::Window("it closed before it opened".to_owned()))?;
        let pace = PaceReport { frame_ms: None, input_to_present_ms: None, moving: None };
        let device = if self.options.on_cpu { "CPU".to_owned() } else { context.info().name.clone() };
        let validation = context.validation_messages();
        Ok(ViewReport { device, choices: self.choices, pace, validation, is_abandoned: true })
    }

    fn wake(&mut self, event_loop: &ActiveEventLoop, wake: Wake) {
        if let Wake::Returned = wake {
            let returned = self.away.as_ref().and_then(|away| away.wait(Duration::ZERO));
            return self.take_back(event_loop, returned);
        }
        if let Some(away) = &mut self.away {
            away.later.push(Later::Wake(wake));
            return;
        }
        let Some(home) = self.home.as_deref_mut() else { return };
        match wake {
            Wake::Returned => {}
            Wake::Changed => self.reloader.load(),
            Wake::Reloaded(loaded) => self.lend_renderers(event_loop, Then::Reloaded, |session, gpu| {
                session.replace_scene(gpu, *loaded);
                Ok(true)
            }),
            Wake::Progress(text) => {
                if self.reloader.is_loading() {
                    home.session.note_progress(&text);
                    self.request_redraw();
                }
            }
            Wake::Opened(opened) => {
                self.lend_renderers(event_loop, Then::Opened, |session, gpu| Ok(session.open_scene(gpu, *opened)));
            }
            Wake::Saved => {
                home.session.report_saves();
                self.request_redraw();
            }
            Wake::ShadersChanged => self.reloader.compile_shaders(),
            Wake::Compiled(shaders) => {
                let then = Then::Shaders(shaders.as_ref().ok().cloned());
                self.lend_renderers(event_loop, then, |session, gpu| Ok(session.replace_shaders(gpu, shaders)));
            }
        }
    }

    /// Returns whether an event quits the viewer while a thread works on the session. In a tour Escape does nothing,
    /// and it closes the list of keys or what the panel has opened first.
    fn is_quit(&self, event: &WindowEvent) -> bool {
        let has_keys = self.overlays.keys || self.shown.as_ref().is_some_and(|shown| shown.ui.has_keyboard());
        is_press_of(event, &[KeyCode::Escape]) && self.script.is_none() && !has_keys
    }

    /// Handles an event of the window, or notes it for later while a thread works on the session.
    fn handle(&mut self, event_loop: &ActiveEventLoop, event: WindowEvent) {
        let quits = self.is_quit(&event);
        match (event, &mut self.away) {
            (WindowEvent::CloseRequested, _) => self.quit(event_loop),
            (WindowEvent::RedrawRequested, Some(_)) => self.show_waiting(),
            (WindowEvent::RedrawRequested, None) => self.frame(event_loop),
            (WindowEvent::Occluded(is_occluded), _) => self.is_occluded = is_occluded,
            (_, Some(_)) if quits => self.quit(event_loop),
            (event, Some(away)) => {
                away.later.push(Later::Window(event));
            }
            (WindowEvent::DroppedFile(path), None) => self.open_file(&path),
            (event, None) => {
                let is_resized = matches!(event, WindowEvent::Resized(_) | WindowEvent::ScaleFactorChanged { .. });
                if let Some(home) = self.home.as_deref_mut().filter(|_| is_resized) {
                    // While the user resizes the window, pictures are drawn small and fast.
                    home.session.pace.moved(Instant::now());
                }
                self.handle_input(event_loop, &event);
            }
        }
    }
}

fn title(session: &Session) -> String {
    let loaded = &session.loaded;
    if loaded.is_open() { format!("kdray: {}", loaded.scene().name) } else { "kdray".to_owned() }
}

impl ApplicationHandler<Wake> for App {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if self.shown.is_none()
            && let Err(error) = self.open(event_loop)
        {
            self.end(event_loop, Err(error));
        }
    }

    fn user_event(&mut self, event_loop: &ActiveEventLoop, wake: Wake) {
        self.wake(event_loop, wake);
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        if let (WindowEvent::Resized(_) | WindowEvent::ScaleFactorChanged { .. }, Some(shown)) =
            (&event, &mut self.shown)
        {
            shown.screen.presenter.mark_stale();
            shown.window.request_redraw();
        }
        self.handle(event_loop, event);
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        let Some(Shown { ui, window, .. }) = &self.shown else { return };
        let now = Instant::now();
        // A script goes on even if its window is hidden.
        let is_seen = self.script.is_some() || !(self.is_occluded || window.is_minimized() == Some(true));
        if let Some(away) = &self.away {
            // Work that panics wakes nobody.
            let returned = away.wait(Duration::ZERO);
            if returned.is_some() {
                return self.take_back(event_loop, returned);
            }
            if now >= away.next_drawing() && is_seen {
                window.request_redraw();
            }
            event_loop.set_control_flow(ControlFlow::WaitUntil(away.next_drawing().max(now + PATIENCE / 4)));
            return;
        }
        let Some(Home { session, gpu: Some(gpu) }) = self.home.as_deref() else { return };
        let size = window.inner_size();
        let is_busy = self.script.is_some() || session.is_busy(gpu, now, (size.width, size.height));
        let wait = if is_busy || !self.shown_overlays(session).any() { Duration::MAX } else { ui.repaint_after() };
        let has_area = size.width > 0 && size.height > 0;
        if !is_seen || !has_area {
            event_loop.set_control_flow(ControlFlow::Wait);
        } else if is_busy || wait.is_zero() {
            window.request_redraw();
            event_loop.set_control_flow(ControlFlow::Poll);
        } else {
            self.home.iter_mut().for_each(|home| home.session.pace.pause());
            event_loop.set_control_flow(match now.checked_add(wait) {
                Some(at) => ControlFlow::WaitUntil(at),
                None => ControlFlow::Wait,
            });
        }
    }
}
