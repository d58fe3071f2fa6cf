//! The list of keys and mouse actions, and the hint that names the key for the list.

use egui::{Align2, Area, Color32, Frame, Grid, Id, Order, RichText, ScrollArea, Ui, Window, vec2};

/// Keys and mouse actions, each with its effect. docs/guide.md has the same rows.
pub const KEYS: [(&str, &str); 18] = [
    ("left drag, right drag", "go around the target, look around"),
    ("middle drag, Shift + left drag", "move sideways, up and down"),
    ("wheel", "nearer, farther, to where the mouse points"),
    ("click", "the rays of a pixel: triangles, materials, steps"),
    ("W A S D, E Q", "fly, up and down; S goes back once another was pressed"),
    ("Shift, Ctrl", "fly faster, slower, as long as it is held"),
    ("+ -, Ctrl or Alt + wheel", "fly faster, slower from now on"),
    ("F, Home", "frame the scene, back to the start"),
    ("comma, full stop", "narrower, wider field of view; less, more height"),
    ("U", "another axis points up: +z, +x, -y, -z, -x, +y"),
    ("1, 2 3 4", "picture; depth, normals, triangles: primary rays only"),
    ("5, 6", "steps, rays: sums over all rays, slow as the picture"),
    ("M", "with path, what is drawn in motion: whitted, paths, or filtered paths"),
    ("space", "play the animations of the file, or pause them"),
    ("P", "print the camera as a scene file has it"),
    ("S, F12", "save what is seen, drawn in full"),
    ("H, F1, ?", "show or hide these keys"),
    ("Tab, Esc", "hide the panel, quit"),
];

/// Margin between the overlay and the window's edges, points.
const MARGIN: f32 = 8.0;
/// Width into which the longest line fits, points.
const WIDTH: f32 = 640.0;

/// Shows all keys in the middle of the picture. The list can be scrolled if it does not fit.
pub fn show(ui: &Ui, frame: Frame) {
    let room = (ui.ctx().content_rect().size() - vec2(6.0, 6.0) * MARGIN).max(vec2(80.0, 40.0));
    Window::new("Keys")
        .frame(frame.fill(Color32::from_black_alpha(245))) // nearly opaque, since it may cover the panel's text
        .anchor(Align2::CENTER_CENTER, [0.0, 0.0])
        .order(Order::Foreground)
        .title_bar(false)
        .resizable(false)
        .default_size(room.min(vec2(WIDTH, f32::INFINITY)))
        .show(ui.ctx(), |ui| {
            ScrollArea::both().max_width(room.x).max_height(room.y).show(ui, |ui| {
                Grid::new("keys").num_columns(2).spacing([16.0, 3.0]).show(ui, |ui| {
                    for (keys, does) in KEYS {
                        ui.label(RichText::new(keys).strong());
                        ui.label(does);
                        ui.end_row();
                    }
                });
            });
        });
}

/// Shows a line that names the key for the list. `below`: the height of what is below it, points.
pub fn hint(ui: &Ui, frame: Frame, below: f32) {
    let corner = Align2::RIGHT_BOTTOM;
    Area::new(Id::new("hint")).anchor(corner, [-MARGIN, -MARGIN - below]).interactable(false).show(ui.ctx(), |ui| {
        frame.show(ui, |ui| ui.label(RichText::new("H, F1 or ? shows the keys").strong()));
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_guide_has_the_same_keys() {
        let rows: String = KEYS.iter().map(|(keys, does)| format!("| {keys} | {does} |\n")).collect();
        assert!(include_str!("../../../docs/guide.md").contains(&rows), "docs/guide.md lacks these rows:\n{rows}");
    }
}
