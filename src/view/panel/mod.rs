//! The overlay over the picture: times of the passes, figures, controls and the list of keys.

mod controls;
mod graph;
mod keys;
mod legend;
mod tables;
mod time;

use std::time::Instant;

use egui::{Align2, Area, Color32, CornerRadius, Frame, Id, Margin, RichText, ScrollArea, Ui, Window};

use super::{
    history::{History, Percentiles},
    in_motion::InMotion,
    loaded_scene::LoadedScene,
    message::Message,
    pick::Picked,
    timeline::{Playback, Timeline},
};
use crate::{
    frame::{Profile, RenderOptions, View},
    gpu::MemoryUse,
    layout::PixelAovs,
    scene::Projection,
};

/// Width of the panel, points.
const WIDTH: f32 = 300.0;

/// Settings that the user can change.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Render options. The size in them follows the window; the user cannot set it.
    pub options: RenderOptions,
    /// What is drawn while the camera moves.
    pub in_motion: InMotion,
    /// Samples per pixel at which a picture at rest is done.
    pub max_samples: u32,
    /// Time budget per frame while the camera moves, milliseconds.
    pub budget_ms: f64,
    /// Whether frames wait for the screen's refresh.
    pub vsync: bool,
    /// What the window shows of the picture.
    pub view: View,
    /// Factor on the brightness of the views depth, cost and rays.
    pub gain: f32,
}

/// What the panel's controls change.
#[derive(Clone, Debug, PartialEq)]
pub struct Edited {
    /// The settings.
    pub settings: Settings,
    /// The camera's projection.
    pub projection: Projection,
    /// What is set of the time line, if there is one.
    pub playback: Option<Playback>,
}

/// The overlays that are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Overlays {
    /// The panel of figures and controls.
    pub panel: bool,
    /// The list of keys.
    pub keys: bool,
    /// The hint that names the key for the list.
    pub hint: bool,
    /// Messages while the panel is hidden. Each is shown for a few seconds.
    pub messages: bool,
    /// The window's contents while no file is open: what to do, and the last message.
    pub start: bool,
}

impl Overlays {
    /// Returns whether any overlay is shown.
    pub fn any(self) -> bool {
        self.panel || self.keys || self.hint || self.messages || self.start
    }
}

/// The facts that the overlay shows.
pub struct Facts<'a> {
    /// The device's name.
    pub device: &'a str,
    /// Whether the CPU engine draws. It has no views but the picture, and takes no device memory.
    pub is_on_cpu: bool,
    /// The scene and its acceleration structure.
    pub loaded: &'a LoadedScene,
    /// Width and height of the window, pixels.
    pub window: (u32, u32),
    /// Width and height of the picture, pixels.
    pub picture: (u32, u32),
    /// Samples per pixel so far.
    pub n_samples: u32,
    /// Number of samples per pixel with which the view is complete.
    pub n_wanted: u32,
    /// Share of the next sample that has been drawn so far, 0 to 1.
    pub progress: f32,
    /// Speed of flight, world units per second.
    pub speed: f32,
    /// Whether the key S flies back rather than saves the picture.
    pub is_flying: bool,
    /// Whether the user has asked to save the picture. It is saved once a picture of the window's size is displayed.
    pub is_save_due: bool,
    /// Profile of the last sample that was completed.
    pub profile: &'a Profile,
    /// Frames of the last seconds.
    pub history: &'a History,
    /// Device memory by use.
    pub memory: Vec<MemoryUse>,
    /// The current view, and the value that it shows brightest; for depths, the one that it shows half as bright.
    pub view: (View, f32),
    /// The AOVs of the pixel under the pointer; none if they are unknown.
    pub pointed: Option<PixelAovs>,
    /// The rays of the pixel that was clicked last.
    pub picked: Option<&'a Picked>,
    /// The last message, unless a later success on the same topic has cleared it.
    pub message: Option<&'a Message>,
    /// The animations, if the scene has any.
    pub timeline: Option<&'a Timeline>,
}

impl Facts<'_> {
    /// Returns the height at the window's lower edge that the time line takes, points.
    fn below(&self) -> f32 {
        self.timeline.map_or(0.0, |_| time::HEIGHT)
    }
}

/// Lays out a line in the window's middle, which says what the window waits for.
pub fn show_waiting(ui: &mut Ui, text: &str) {
    let middle = Area::new(Id::new("waiting")).anchor(Align2::CENTER_CENTER, [0.0, 0.0]).interactable(false);
    middle.show(ui.ctx(), |ui| frame(ui).show(ui, |ui| ui.label(RichText::new(text).strong())));
}

/// Returns the frame of the parts of the overlay.
fn frame(ui: &Ui) -> Frame {
    Frame::window(&ui.ctx().global_style())
        .fill(Color32::from_black_alpha(200))
        .corner_radius(CornerRadius::same(4))
        .inner_margin(Margin::same(8))
}

/// Lays out the overlay and applies the user's changes to `edited`.
pub fn show(ui: &mut Ui, overlays: Overlays, edited: &mut Edited, facts: &Facts) {
    let frame = frame(ui);
    if overlays.panel {
        legend::show(ui, frame, facts);
        panel(ui, frame, edited, facts);
        if let (Some(playback), Some(timeline)) = (&mut edited.playback, facts.timeline) {
            time::show(ui, frame, playback, timeline);
        }
    } else if overlays.messages {
        message_alone(ui, frame, facts);
    }
    if overlays.start {
        start(ui, facts);
    }
    if overlays.keys {
        keys::show(ui, frame);
    } else if overlays.hint {
        keys::hint(ui, frame, if overlays.panel { facts.below() } else { 0.0 });
    }
}

fn panel(ui: &mut Ui, frame: Frame, edited: &mut Edited, facts: &Facts) {
    Window::new("kdray").frame(frame).default_pos([8.0, 8.0]).default_width(WIDTH).resizable([false, false]).show(
        ui.ctx(),
        |ui| {
            ui.set_width(WIDTH);
            let room = ui.ctx().content_rect().height() - 60.0 - facts.below();
            ScrollArea::vertical()
                .max_height(room.max(80.0))
                .min_scrolled_height(room.max(80.0))
                .show(ui, |ui| sections(ui, edited, facts));
        },
    );
}

fn sections(ui: &mut Ui, edited: &mut Edited, facts: &Facts) {
    if let Some(message) = facts.message.filter(|message| message.is_error || is_fresh(ui, message)) {
        message_label(ui, message);
        ui.separator();
    }
    status(ui, facts);
    if let Some(picked) = facts.picked {
        section(ui, "Pixel", true, |ui| tables::picked(ui, picked));
    }
    section(ui, "Passes", true, |ui| graph::show(ui, facts.history, facts.profile));
    section(ui, "Picture", true, |ui| {
        let accel = facts.loaded.built.world.accel().kind();
        controls::show(ui, &mut edited.settings, &mut edited.projection, (accel, facts.is_on_cpu));
    });
    section(ui, "Rays", true, |ui| tables::rays(ui, facts.profile));
    section(ui, "Acceleration structure", false, |ui| tables::accel(ui, facts.loaded));
    if !facts.is_on_cpu {
        section(ui, "Memory", false, |ui| tables::memory(ui, &facts.memory));
    }
}

/// Shows what to do while no file is open, and the last message below it.
fn start(ui: &Ui, facts: &Facts) {
    let middle = Area::new(Id::new("start")).anchor(Align2::CENTER_CENTER, [0.0, 0.0]).interactable(false);
    middle.show(ui.ctx(), |ui| {
        ui.set_max_width(0.9 * ui.ctx().content_rect().width());
        ui.vertical_centered(|ui| {
            ui.label(RichText::new("Drop a glTF, OBJ, PLY, STL or scene file here").size(18.0).strong());
            if let Some(message) = facts.message {
                message_label(ui, message);
            }
        });
    });
}

/// Shows a recent message in the picture's lower left corner.
fn message_alone(ui: &Ui, frame: Frame, facts: &Facts) {
    let Some(message) = facts.message.filter(|message| is_fresh(ui, message)) else { return };
    let corner = Area::new(Id::new("message")).anchor(Align2::LEFT_BOTTOM, [8.0, -8.0]).interactable(false);
    corner.show(ui.ctx(), |ui| frame.show(ui, |ui| message_label(ui, message)));
}

/// Returns whether a message is recent. If it is, the overlay is laid out again once it is not any more.
fn is_fresh(ui: &Ui, message: &Message) -> bool {
    let left = message.time_left(Instant::now());
    left.inspect(|left| ui.ctx().request_repaint_after(*left)).is_some()
}

fn message_label(ui: &mut Ui, message: &Message) {
    let color = if message.is_error { Color32::LIGHT_RED } else { Color32::LIGHT_GREEN };
    ui.label(RichText::new(&message.text).color(color));
}

fn section(ui: &mut Ui, name: &str, is_open: bool, body: impl FnOnce(&mut Ui)) {
    egui::CollapsingHeader::new(name).default_open(is_open).show(ui, body);
}

fn status(ui: &mut Ui, facts: &Facts) {
    let Facts { loaded, picture, window, n_samples, n_wanted, .. } = facts;
    ui.label(format!("{}: {} triangles", loaded.scene().name, loaded.scene().n_triangles()));
    ui.label(facts.device);
    ui.label(format!("{}x{} in {}x{}", picture.0, picture.1, window.0, window.1));
    let way = if facts.is_flying { "fly" } else { "orbit" };
    let next = if facts.progress > 0.0 { format!(" + {:.0} %", 100.0 * facts.progress) } else { String::new() };
    ui.label(format!("{n_samples}{next} of {n_wanted} samples; {way}, speed {:.3}/s", facts.speed));
    if facts.is_save_due {
        ui.label("to be saved once it is drawn in full");
    }
    ui.label("H: keys, Tab: hides this");
    ui.monospace("              p50     p95     p99");
    ui.monospace(percentiles("frame, ms ", facts.history.pace()));
    ui.monospace(percentiles("answer, ms", facts.history.latency()))
        .on_hover_text("from an input's arrival until the first frame that shows it is handed to the screen");
}

fn percentiles(name: &str, of: Option<Percentiles>) -> String {
    match of {
        Some(Percentiles { p50, p95, p99, .. }) => format!("{name} {p50:7.1} {p95:7.1} {p99:7.1}"),
        None => format!("{name}       -       -       -"),
    }
}
