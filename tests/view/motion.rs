//! Tests of what the window shows while the camera moves, if the picture at rest is one of paths.

use std::{fs, path::Path, time::Duration};

use serde_json::Value;
use tempfile::TempDir;

use super::{
    ended, rendered,
    support::{
        command::cornell,
        display::{Display, Screen},
    },
    viewer,
};

/// A plain under a sky, as seen from above. `whitted` shows it in one colour, and paths with noise.
const PLAIN: &str = "[sky]\nelevation = 40\n[render]\nintegrator = \"path\"\nexposure = 0.6\n[camera]\n\
                     eye = [0, 2, 0]\ntarget = [0, 0, 0]\nup = [0, 0, -1]\n[[mesh]]\ngenerator = \"plane\"\n\
                     size = [400, 400]\n";

/// Returns the green channel in the middle of the window, where no text is.
fn middle(screen: &Screen) -> Vec<u8> {
    (20..100).flat_map(|y| &screen.pixels[y * screen.width..][20..140]).map(|pixel| pixel[1]).collect()
}

/// Returns how much the brightness differs in the middle of the window, or none if the window is black.
fn spread(screen: &Screen) -> Option<u8> {
    let greens = middle(screen);
    let (least, most) = (*greens.iter().min()?, *greens.iter().max()?);
    (most > 40).then_some(most - least)
}

/// Waits until the window does not show the picture at rest any more. Returns the median of what [`spread`] finds in
/// the window during half a second.
fn usual_spread(display: &Display, at_rest: &Screen) -> u8 {
    display.wait_until("a picture in motion", |screen| middle(screen) != middle(at_rest));
    let mut spreads: Vec<u8> = (0..20)
        .filter_map(|_| {
            std::thread::sleep(Duration::from_millis(25));
            spread(&display.screen())
        })
        .collect();
    spreads.sort_unstable();
    spreads[spreads.len() / 2]
}

/// The window shows pictures by `whitted` while a key is held, and paths at rest, the same as before.
#[test]
fn paths_are_drawn_at_rest_and_whitted_in_motion() {
    let (directory, display) = (TempDir::new().unwrap(), Display::start(320, 240));
    fs::write(directory.path().join("plain.toml"), PLAIN).unwrap();
    let paths = rendered(directory.path(), "plain.toml", &["--spp", "16"]);
    assert!(spread(&paths).unwrap() > 4);
    let viewer = viewer(directory.path(), &display, "plain.toml", &["--spp", "16", "--no-overlay", "-q"]);
    let is_even = |screen: &Screen| spread(screen).is_some_and(|spread| spread <= 1);
    let is_noisy = |screen: &Screen| spread(screen).is_some_and(|spread| spread > 4);
    display.wait_until("the picture of paths", |screen| paths.is_shown_on(screen));
    display.focus("kdray");
    // Slow flight stays over the plain, however late a picture comes.
    display.act(&["key", "--repeat", "20", "minus"]);
    display.act(&["keydown", "a"]);
    display.wait_until("a picture without noise", is_even);
    display.act(&["keyup", "a"]);
    display.wait_until("the picture at rest", is_noisy);
    display.act(&["key", "Home"]);
    display.wait_until("the picture of paths again", |screen| paths.is_shown_on(screen));
    // The other pictures in motion: paths, whose noise is coarse, since they are small, and paths without their noise.
    let [noisy, filtered] = ["paths", "filtered paths"].map(|picture| {
        display.act(&["key", "m", "keydown", "a"]);
        let spread = usual_spread(&display, &paths);
        display.act(&["keyup", "a", "key", "Home"]);
        display.wait_until("the picture of paths once more", |screen| paths.is_shown_on(screen));
        println!("{picture}: a spread of {spread}");
        spread
    });
    assert!(noisy > 2 * filtered && filtered > 1, "{noisy}, {filtered}: whitted has at most 1");
    display.act(&["key", "Escape"]);
    ended(viewer);
}

#[test]
fn a_tour_of_paths_ends_with_the_picture_that_render_makes() {
    let (directory, display) = (TempDir::new().unwrap(), Display::start(320, 240));
    let paths = ["--integrator", "path", "--spp", "4"];
    let expected = rendered(directory.path(), &cornell(), &paths);
    for in_motion in ["whitted", "path", "filtered"] {
        let files = ["--screenshot", "x.png", "--profile", "x.json", "-q", "--frames", "4", "--in-motion", in_motion];
        ended(viewer(directory.path(), &display, &cornell(), &[&paths[..], &files].concat()));
        assert_eq!(Screen::load(&directory.path().join("x.png")), expected, "{in_motion}");
        let json: Value = serde_json::from_slice(&read(directory.path())).unwrap();
        assert!(json["moving"]["frame_ms"]["n"] == 3, "{json}");
    }
}

fn read(directory: &Path) -> Vec<u8> {
    fs::read(directory.join("x.json")).unwrap()
}
