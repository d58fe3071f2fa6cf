//! Errors that occur while the viewer's window is open, and do not close it.

use std::{fs, process::Stdio};

use tempfile::TempDir;

use super::{
    SIZE, ended, rendered,
    support::{
        command::{Messages, cornell, kdray, lose_device_at, stderr, stdout},
        display::Display,
    },
    viewer,
};

#[test]
fn a_picture_that_cannot_be_written_is_no_end() {
    let (directory, display) = (TempDir::new().unwrap(), Display::start(320, 240));
    let picture = rendered(directory.path(), &cornell(), &[]);
    let gone = directory.path().join("gone");
    fs::create_dir(&gone).unwrap();
    let viewer = viewer(&gone, &display, &cornell(), &["--spp", "1", "--no-overlay"]);
    display.wait_until("the picture", |screen| picture.is_shown_on(screen));
    fs::remove_dir(&gone).unwrap();
    display.focus("kdray");
    display.act(&["key", "s", "sleep", "0.2", "key", "p", "key", "2"]);
    display.wait_until("another view", |screen| !picture.is_shown_on(screen));
    display.act(&["key", "Escape"]);
    let output = ended(viewer);
    assert!(stdout(&output).starts_with("[camera]\n"), "{}", stdout(&output));
    let text = stderr(&output);
    assert!(text.contains("\nwarning: cannot write `cornell-001.png`: "), "{text}");
}

#[test]
fn a_lost_device_is_opened_anew() {
    let (directory, display) = (TempDir::new().unwrap(), Display::start(320, 240));
    let picture = rendered(directory.path(), &cornell(), &[]);
    let scene = cornell();
    let mut command = kdray(directory.path(), &["view", &scene, "--size", SIZE, "--spp", "64", "--no-overlay"]);
    // The device is lost while samples are drawn: each sample takes at least five submits.
    lose_device_at(&mut command, 100, directory.path());
    command.env("DISPLAY", &display.name).env_remove("WAYLAND_DISPLAY");
    let viewer = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mean = rendered(directory.path(), &scene, &["--spp", "64"]);
    assert!(mean != picture);
    display.wait_until("all samples", |screen| mean.is_shown_on(screen));
    display.focus("kdray");
    display.act(&["key", "Escape"]);
    let output = ended(viewer);
    let text = stderr(&output);
    let lost = text.lines().filter(|line| line.contains("the device was opened again")).count();
    assert_eq!(lost, 1, "{text}");
}

#[test]
fn a_changed_scene_is_shown_and_a_broken_one_is_not() {
    let (directory, display) = (TempDir::new().unwrap(), Display::start(320, 240));
    let path = directory.path().join("x.toml");
    let bright = fs::read_to_string(cornell()).unwrap();
    let dark = bright.replace("ambient = [0.34, 0.33, 0.31]", "ambient = [0.1, 0.1, 0.4]");
    assert_ne!(bright, dark);
    fs::write(&path, &bright).unwrap();
    let before = rendered(directory.path(), "x.toml", &[]);
    let mut viewer = viewer(directory.path(), &display, "x.toml", &["--spp", "1", "--no-overlay"]);
    let messages = Messages::of(&mut viewer);
    display.wait_until("the scene", |screen| before.is_shown_on(screen));
    fs::write(&path, &dark).unwrap();
    let after = rendered(directory.path(), "x.toml", &[]);
    assert!(before != after);
    display.wait_until("the changed scene", |screen| after.is_shown_on(screen));
    fs::write(&path, "mesh = [[").unwrap();
    messages.wait_for("warning: x.toml:1:");
    assert!(after.is_shown_on(&display.screen()), "the old one stays");
    fs::write(&path, &bright).unwrap();
    display.wait_until("the mended scene", |screen| before.is_shown_on(screen));
    display.focus("kdray");
    display.act(&["key", "Escape"]);
    ended(viewer);
}
