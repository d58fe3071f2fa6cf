//! Tests that the window answers while a driver compiles.

use std::{
    process::{Child, Stdio},
    time::{Duration, Instant},
};

use tempfile::TempDir;

use super::{
    ended,
    support::{
        command::{kdray, shipped},
        display::{Display, Screen},
    },
};

/// Starts a viewer of a scene whose kernels the driver compiles for many seconds, since it finds none in its cache.
fn compiling_viewer(directory: &TempDir, display: &Display) -> Child {
    let scene = shipped("lamp.toml");
    let mut command = kdray(directory.path(), &["view", &scene, "--size", "300x200", "--in-motion", "path", "-q"]);
    command.env("DISPLAY", &display.name).env_remove("WAYLAND_DISPLAY");
    command.env("MESA_SHADER_CACHE_DISABLE", "true").env("MESA_GLSL_CACHE_DISABLE", "true");
    command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

/// Returns whether the window's line is in the middle of a part of the screen: white letters on black.
fn has_line(screen: &Screen, (width, height): (usize, usize)) -> bool {
    let rows = height / 2 - 12..height / 2 + 12;
    let mut pixels = rows.flat_map(|y| screen.pixels[y * screen.width..][..width].iter());
    pixels.any(|pixel| pixel.iter().all(|channel| *channel > 200))
}

#[test]
fn a_window_whose_driver_compiles_says_so_follows_its_size_and_closes_at_once() {
    let (directory, display) = (TempDir::new().unwrap(), Display::start(640, 480));
    let viewer = compiling_viewer(&directory, &display);
    let window = display.focus("kdray");
    display.wait_until("what it waits for", |screen| has_line(screen, (300, 200)));
    display.act(&["windowsize", &window, "600", "400"]);
    display.wait_until("the same in a larger window", |screen| has_line(screen, (600, 400)));
    let start = Instant::now();
    display.close(&window);
    let output = ended(viewer);
    // The driver compiles for at least ten seconds more, which nothing can end.
    assert!(start.elapsed() < Duration::from_secs(4), "{:?}", start.elapsed());
    assert!(output.stdout.is_empty() && output.stderr.is_empty());
}
