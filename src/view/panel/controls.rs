//! The panel's controls for the settings of the picture.

use std::fmt::Display;

use egui::{ComboBox, DragValue, Grid, Slider, SliderClamping, Ui};

use super::Settings;
use crate::{
    accel::{AccelKind, kdtree::Traversal},
    frame::{Denoise, Integrator, Primary, Tonemap, View},
    scene::Projection,
    view::{InMotion, controller::FOV_DEGREES},
};

/// Shows the controls. Changes take effect with the next frame. `accel` is the structure in use: only a kd-tree has a
/// choice of traversals. The CPU engine has no views but the picture, and primary rays of one kind.
pub fn show(ui: &mut Ui, settings: &mut Settings, projection: &mut Projection, (accel, is_on_cpu): (AccelKind, bool)) {
    Grid::new("controls").num_columns(2).spacing([10.0, 3.0]).show(ui, |ui| {
        let Settings { options, in_motion, max_samples, budget_ms, vsync, view, gain } = settings;
        if !is_on_cpu {
            choice(ui, "view", view, View::ALL);
        }
        if matches!(view, View::Depth | View::Cost | View::Rays) {
            row(ui, "brightness", |ui| ui.add(Slider::new(gain, 0.01..=100.0).logarithmic(true)));
        }
        lens(ui, projection);
        choice(ui, "integrator", &mut options.integrator, Integrator::ALL);
        if options.integrator == Integrator::Path {
            choice(ui, "in motion", in_motion, InMotion::ALL);
        }
        row(ui, "max depth", |ui| ui.add(Slider::new(&mut options.max_depth, 1..=32)));
        row(ui, "samples", |ui| ui.add(Slider::new(max_samples, 1..=4096).logarithmic(true)));
        row(ui, "exposure", |ui| ui.add(Slider::new(&mut options.exposure, 0.01..=100.0).logarithmic(true)));
        choice(ui, "tone curve", &mut options.tonemap, Tonemap::ALL);
        denoise(ui, &mut options.denoise, options.integrator);
        if accel == AccelKind::KdTree {
            choice(ui, "traversal", &mut options.traversal, Traversal::ALL);
        }
        if options.integrator == Integrator::Whitted && !is_on_cpu {
            choice(ui, "primary rays", &mut options.primary, Primary::ALL);
        }
        row(ui, "budget, ms", |ui| ui.add(Slider::new(budget_ms, 1.0..=200.0).logarithmic(true)));
        row(ui, "vsync", |ui| ui.checkbox(vsync, ""));
    });
}

/// Shows the slider of a perspective camera's field of view, or of an orthographic camera's height.
fn lens(ui: &mut Ui, projection: &mut Projection) {
    match projection {
        Projection::Perspective { vertical_fov_degrees: degrees } => {
            row(ui, "field of view", |ui| {
                // A scene's own field of view may be beyond the slider's ends. It is kept until the slider is moved.
                let slider = Slider::new(degrees, FOV_DEGREES).clamping(SliderClamping::Edits);
                ui.add(slider.suffix("\u{b0}").max_decimals(1))
            });
        }
        Projection::Orthographic { height } => {
            row(ui, "height", |ui| ui.add(drag(height)));
        }
    }
}

/// Returns a field in which a length is dragged by a share of itself.
fn drag(length: &mut f32) -> DragValue<'_> {
    let speed = 0.01 * *length;
    DragValue::new(length).speed(speed).range(1e-6..=1e9).clamp_existing_to_range(false)
}

fn row<R>(ui: &mut Ui, name: &str, control: impl FnOnce(&mut Ui) -> R) {
    ui.label(name);
    control(ui);
    ui.end_row();
}

/// Shows a row in which one of several values is chosen.
fn choice<T: Copy + PartialEq + Display>(ui: &mut Ui, name: &str, chosen: &mut T, all: &[T]) {
    row(ui, name, |ui| {
        ComboBox::from_id_salt(name).selected_text(chosen.to_string()).show_ui(ui, |ui| {
            for one in all {
                ui.selectable_value(chosen, *one, one.to_string());
            }
        });
    });
}

/// Shows the choice of the noise filter. `edge` filters paths only.
fn denoise(ui: &mut Ui, denoise: &mut Denoise, integrator: Integrator) {
    let paper = match *denoise {
        Denoise::Paper { threshold } => Denoise::Paper { threshold },
        Denoise::Off | Denoise::Edge => Denoise::Paper { threshold: Denoise::DEFAULT_THRESHOLD },
    };
    let filters = [(Denoise::Off, "off"), (paper, "paper"), (Denoise::Edge, "edge")];
    let filters = &filters[..if integrator == Integrator::Path { 3 } else { 2 }];
    let name = filters.iter().find(|(filter, _)| filter == denoise).map_or("off", |(_, name)| name);
    row(ui, "noise filter", |ui| {
        ComboBox::from_id_salt("noise filter").selected_text(name).show_ui(ui, |ui| {
            for (filter, name) in filters {
                ui.selectable_value(denoise, *filter, *name);
            }
        });
    });
    if let Denoise::Paper { threshold } = denoise {
        row(ui, "threshold", |ui| ui.add(Slider::new(threshold, 0.0..=4.0)));
    }
}
