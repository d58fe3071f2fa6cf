//! What lies over the picture: where the time goes, and how the picture is made.

mod controls;
mod graph;
mod tables;

use egui::{Color32, CornerRadius, Frame, Margin, RichText, ScrollArea, Ui, Window};

use super::{
    history::{History, Percentiles},
    loaded::Loaded,
    pick::Picked,
};
use crate::{
    frame::{Profile, RenderOptions, View},
    gpu::MemoryUse,
};

/// Points.
const WIDTH: f32 = 300.0;

/// What the user sets.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Its size is not the user's: it is the window's.
    pub options: RenderOptions,
    /// Samples a pixel at which a picture at rest is done.
    pub max_samples: u32,
    /// Milliseconds a frame while the camera moves.
    pub budget_ms: f64,
    pub vsync: bool,
    pub view: View,
    /// Factor on the brightness of views of numbers.
    pub gain: f32,
}

/// What the user reads.
pub struct Facts<'a> {
    pub device: &'a str,
    pub loaded: &'a Loaded,
    /// Pixels.
    pub window: (u32, u32),
    /// Pixels.
    pub picture: (u32, u32),
    /// A pixel.
    pub n_samples: u32,
    /// Share of the next sample that is drawn, 0 to 1.
    pub progress: f32,
    /// World units a second.
    pub speed: f32,
    /// Whether S flies back, rather than saves.
    pub is_flying: bool,
    /// Of the last frame that was drawn.
    pub profile: &'a Profile,
    pub history: &'a History,
    pub memory: Vec<MemoryUse>,
    pub picked: Option<&'a Picked>,
    /// What went wrong last.
    pub message: Option<&'a str>,
}

/// Lays the panel out; changes `settings` as the user does.
pub fn show(ui: &mut Ui, settings: &mut Settings, facts: &Facts) {
    let style = ui.ctx().global_style();
    let frame = Frame::window(&style)
        .fill(Color32::from_black_alpha(200))
        .corner_radius(CornerRadius::same(4))
        .inner_margin(Margin::same(8));
    Window::new("kdray").frame(frame).default_pos([8.0, 8.0]).default_width(WIDTH).resizable([false, false]).show(
        ui.ctx(),
        |ui| {
            ui.set_width(WIDTH);
            let room = ui.ctx().content_rect().height() - 60.0;
            ScrollArea::vertical()
                .max_height(room.max(80.0))
                .min_scrolled_height(room.max(80.0))
                .show(ui, |ui| sections(ui, settings, facts));
        },
    );
}

fn sections(ui: &mut Ui, settings: &mut Settings, facts: &Facts) {
    if let Some(message) = facts.message {
        ui.label(RichText::new(message).color(Color32::LIGHT_RED));
        ui.separator();
    }
    status(ui, settings, facts);
    if let Some(picked) = facts.picked {
        section(ui, "Pixel", true, |ui| tables::picked(ui, picked));
    }
    section(ui, "Passes", true, |ui| graph::show(ui, facts.history, facts.profile));
    section(ui, "Picture", true, |ui| controls::show(ui, settings));
    section(ui, "Rays", true, |ui| tables::rays(ui, facts.profile));
    section(ui, "Tree", false, |ui| tables::tree(ui, facts.loaded));
    section(ui, "Memory", false, |ui| tables::memory(ui, &facts.memory));
    section(ui, "Keys", false, keys);
}

fn section(ui: &mut Ui, name: &str, is_open: bool, body: impl FnOnce(&mut Ui)) {
    egui::CollapsingHeader::new(name).default_open(is_open).show(ui, body);
}

fn status(ui: &mut Ui, settings: &Settings, facts: &Facts) {
    let Facts { loaded, picture, window, n_samples, .. } = facts;
    ui.label(format!("{}: {} triangles", loaded.scene.name, loaded.scene.triangles.len()));
    ui.label(facts.device);
    ui.label(format!("{}x{} in {}x{}", picture.0, picture.1, window.0, window.1));
    let way = if facts.is_flying { "fly" } else { "orbit" };
    let next = if facts.progress > 0.0 { format!(" + {:.0} %", 100.0 * facts.progress) } else { String::new() };
    ui.label(format!("{n_samples}{next} of {} samples; {way}, speed {:.3}/s", settings.max_samples, facts.speed));
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

fn keys(ui: &mut Ui) {
    const KEYS: [(&str, &str); 13] = [
        ("W S A D", "fly; S goes back only after another"),
        ("E Q", "fly up, down"),
        ("Shift, Ctrl", "faster, slower"),
        ("wheel", "speed"),
        ("left drag", "go around the target"),
        ("right drag", "look around"),
        ("click", "what the pixel shows"),
        ("F", "frame the scene"),
        ("Home", "back to the start"),
        ("1 to 6", "picture, depth, normal, id, cost, rays"),
        ("P", "print the camera"),
        ("S, F12", "save the picture"),
        ("Tab, Esc", "hide this, quit"),
    ];
    tables::grid(ui, "keys", KEYS.iter().map(|(key, does)| [(*key).to_owned(), (*does).to_owned()]));
}
