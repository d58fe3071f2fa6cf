//! Tests that the window opens files which are dropped on it.

use std::{fs, path::Path};

use tempfile::TempDir;

use super::{
    SIZE, ended, rendered, started,
    support::{
        command::{Messages, cornell, fail, names, stderr},
        display::Display,
    },
    viewer,
};

#[test]
fn a_dropped_file_is_shown_and_a_broken_one_is_not() {
    let (directory, display) = (TempDir::new().unwrap(), Display::start(320, 240));
    let path = |name: &str| directory.path().join(name);
    let bright = fs::read_to_string(cornell()).unwrap();
    let dropped = bright.replace("eye = [0.0, 2.75, 10.7]", "eye = [1.0, 2.75, 10.7]");
    let changed = dropped.replace("ambient = [0.34, 0.33, 0.31]", "ambient = [0.1, 0.1, 0.4]");
    assert!(bright != dropped && dropped != changed);
    fs::write(path("other.toml"), &dropped).unwrap();
    let [first, other] = [&cornell(), "other.toml"].map(|scene| rendered(directory.path(), scene, &[]));
    assert!(first != other);
    fs::write(path("broken.ply"), "ply\nnonsense").unwrap();

    let viewer = viewer(directory.path(), &display, &cornell(), &["--spp", "1", "--no-overlay"]);
    display.wait_until("the first scene", |screen| first.is_shown_on(screen));
    let window = display.focus("kdray");
    display.drop_file(&window, &path("other.toml"));
    display.wait_until("the dropped scene", |screen| other.is_shown_on(screen));
    assert_eq!(display.act(&["getwindowname", &window]).trim(), "kdray: other");
    display.drop_file(&window, &path("broken.ply"));
    // The broken file is read before the changed one, and changes of the dropped scene are still followed.
    fs::write(path("other.toml"), &changed).unwrap();
    let changed = rendered(directory.path(), "other.toml", &[]);
    display.wait_until("the changed scene", |screen| changed.is_shown_on(screen));
    display.act(&["key", "Escape"]);
    let text = stderr(&ended(viewer));
    let warnings: Vec<_> = text.lines().filter(|line| line.starts_with("warning: ")).collect();
    assert!(warnings.len() == 1 && warnings[0].contains("broken.ply"), "{text}");
}

#[test]
fn a_window_without_a_scene_waits_for_a_file() {
    let (directory, display) = (TempDir::new().unwrap(), Display::start(320, 240));
    let picture = rendered(directory.path(), &cornell(), &[]);
    fs::write(directory.path().join("broken.ply"), "ply\nnonsense").unwrap();
    let mut viewer = started(directory.path(), &display, &["--size", SIZE, "--spp", "1", "--no-overlay"]);
    let messages = Messages::of(&mut viewer);
    display.wait_until("what to do", |screen| screen.pixels[..160 * 320].iter().any(|pixel| pixel[0] > 200));
    let window = display.focus("kdray");
    let before = display.screen();
    display.drop_file(&window, &directory.path().join("broken.ply"));
    messages.wait_for("broken.ply");
    display.wait_until("an error", |screen| *screen != before);
    // Keys and drags for scenes have no effect.
    display.act(&["key", "s", "key", "2", "key", "Tab", "key", "1", "mousemove", "80", "60", "click", "1"]);
    display.drop_file(&window, Path::new(&cornell()));
    display.wait_until("the scene", |screen| picture.is_shown_on(screen));
    display.act(&["key", "Escape"]);
    ended(viewer);
    assert_eq!(names(directory.path()), ["broken.ply"], "there was nothing to save");
    fail(directory.path(), &["view", "--frames", "2"], 2, "SCENE");
    fail(directory.path(), &["view", "--camera", "0"], 2, "--camera");
}
