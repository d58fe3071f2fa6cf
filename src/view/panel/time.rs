//! The time line of animated scenes: play and pause, the moment, speed, and which animation is shown.

use egui::{Align2, Area, Button, ComboBox, Frame, Id, Slider, SliderClamping, Ui};

use crate::view::timeline::{Playback, SPEEDS, Timeline};

/// Height of the window's lower edge that the time line takes, points.
pub const HEIGHT: f32 = 76.0;
/// Margin between the time line and the window's edges, points.
const MARGIN: f32 = 8.0;
/// Greatest width of its contents, points.
const WIDTH: f32 = 560.0;
/// Width of the play button, points.
const BUTTON: f32 = 52.0;
/// Width that the number beside a slider takes, points.
const NUMBER: f32 = 72.0;

/// Shows the time line at the window's lower edge, and applies the user's changes to `playback`.
pub fn show(ui: &Ui, frame: Frame, playback: &mut Playback, timeline: &Timeline) {
    let width = (ui.ctx().content_rect().width() - 6.0 * MARGIN).clamp(120.0, WIDTH);
    let edge = Area::new(Id::new("time line")).anchor(Align2::CENTER_BOTTOM, [0.0, -MARGIN]);
    edge.show(ui.ctx(), |ui| {
        frame.show(ui, |ui| {
            ui.set_width(width);
            ui.horizontal(|ui| moment(ui, playback, timeline));
            ui.horizontal(|ui| ways(ui, playback, timeline));
        });
    });
}

/// Shows the button that plays and pauses, and the slider of the moment.
fn moment(ui: &mut Ui, playback: &mut Playback, timeline: &Timeline) {
    let label = if playback.is_playing { "Pause" } else { "Play" };
    if ui.add_sized([BUTTON, 18.0], Button::new(label)).on_hover_text("space").clicked() {
        playback.is_playing = !playback.is_playing;
    }
    let (begin, end) = timeline.range();
    ui.spacing_mut().slider_width = (ui.available_width() - NUMBER).max(20.0);
    // The moment of --at may be beyond the ends. It is kept until the slider is moved.
    let slider = Slider::new(&mut playback.seconds, begin..=end).clamping(SliderClamping::Edits);
    let slider = ui.add(slider.suffix(" s").fixed_decimals(3));
    playback.is_at_rest &= !(slider.changed() || slider.is_pointer_button_down_on());
}

/// Shows how the animations play, and which of them.
fn ways(ui: &mut Ui, playback: &mut Playback, timeline: &Timeline) {
    ui.checkbox(&mut playback.loops, "loop");
    ui.spacing_mut().slider_width = 80.0;
    ui.add(Slider::new(&mut playback.speed, SPEEDS).logarithmic(true).fixed_decimals(2).prefix("x "));
    let name = |ix: Option<usize>| ix.map_or("all animations", |ix| &timeline.animations()[ix].name);
    ComboBox::from_id_salt("animation").truncate().selected_text(name(playback.animation_ix)).show_ui(ui, |ui| {
        for ix in [None].into_iter().chain((0..timeline.animations().len()).map(Some)) {
            ui.selectable_value(&mut playback.animation_ix, ix, name(ix));
        }
    });
    if playback.is_at_rest {
        ui.label("at rest");
    }
}
