//! A stacked graph of each pass's GPU time over the last seconds, with a legend of figures.

use egui::{Color32, Pos2, Rect, Sense, Stroke, StrokeKind, Ui, vec2};

use crate::{
    frame::{Pass, Profile},
    view::history::{FrameRecord, History},
};

/// Height of the graph, points.
const HEIGHT: f32 = 80.0;

/// Shows the graph and its legend.
pub fn show(ui: &mut Ui, history: &History, newest: &Profile) {
    let passes = passes(newest);
    if passes.is_empty() {
        ui.label("no times yet, or a device without timestamps");
        return;
    }
    let (response, painter) = ui.allocate_painter(vec2(ui.available_width(), HEIGHT), Sense::hover());
    let area = response.rect;
    let top_ms = top_ms(history);
    painter.rect(area, 0.0, Color32::from_black_alpha(120), Stroke::new(1.0, Color32::DARK_GRAY), StrokeKind::Inside);
    let now = history.frames().next_back().map_or(0.0, |frame| frame.shown_s);
    let x_at = |s: f64| area.right() - ((now - s) / history.length_s()) as f32 * area.width();
    let mut left = area.left();
    for frame in history.frames() {
        let right = x_at(frame.shown_s).max(left);
        // A bar is as wide as its frame took. Time in which nothing was drawn stays a gap.
        let busy_ms = frame.busy_ms();
        let begin = x_at(frame.shown_s - busy_ms.max(frame.frame_ms) * 1e-3).max(left);
        let mut bottom = area.bottom();
        for (name, color) in &passes {
            let height = (pass_ms(frame, name) / top_ms) as f32 * area.height();
            let top = (bottom - height).max(area.top());
            painter.rect_filled(Rect::from_min_max(Pos2::new(begin, top), Pos2::new(right, bottom)), 0.0, *color);
            bottom = top;
        }
        if busy_ms > 0.0 {
            left = right;
        }
    }
    let digits = usize::from(top_ms < 1.0) * 2;
    painter.text(
        area.left_top() + vec2(3.0, 1.0),
        egui::Align2::LEFT_TOP,
        format!("{top_ms:.digits$} ms of GPU time, {:.0} s", history.length_s()),
        egui::FontId::proportional(10.0),
        Color32::LIGHT_GRAY,
    );
    legend(ui, newest, &passes);
}

fn pass_ms(frame: &FrameRecord, name: &str) -> f64 {
    frame.pass_ms.iter().filter(|(pass, _)| *pass == name).map(|(_, ms)| ms).sum()
}

/// Returns the name and colour of each timed pass of a sample, in the order of execution.
fn passes(profile: &Profile) -> Vec<(&'static str, Color32)> {
    let mut names: Vec<&'static str> = Vec::new();
    for pass in profile.passes.iter().filter(|pass| pass.ms.is_some()) {
        if !names.contains(&pass.name) {
            names.push(pass.name);
        }
    }
    names.into_iter().map(|name| (name, color(name))).collect()
}

fn color(name: &str) -> Color32 {
    let [r, g, b] = Pass::named(name).color();
    Color32::from_rgb(r, g, b)
}

/// Returns the milliseconds at the graph's top: the 95th percentile of the samples' GPU time, rounded up to 1, 2 or 5
/// times a power of ten. One slow frame thus does not flatten the others.
fn top_ms(history: &History) -> f64 {
    let mut sums: Vec<f64> = history.frames().map(FrameRecord::busy_ms).collect();
    sums.retain(|sum| *sum > 0.0);
    sums.sort_by(f64::total_cmp);
    let most = sums.get(sums.len() * 95 / 100).copied().unwrap_or(0.0).max(0.01);
    let magnitude = 10f64.powf(most.log10().floor());
    [1.0, 2.0, 5.0, 10.0].into_iter().map(|step| step * magnitude).find(|top| *top >= most).unwrap_or(most)
}

/// Shows the passes' names with their times in the newest sample, milliseconds.
fn legend(ui: &mut Ui, newest: &Profile, passes: &[(&'static str, Color32)]) {
    egui::Grid::new("passes").num_columns(4).spacing([8.0, 1.0]).show(ui, |ui| {
        for pair in passes.chunks(2) {
            for (name, color) in pair {
                ui.colored_label(*color, *name);
                ui.monospace(format!("{:.2}", newest.pass_ms(name).unwrap_or(0.0)));
            }
            ui.end_row();
        }
    });
}
