//! Tests that the window responds while a picture takes seconds.

use std::{
    path::Path,
    process::Child,
    thread,
    time::{Duration, Instant},
};

use tempfile::TempDir;

use super::{
    ended,
    support::{
        command::{PATIENCE, shipped, stdout, succeed},
        display::{Display, Screen},
    },
    viewer_of_size,
};

/// Arguments with which `view` and `render` draw the same picture; by default each would choose its own method.
const SAME: [&str; 4] = ["--size", "320x240", "--primary", "trace"];

/// Starts a viewer of a glass scene, a sample of which takes seconds on a software driver.
fn slow_viewer(directory: &Path, display: &Display, n_samples: &str) -> Child {
    let arguments = [&["--spp", n_samples, "--no-overlay", "-q"], &SAME[..]].concat();
    viewer_of_size(directory, display, &shipped("paper3.toml"), &arguments)
}

/// Starts a display so wide that its middle, where the mouse pointer is, is outside the window.
fn wide_display() -> Display {
    Display::start(700, 300)
}

/// Returns the viewer's picture of one sample, as `kdray render` draws it.
fn picture(directory: &Path) -> Screen {
    let scene = shipped("paper3.toml");
    succeed(directory, &[&["render", &scene, "-q", "-o", "rendered.png"], &SAME[..]].concat());
    Screen::load(&directory.join("rendered.png"))
}

/// Waits for the picture. Returns whether the screen showed a preview before it: a still image other than `framed`,
/// the screen at the start.
fn previews(display: &Display, framed: &Screen, picture: &Screen) -> bool {
    let (start, mut before, mut is_previewed) = (Instant::now(), display.screen(), false);
    loop {
        thread::sleep(Duration::from_millis(10));
        let screen = display.screen();
        if picture.is_shown_on(&screen) {
            return is_previewed;
        }
        // Two equal screens in a row show a complete frame and not one that is just being drawn.
        is_previewed |= screen == before && screen != *framed;
        before = screen;
        assert!(start.elapsed() < PATIENCE, "the picture never came");
    }
}

#[test]
fn home_shows_a_small_picture_at_once() {
    let (directory, display) = (TempDir::new().unwrap(), wide_display());
    let picture = picture(directory.path());
    let viewer = slow_viewer(directory.path(), &display, "1");
    display.focus("kdray");
    display.wait_until("the picture", |screen| picture.is_shown_on(screen));
    display.act(&["key", "f"]);
    display.wait_until("the framed scene", |screen| !picture.is_shown_on(screen));
    thread::sleep(Duration::from_millis(500));
    let framed = display.screen();
    display.act(&["key", "Home"]);
    assert!(previews(&display, &framed, &picture));
    display.act(&["key", "Escape"]);
    ended(viewer);
}

#[test]
fn what_is_seen_is_saved_at_once() {
    let (directory, display) = (TempDir::new().unwrap(), wide_display());
    let picture = picture(directory.path());
    let viewer = slow_viewer(directory.path(), &display, "256");
    display.focus("kdray");
    display.wait_until("the first sample", |screen| picture.is_shown_on(screen));
    // The keys are pressed while the second sample is drawn.
    display.act(&["key", "s", "key", "p", "key", "Escape"]);
    let output = ended(viewer);
    let text = stdout(&output);
    assert!(text.contains("wrote paper3-001.png\n") && text.contains("[camera]\n"), "{text}");
    assert!(Screen::load(&directory.path().join("paper3-001.png")) == picture);
}

/// Ends the viewer while a save waits for the whole picture. The picture that is seen is saved then.
#[test]
fn a_closed_window_saves_what_waits_to_be_saved() {
    let (directory, display) = (TempDir::new().unwrap(), wide_display());
    let viewer = slow_viewer(directory.path(), &display, "1");
    let window = display.focus("kdray");
    display.wait_until("a small picture", |screen| screen.pixels.iter().any(|pixel| *pixel != [0; 3]));
    display.act(&["key", "s"]);
    display.close(&window);
    let text = stdout(&ended(viewer));
    assert!(text.starts_with("wrote paper3-001.png\n"), "{text}");
}

#[test]
fn a_picture_that_is_not_there_yet_is_saved_when_it_is_and_nobody_waits() {
    let (directory, display) = (TempDir::new().unwrap(), wide_display());
    let picture = picture(directory.path());
    let viewer = slow_viewer(directory.path(), &display, "1");
    display.focus("kdray");
    let is_small = |screen: &Screen| screen.pixels.iter().any(|pixel| *pixel != [0; 3]) && !picture.is_shown_on(screen);
    display.wait_until("a small picture", is_small);
    display.act(&["key", "s", "key", "p"]);
    display.wait_until("the picture", |screen| picture.is_shown_on(screen));
    display.act(&["key", "Escape"]);
    let text = stdout(&ended(viewer));
    assert!(text.starts_with("[camera]\n") && text.ends_with("\nwrote paper3-001.png\n"), "{text}");
    assert!(Screen::load(&directory.path().join("paper3-001.png")) == picture);
}
