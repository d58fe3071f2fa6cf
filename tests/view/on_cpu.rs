//! Tests pictures that the CPU engine draws and Vulkan only shows.

use tempfile::TempDir;

use super::{
    Screen, ended, rendered,
    support::{command::cornell, command::shipped, command::stdout, display::Display},
    viewer,
};

#[test]
fn the_window_shows_and_saves_what_the_cpu_draws() {
    let (directory, display) = (TempDir::new().unwrap(), Display::start(320, 240));
    for scene in [cornell(), shipped("lamp.toml")] {
        let picture = rendered(directory.path(), &scene, &["--cpu", "--spp", "1"]);
        let viewer = viewer(directory.path(), &display, &scene, &["--cpu", "--spp", "1", "--no-overlay", "-q"]);
        display.wait_until("the CPU's picture", |screen| picture.is_shown_on(screen));
        display.focus("kdray");
        display.act(&["keydown", "w"]);
        display.wait_until("another view", |screen| !picture.is_shown_on(screen));
        display.act(&["keyup", "w", "key", "Home"]);
        display.wait_until("the first view", |screen| picture.is_shown_on(screen));
        display.act(&["key", "F12", "key", "Escape"]);
        let text = stdout(&ended(viewer));
        let file = text.trim().strip_prefix("wrote ").expect("a picture that is saved");
        assert_eq!(Screen::load(&directory.path().join(file)), picture);
    }
}

#[test]
fn a_tour_on_the_cpu_ends_with_the_picture_that_render_makes() {
    let (directory, display) = (TempDir::new().unwrap(), Display::start(320, 240));
    let arguments = ["--cpu", "--frames", "3", "--screenshot", "x.png", "--spp", "2", "-q"];
    ended(viewer(directory.path(), &display, &cornell(), &arguments));
    let expected = rendered(directory.path(), &cornell(), &["--cpu", "--spp", "2"]);
    assert_eq!(Screen::load(&directory.path().join("x.png")), expected);
}

#[test]
fn a_window_takes_clicks_and_closes_while_the_cpu_draws() {
    let (directory, display) = (TempDir::new().unwrap(), Display::start(700, 300));
    let viewer = viewer(directory.path(), &display, &shipped("lamp.toml"), &["--cpu", "-q"]);
    let window = display.focus("kdray");
    display.wait_until("a picture", |screen| screen.pixels[60 * screen.width + 140] != [0; 3]);
    display.act(&["key", "Tab", "mousemove", "80", "60", "click", "1", "key", "Tab"]);
    display.close(&window);
    ended(viewer);
}
