//! Tests that the viewer goes on with shaders that change while its window is open.

use std::{
    fs,
    path::Path,
    process::{Command, Stdio},
};

use tempfile::TempDir;

use super::{
    SIZE,
    support::{
        command::{Messages, cornell, kdray, succeed},
        display::{Display, Screen},
    },
};

/// Copies this checkout's shaders.
fn copy_shaders(to: &Path) {
    let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("glsl");
    assert!(Command::new("cp").arg("-r").arg(from).arg(to).status().unwrap().success());
}

/// Replaces a text that occurs once in a file.
fn edit(file: &Path, from: &str, to: &str) {
    let text = fs::read_to_string(file).unwrap();
    assert_eq!(text.matches(from).count(), 1, "{from}");
    fs::write(file, text.replace(from, to)).unwrap();
}

/// Returns a picture with red and blue exchanged.
fn swapped(picture: &Screen) -> Screen {
    let pixels = picture.pixels.iter().map(|&[r, g, b]| [b, g, r]).collect();
    Screen { pixels, ..picture.clone() }
}

/// Returns the inverse of a picture: bright becomes dark.
fn inverted(picture: &Screen) -> Screen {
    let pixels = picture.pixels.iter().map(|pixel| pixel.map(|channel| 255 - channel)).collect();
    Screen { pixels, ..picture.clone() }
}

#[test]
fn changed_shaders_draw_and_broken_ones_do_not() {
    let (directory, display) = (TempDir::new().unwrap(), Display::start(320, 240));
    copy_shaders(directory.path());
    let (tonemap, present) = ("glsl/passes/tonemap.comp", "glsl/passes/present.frag");
    let layout = "glsl/shared/layout.glsl";
    let path = |file: &str| directory.path().join(file);
    succeed(directory.path(), &["render", &cornell(), "--size", SIZE, "-q", "-o", "x.png"]);
    let picture = Screen::load(&path("x.png"));
    let arguments = ["view", &cornell(), "--size", SIZE, "--spp", "1", "--no-overlay", "--validate", "--shaders", "."];
    let mut viewer = kdray(directory.path(), &arguments)
        .env("DISPLAY", &display.name)
        .env_remove("WAYLAND_DISPLAY")
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let messages = Messages::of(&mut viewer);
    display.wait_until("the picture", |screen| picture.is_shown_on(screen));

    // The tone-mapping kernel swaps red and blue. Then the shader that draws the window swaps them back.
    edit(&path(tonemap), "bytes.r | bytes.g << 8 | bytes.b << 16", "bytes.b | bytes.g << 8 | bytes.r << 16");
    display.wait_until("the changed kernel's picture", |screen| swapped(&picture).is_shown_on(screen));
    edit(&path(present), "weight.y);", "weight.y).bgra;");
    display.wait_until("the changed shader's picture", |screen| picture.is_shown_on(screen));

    edit(&path(tonemap), "uvec3 bytes = ", "uvec3 bytes = no_such_word + ");
    let warning = messages.wait_for("warning: glsl/passes/tonemap.comp:");
    assert!(warning.contains("no_such_word"), "{warning}");
    assert!(picture.is_shown_on(&display.screen()), "the previous shaders stay in use");
    edit(&path(layout), "#define PIXEL_GROUP_SIZE 8u", "#define PIXEL_GROUP_SIZE 4u");
    edit(&path(tonemap), "no_such_word + ", "255u - ");
    messages.wait_for("warning: glsl/shared/layout.glsl: ");
    assert!(picture.is_shown_on(&display.screen()), "the previous shaders stay in use");
    edit(&path(layout), "#define PIXEL_GROUP_SIZE 4u", "#define PIXEL_GROUP_SIZE 8u");
    display.wait_until("the mended kernel's picture", |screen| inverted(&picture).is_shown_on(screen));

    display.focus("kdray");
    display.act(&["key", "Escape"]);
    assert_eq!(viewer.wait().unwrap().code(), Some(0));
}
