//! The legend of a false-colour view: a bar of its colours with values and unit, and the value under the pointer.

use egui::{Align2, Area, Color32, FontId, Frame, Id, Pos2, Rect, RichText, Sense, Ui, vec2};
use glam::Vec3;

use super::Facts;
use crate::{
    frame::View,
    layout::{NO_TRIANGLE, PixelAovs},
    reference::false_color::heat_color,
};

/// Size of a bar, points.
const BAR: (f32, f32) = (260.0, 12.0);
/// Height of the values below a bar, points.
const TICKS: f32 = 14.0;
/// Number of colours in a bar.
const N_COLORS: u32 = 55;

/// A bar of colours.
struct Bar {
    /// Returns the colour at a place, 0 for the left end to 1 for the right one.
    color: fn(f32) -> Vec3,
    /// The values at the left end, in the middle and at the right end.
    ticks: [String; 3],
}

/// Returns what a view shows, with its unit.
fn title(view: View) -> &'static str {
    match view {
        View::Picture => "picture",
        View::Depth => "depth along the view, world units",
        View::Normal => "normal, world space: red x, green y, blue z",
        View::Id => "triangle: a colour for each index",
        View::Cost => "steps through the acceleration structure",
        View::Rays => "rays of the pixel",
    }
}

/// Returns the bars of a view. `brightest`: the value that it shows brightest; for depths, the one that it shows half
/// as bright as the nearest.
fn bars(view: View, brightest: f32) -> Vec<Bar> {
    let heat = || {
        let ticks = ["0".to_owned(), number(brightest / 2.0), format!("{} or more", number(brightest))];
        vec![Bar { color: heat_color, ticks }]
    };
    let axis = |color| Bar { color, ticks: ["-1", "0", "1"].map(str::to_owned) };
    match view {
        View::Picture | View::Id => Vec::new(),
        View::Depth => {
            let ticks = ["0".to_owned(), number(brightest), "infinite".to_owned()];
            vec![Bar { color: |x| Vec3::splat(1.0 - x), ticks }]
        }
        View::Normal => vec![axis(|x| Vec3::X * x), axis(|x| Vec3::Y * x), axis(|x| Vec3::Z * x)],
        View::Cost | View::Rays => heat(),
    }
}

/// Writes a value with three significant digits, or a whole number with all its digits.
fn number(x: f32) -> String {
    if x >= 100.0 || x == x.round() {
        return format!("{x:.0}");
    }
    if x < 1e-3 {
        return format!("{x:.2e}");
    }
    let n_decimals = (2.0 - x.log10().floor()) as usize;
    format!("{x:.n_decimals$}")
}

/// Returns the value of a pixel in a view.
fn value(view: View, aovs: &PixelAovs) -> String {
    let is_hit = aovs.triangle_ix != NO_TRIANGLE;
    match view {
        View::Cost => format!("{} steps", aovs.n_steps),
        View::Rays => format!("{} rays", aovs.n_rays),
        _ if !is_hit => "no hit".to_owned(),
        View::Depth => format!("{:.6}", aovs.depth),
        View::Normal => {
            // Adding 0 turns -0 into 0, whose sign would only confuse.
            let [x, y, z] = aovs.normal_world.to_array().map(|x| (x * 1e3).round() / 1e3 + 0.0);
            format!("{x:.3}, {y:.3}, {z:.3}")
        }
        View::Id => format!("triangle {}", aovs.triangle_ix),
        View::Picture => String::new(),
    }
}

/// Shows the legend of the current view in the upper right corner. The picture has none.
pub fn show(ui: &Ui, frame: Frame, facts: &Facts) {
    let (view, brightest) = facts.view;
    if view == View::Picture {
        return;
    }
    let corner = Area::new(Id::new("legend")).anchor(Align2::RIGHT_TOP, [-8.0, 8.0]).interactable(false);
    corner.show(ui.ctx(), |ui| {
        frame.show(ui, |ui| {
            ui.set_width(BAR.0);
            ui.label(RichText::new(title(view)).strong());
            for bar in bars(view, brightest) {
                draw(ui, &bar);
            }
            let text = facts.pointed.as_ref().map_or_else(|| "-".to_owned(), |aovs| value(view, aovs));
            ui.label(format!("under the pointer: {text}"));
        });
    });
}

fn draw(ui: &mut Ui, bar: &Bar) {
    let (response, painter) = ui.allocate_painter(vec2(BAR.0, BAR.1 + TICKS), Sense::hover());
    let area = response.rect;
    let x_at = |share: f32| area.left() + share * area.width();
    for ix in 0..N_COLORS {
        let share = |ix: u32| ix as f32 / N_COLORS as f32;
        let [r, g, b] = ((bar.color)(ix as f32 / (N_COLORS - 1) as f32) * 255.0 + 0.5).to_array().map(|x| x as u8);
        let (left, right) = (x_at(share(ix)), x_at(share(ix + 1)));
        let strip = Rect::from_min_max(Pos2::new(left, area.top()), Pos2::new(right, area.top() + BAR.1));
        painter.rect_filled(strip, 0.0, Color32::from_rgb(r, g, b));
    }
    let aligned = [(0.0, Align2::LEFT_BOTTOM), (0.5, Align2::CENTER_BOTTOM), (1.0, Align2::RIGHT_BOTTOM)];
    for ((share, align), tick) in aligned.into_iter().zip(&bar.ticks) {
        let at = Pos2::new(x_at(share), area.bottom());
        painter.text(at, align, tick, FontId::proportional(11.0), Color32::LIGHT_GRAY);
    }
}

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::*;
    use crate::{layout::FalseColor, reference::false_color::false_color};

    #[test]
    fn numbers_are_short() {
        let cases = [(0.0, "0"), (0.000_123_4, "1.23e-4"), (0.012_34, "0.0123"), (1.234, "1.23"), (45.67, "45.7")];
        for (x, expected) in cases.into_iter().chain([(5.0, "5"), (123.4, "123"), (1e6, "1000000")]) {
            assert_eq!(number(x), expected);
        }
    }

    #[test]
    fn values_are_those_of_the_view() {
        let normal_world = vec3(0.6, -0.8, -1e-5);
        let hit =
            PixelAovs { triangle_ix: 7, depth: 2.5, normal_world, n_steps: 40, n_rays: 3, ..PixelAovs::default() };
        let views = [View::Depth, View::Normal, View::Id, View::Cost, View::Rays];
        let expected = ["2.500000", "0.600, -0.800, 0.000", "triangle 7", "40 steps", "3 rays"];
        assert_eq!(views.map(|view| value(view, &hit)), expected);
        let miss = PixelAovs { triangle_ix: NO_TRIANGLE, ..hit };
        assert_eq!(views.map(|view| value(view, &miss)), ["no hit", "no hit", "no hit", "40 steps", "3 rays"]);
    }

    /// Compares the colours at the ends and in the middle of each bar with those of a pixel that has the value there.
    #[test]
    fn bars_have_the_colours_of_the_pixels() {
        let brightest = 8.0;
        let at = |view, aovs: PixelAovs| {
            let push = FalseColor { view, brightest };
            let mut display = [[0; 4]];
            false_color(&push, &[aovs], &mut display);
            Vec3::from_array([0, 1, 2].map(|channel| f32::from(display[0][channel]) / 255.0))
        };
        let views = [View::Depth, View::Cost, View::Rays];
        let values = [[0.0, 8.0, f32::INFINITY], [0.0, 4.0, 8.0], [0.0, 4.0, 8.0]];
        for (view, values) in views.into_iter().zip(values) {
            let bar = &bars(view, brightest)[0];
            for (share, x) in [0.0, 0.5, 1.0].into_iter().zip(values) {
                let aovs = PixelAovs { depth: x, n_steps: x as u32, n_rays: x as u32, ..PixelAovs::default() };
                let of_pixel = at(view.constant().unwrap(), aovs);
                assert!((of_pixel - (bar.color)(share)).abs().max_element() < 0.005, "{view} at {share}");
            }
        }
        for (axis, bar) in [Vec3::X, Vec3::Y, Vec3::Z].into_iter().zip(bars(View::Normal, 1.0)) {
            for (share, x) in [(0.0, -1.0), (0.5, 0.0), (1.0, 1.0)] {
                let aovs = PixelAovs { normal_world: axis * x, ..PixelAovs::default() };
                let of_pixel = at(View::Normal.constant().unwrap(), aovs).dot(axis);
                assert!((of_pixel - (bar.color)(share).dot(axis)).abs() < 0.005, "{axis} at {share}");
            }
        }
    }
}
