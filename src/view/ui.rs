//! Connects egui to the window's events and to the overlay that draws it.

use std::time::{Duration, Instant};

use egui::{Context, Order, Popup, Pos2, TexturesDelta, ViewportId, pos2};
use egui_winit::State;
use winit::{
    event::{ElementState, KeyEvent, WindowEvent},
    keyboard::{KeyCode, PhysicalKey},
    window::Window,
};

use super::overlay::OverlayFrame;
use super::{
    gpu_session::GpuSession,
    panel::{self, Edited, Facts, Overlays},
    session::Session,
};

/// State of egui.
pub struct Ui {
    state: State,
    /// Position of the mouse in points. egui itself learns it only at its next layout.
    cursor: Pos2,
    /// Delay after the last layout at which egui wants to be laid out again.
    repaint_after: Duration,
}

/// egui's output for one frame.
pub struct Layout {
    /// What the overlay draws.
    pub frame: OverlayFrame,
    /// Changes of textures, to be uploaded before the frame is drawn.
    pub textures: TexturesDelta,
}

impl Ui {
    pub fn new(window: &Window) -> Self {
        let context = Context::default();
        context.set_visuals(egui::Visuals::dark());
        let scale = Some(window.scale_factor() as f32);
        let state = State::new(context, ViewportId::ROOT, window, scale, window.theme(), None);
        Self { state, cursor: Pos2::ZERO, repaint_after: Duration::ZERO }
    }

    /// Passes an event to egui. Returns true if egui has taken the event, so that the camera must not react to it.
    pub fn take_event(&mut self, window: &Window, event: &WindowEvent) -> bool {
        let response = self.state.on_window_event(window, event);
        if response.repaint {
            self.repaint_after = Duration::ZERO;
        }
        let context = self.state.egui_ctx();
        if let WindowEvent::CursorMoved { position, .. } = event {
            let scale = context.pixels_per_point();
            self.cursor = pos2(position.x as f32 / scale, position.y as f32 / scale);
        }
        match event {
            // A drag that began on the picture also ends if the button goes up over the overlay.
            WindowEvent::MouseInput { state: ElementState::Released, .. } => false,
            WindowEvent::MouseInput { .. } | WindowEvent::MouseWheel { .. } => {
                context.egui_is_using_pointer()
                    || context.layer_id_at(self.cursor).is_some_and(|layer| layer.order != Order::Background)
            }
            WindowEvent::CursorMoved { .. } => context.egui_is_using_pointer(),
            // An open list of choices takes the keys: Escape closes it before anything else.
            WindowEvent::KeyboardInput { .. } => context.egui_wants_keyboard_input() || Popup::is_any_open(context),
            _ => false,
        }
    }

    /// Returns the delay after the last layout at which egui wants to be laid out again.
    pub fn repaint_after(&self) -> Duration {
        self.repaint_after
    }

    /// Returns whether a part of the overlay takes what is typed, or has opened something that Escape closes.
    pub fn has_keyboard(&self) -> bool {
        let context = self.state.egui_ctx();
        context.egui_wants_keyboard_input() || egui::Popup::is_any_open(context)
    }

    /// Lays out the overlay and applies the user's changes to `edited`.
    pub fn layout(&mut self, window: &Window, overlays: Overlays, edited: &mut Edited, facts: &Facts) -> Layout {
        self.run(window, |ui| panel::show(ui, overlays, edited, facts))
    }

    /// Lays out what the window says while it waits.
    pub fn layout_waiting(&mut self, window: &Window, text: &str) -> Layout {
        self.run(window, |ui| panel::show_waiting(ui, text))
    }

    fn run(&mut self, window: &Window, show: impl FnMut(&mut egui::Ui)) -> Layout {
        let input = self.state.take_egui_input(window);
        let context = self.state.egui_ctx().clone();
        let output = context.run_ui(input, show);
        self.state.handle_platform_output(window, output.platform_output);
        let root = output.viewport_output.get(&ViewportId::ROOT);
        self.repaint_after = root.map_or(Duration::MAX, |viewport| viewport.repaint_delay);
        let pixels_per_point = output.pixels_per_point;
        let primitives = context.tessellate(output.shapes, pixels_per_point);
        Layout { frame: OverlayFrame { primitives, pixels_per_point }, textures: output.textures_delta }
    }
}

/// Lays out the overlay of the session's picture and applies the user's changes to the session's settings and camera.
pub fn lay_out(
    session: &mut Session,
    gpu: &GpuSession,
    (ui, window, overlays): (&mut Ui, &Window, Overlays),
    is_flying: bool,
) -> Layout {
    let size = window.inner_size();
    let projection = session.controller.camera().projection;
    let playback = session.loaded.timeline.as_ref().map(|timeline| *timeline.playback());
    let mut edited = Edited { settings: session.settings.clone(), projection, playback };
    let facts = session.facts(gpu, (size.width, size.height), is_flying);
    let layout = ui.layout(window, overlays, &mut edited, &facts);
    let now = Instant::now();
    if edited.settings != session.settings {
        session.pace.note_input(now);
        session.settings = edited.settings;
    }
    if edited.projection != projection {
        session.pace.note_input(now);
        session.pace.moved(now);
        session.controller.set_projection(edited.projection);
    }
    if let (Some(timeline), Some(set)) =
        (&mut session.loaded.timeline, edited.playback.filter(|_| edited.playback != playback))
    {
        session.pace.note_input(now);
        timeline.set(set);
    }
    layout
}

/// Returns whether the event is a press of Tab, which shows and hides the panel even if egui has the keyboard focus.
pub fn is_tab(event: &WindowEvent) -> bool {
    let tab = PhysicalKey::Code(KeyCode::Tab);
    matches!(event, WindowEvent::KeyboardInput {
        event: KeyEvent { physical_key, state: ElementState::Pressed, .. }, ..
    } if *physical_key == tab)
}

/// Returns whether a key or a mouse button goes down.
pub fn is_press(event: &WindowEvent) -> bool {
    match event {
        WindowEvent::KeyboardInput { event, is_synthetic: false, .. } => event.state.is_pressed(),
        WindowEvent::MouseInput { state, .. } => state.is_pressed(),
        _ => false,
    }
}
