//! Tests `kdray view` in a window on a display of its own, under the validation layer.
#![cfg(target_os = "linux")]

#[path = "../support/mod.rs"]
mod support;

mod compiling;
mod failures;
mod files;
mod motion;
mod on_cpu;
mod shaders;
mod slow;
mod timeline;

use std::{
    fs,
    path::Path,
    process::{Child, Output, Stdio},
    thread,
    time::{Duration, Instant},
};

use serde_json::Value;
use support::{
    command::{COMPLAINTS, PATIENCE, cornell, kdray, names, stderr, stdout, succeed},
    display::{Display, Screen},
};
use tempfile::TempDir;

const SIZE: &str = "160x120";

/// Starts a viewer of a scene on the display, in a small window.
fn viewer(directory: &Path, display: &Display, scene: &str, more: &[&str]) -> Child {
    viewer_of_size(directory, display, scene, &[&["--size", SIZE], more].concat())
}

/// Starts a viewer of a scene on the display, in a window whose size is among the arguments.
fn viewer_of_size(directory: &Path, display: &Display, scene: &str, more: &[&str]) -> Child {
    started(directory, display, &[&[scene], more].concat())
}

/// Starts a viewer on the display.
fn started(directory: &Path, display: &Display, arguments: &[&str]) -> Child {
    let mut command = kdray(directory, &[&["view", "--validate"], arguments].concat());
    command.env("DISPLAY", &display.name).env_remove("WAYLAND_DISPLAY").stdout(Stdio::piped()).stderr(Stdio::piped());
    command.spawn().unwrap()
}

/// Waits until the viewer ends, but not for ever, and asserts that it succeeds.
fn ended(viewer: Child) -> Output {
    let mut viewer = viewer;
    let start = Instant::now();
    while viewer.try_wait().unwrap().is_none() {
        if start.elapsed() > PATIENCE {
            viewer.kill().unwrap();
            panic!("the viewer does not end: {}", stderr(&viewer.wait_with_output().unwrap()));
        }
        thread::sleep(Duration::from_millis(20));
    }
    let output = viewer.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    output
}

/// Returns the picture that `kdray render` makes of a scene.
fn rendered(directory: &Path, scene: &str, more: &[&str]) -> Screen {
    let path = directory.join("rendered.png");
    let arguments = [&["render", scene, "--size", SIZE, "-q", "-o", path.to_str().unwrap()], more].concat();
    succeed(directory, &arguments);
    let picture = Screen::load(&path);
    fs::remove_file(path).unwrap();
    picture
}

#[test]
fn a_tour_ends_with_the_picture_that_render_makes() {
    let (directory, display) = (TempDir::new().unwrap(), Display::start(320, 240));
    let files = ["--screenshot", "x.png", "--profile", "x.json", "-q"];
    for more in [&["--no-overlay"][..], &["--spp", "3", "--vsync", "off", "--build", "fast"]] {
        let arguments = [&["--frames", "4"], &files[..], more].concat();
        let output = ended(viewer(directory.path(), &display, &cornell(), &arguments));
        assert!(output.stdout.is_empty() && output.stderr.is_empty(), "{}{}", stdout(&output), stderr(&output));
        let samples = if more[0] == "--spp" { &more[..2] } else { &[] };
        let expected = rendered(directory.path(), &cornell(), samples);
        assert_eq!(Screen::load(&directory.path().join("x.png")), expected);
    }
    let json: Value = serde_json::from_slice(&fs::read(directory.path().join("x.json")).unwrap()).unwrap();
    let words = |choice: &str| ["value", "by"].map(|word| json["choices"][choice][word].as_str().unwrap().to_owned());
    assert_eq!(words("build"), ["fast", "pinned"]);
    assert_eq!(words("traversal")[1], "rule");
    for times in ["frame_ms", "input_to_present_ms"] {
        let at = |percentile: &str| json[times][percentile].as_f64().unwrap();
        assert!(json[times]["n"].as_u64() >= Some(4) && json["vsync"] == false, "{json}");
        assert!(0.0 < at("p50") && at("p50") <= at("p95") && at("p95") <= at("p99"), "{json}");
    }
    // The camera rests at the last frame; the frames before it are drawn small.
    let moving = &json["moving"];
    let pixels = ["width", "height"].map(|side| moving[side].as_u64().unwrap());
    assert!(moving["frame_ms"]["n"] == 3 && (20..160).contains(&pixels[0]) && pixels[1] < 120, "{json}");
}

#[test]
fn recorded_frames_go_once_around() {
    let (directory, display) = (TempDir::new().unwrap(), Display::start(320, 240));
    fs::create_dir(directory.path().join("frames")).unwrap();
    let arguments = ["--frames", "3", "--record", "frames", "--no-overlay", "-q"];
    ended(viewer(directory.path(), &display, &cornell(), &arguments));
    let frames = directory.path().join("frames");
    assert_eq!(names(&frames), ["frame.0000.png", "frame.0001.png", "frame.0002.png"]);
    let [first, second, last] = [0, 1, 2].map(|i| Screen::load(&frames.join(format!("frame.000{i}.png"))));
    assert_eq!(last, rendered(directory.path(), &cornell(), &[]));
    assert!(first != second && first != last && second != last);
}

#[test]
fn a_path_is_the_one_that_render_follows() {
    let (directory, display) = (TempDir::new().unwrap(), Display::start(320, 240));
    let keyframe = |frame: u32, x: f32| {
        format!("[[keyframe]]\nframe = {frame}\neye = [{x:?}, 2.75, 9.0]\ntarget = [0.0, 2.75, 0.0]\n")
    };
    fs::write(directory.path().join("path.toml"), keyframe(0, 0.0) + &keyframe(3, 2.0)).unwrap();
    fs::create_dir(directory.path().join("frames")).unwrap();
    let path = ["--path", "path.toml"];
    ended(viewer(directory.path(), &display, &cornell(), &[&path[..], &["--record", "frames", "-q"]].concat()));
    let scene = cornell();
    let arguments = [&["render", &scene, "--size", SIZE, "-q", "-o", "####.png"], &path[..]].concat();
    succeed(directory.path(), &arguments);
    for frame in ["0000.png", "0001.png", "0002.png", "0003.png"] {
        let shown = Screen::load(&directory.path().join(format!("frames/frame.{frame}")));
        assert_eq!(shown, Screen::load(&directory.path().join(frame)), "{frame}");
    }
}

#[test]
fn number_keys_show_other_views_and_the_picture_again() {
    let (directory, display) = (TempDir::new().unwrap(), Display::start(320, 240));
    let picture = rendered(directory.path(), &cornell(), &[]);
    let viewer = viewer(directory.path(), &display, &cornell(), &["--spp", "1", "--no-overlay", "-q"]);
    display.wait_until("the picture", |screen| picture.is_shown_on(screen));
    display.focus("kdray");
    let mut before = display.screen();
    for key in ["2", "3", "4", "5", "6"] {
        display.act(&["key", key]);
        display.wait_until("another view", |screen| *screen != before && !picture.is_shown_on(screen));
        before = display.screen();
    }
    display.act(&["key", "1"]);
    display.wait_until("the picture again", |screen| picture.is_shown_on(screen));
    display.act(&["key", "Escape"]);
    ended(viewer);
}

#[test]
fn a_false_colour_view_has_a_legend_with_the_value_under_the_pointer() {
    let (directory, display) = (TempDir::new().unwrap(), Display::start(800, 400));
    let viewer = viewer_of_size(directory.path(), &display, &cornell(), &["--size", "800x400", "--spp", "1", "-q"]);
    display.focus("kdray");
    // The legend's place, where the picture shows nothing bright.
    let corner = |screen: &Screen| -> Vec<[u8; 3]> {
        (8..90).flat_map(|y| screen.pixels[y * screen.width..][530..790].to_vec()).collect()
    };
    let has_white = |screen: &Screen| corner(screen).iter().any(|pixel| pixel.iter().all(|channel| *channel > 240));
    display.act(&["mousemove", "400", "200"]);
    display.wait_until("a picture", |screen| screen.pixels[200 * 800 + 400] != [0; 3]);
    assert!(!has_white(&display.screen()), "the picture has no legend");
    display.act(&["key", "2"]);
    display.wait_until("a bar from white to black", has_white);
    thread::sleep(Duration::from_millis(500));
    let before = corner(&display.screen());
    display.act(&["mousemove", "420", "330"]);
    display.wait_until("another value", |screen| corner(screen) != before);
    display.act(&["key", "Escape"]);
    ended(viewer);
}

#[test]
fn the_window_shows_the_picture_and_the_overlay_over_it() {
    let (directory, display) = (TempDir::new().unwrap(), Display::start(320, 240));
    let picture = rendered(directory.path(), &cornell(), &[]);
    let other = rendered(directory.path(), &cornell(), &["--exposure", "1.02"]);
    let viewer = viewer(directory.path(), &display, &cornell(), &["--spp", "1", "--no-overlay", "-q"]);
    display.wait_until("the picture", |screen| picture.is_shown_on(screen));
    assert!(!other.is_shown_on(&display.screen()), "a picture of another exposure is told from it");
    display.focus("kdray");
    display.act(&["key", "Tab"]);
    display.wait_until("the overlay", |screen| !picture.is_shown_on(screen));
    display.act(&["key", "Tab"]);
    display.wait_until("the picture again", |screen| picture.is_shown_on(screen));
    display.act(&["key", "s", "key", "p", "key", "Escape"]);
    let output = ended(viewer);
    let text = stdout(&output);
    assert!(text.contains("[camera]\neye = [0.0, 2.75, 10.7]\n") && text.contains("wrote cornell-001.png\n"), "{text}");
    assert_eq!(Screen::load(&directory.path().join("cornell-001.png")), picture);
}

/// The server draws the pointer over the window, but tests see the picture without it.
#[test]
fn a_pointer_over_the_picture_hides_nothing_from_tests() {
    let (directory, display) = (TempDir::new().unwrap(), Display::start(320, 240));
    let picture = rendered(directory.path(), &cornell(), &[]);
    let viewer = viewer(directory.path(), &display, &cornell(), &["--spp", "1", "--no-overlay", "-q"]);
    display.wait_until("the picture", |screen| picture.is_shown_on(screen));
    let before = display.screen();
    // Over the picture, and beside it, whence the pointer's edge reaches into the picture.
    for (x, y) in [(80, 60), (159, 119), (161, 60)] {
        display.show_pointer(x, y);
        assert!(display.screen() == before, "{x}, {y}");
    }
    display.focus("kdray");
    display.act(&["key", "Escape"]);
    ended(viewer);
}

#[test]
fn keys_and_mouse_move_the_camera_and_home_brings_it_back() {
    let (directory, display) = (TempDir::new().unwrap(), Display::start(320, 240));
    let picture = rendered(directory.path(), &cornell(), &[]);
    let viewer = viewer(directory.path(), &display, &cornell(), &["--spp", "1", "--no-overlay", "-q"]);
    display.wait_until("the picture", |screen| picture.is_shown_on(screen));
    display.focus("kdray");
    // A key that goes down and up between two frames moves nothing, so it is held until the screen shows the motion.
    display.act(&["keydown", "w"]);
    display.wait_until("another view", |screen| !picture.is_shown_on(screen));
    display.act(&["keyup", "w", "key", "Home"]);
    display.wait_until("the first view", |screen| picture.is_shown_on(screen));
    let moves: [&[&str]; 8] = [
        &["mousemove", "80", "60", "mousedown", "1", "mousemove", "120", "60", "mouseup", "1"],
        &["mousemove", "80", "60", "mousedown", "3", "mousemove", "120", "60", "mouseup", "3"],
        &["mousemove", "80", "60", "mousedown", "2", "mousemove", "100", "70", "mouseup", "2"],
        &["keydown", "shift", "mousedown", "1", "mousemove", "80", "60", "mouseup", "1", "keyup", "shift"],
        &["mousemove", "80", "60", "click", "4"],
        &["key", "f"],
        &["key", "period"],
        &["key", "u"],
    ];
    for arguments in moves {
        display.act(arguments);
        display.wait_until("another view", |screen| !picture.is_shown_on(screen));
        display.act(&["key", "Home"]);
        display.wait_until("the first view", |screen| picture.is_shown_on(screen));
    }
    display.act(&["key", "Escape"]);
    ended(viewer);
}

#[test]
fn keys_are_listed_over_the_picture_and_a_line_says_how() {
    // The mouse pointer is in the screen's middle, which is outside the window.
    let (directory, display) = (TempDir::new().unwrap(), Display::start(1000, 400));
    let size = ["--size", "480x360"];
    succeed(directory.path(), &[&["render", &cornell(), "-q", "-o", "rendered.png"], &size[..]].concat());
    let picture = Screen::load(&directory.path().join("rendered.png"));
    let corner = |screen: &Screen| -> Vec<[u8; 3]> {
        (330..360).flat_map(|y| screen.pixels[y * screen.width..][400..480].to_vec()).collect()
    };
    let arguments = [&["--spp", "1", "-q"], &size[..]].concat();
    let viewer = viewer_of_size(directory.path(), &display, &cornell(), &arguments);
    display.focus("kdray");
    let beside = |screen: &Screen| screen.pixels[400..480] == picture.pixels[400..480];
    display.wait_until("a line in the corner", |screen| beside(screen) && corner(screen) != corner(&picture));
    display.act(&["key", "p"]);
    display.wait_until("no line any more", |screen| corner(screen) == corner(&picture));
    display.act(&["key", "Tab"]);
    display.wait_until("nothing but the picture", |screen| picture.is_shown_on(screen));
    for key in ["h", "F1", "question"] {
        display.act(&["key", key]);
        display.wait_until("the keys", |screen| !picture.is_shown_on(screen));
        // If the list is open, Escape closes the list and not the window.
        display.act(&["key", if key == "F1" { "Escape" } else { key }]);
        display.wait_until("the picture again", |screen| picture.is_shown_on(screen));
    }
    display.act(&["key", "Escape"]);
    ended(viewer);
}

#[test]
fn a_resized_window_shows_a_picture_of_its_size() {
    let (directory, display) = (TempDir::new().unwrap(), Display::start(320, 240));
    let viewer = viewer(directory.path(), &display, &cornell(), &["--spp", "1", "--no-overlay", "-q"]);
    let window = display.focus("kdray");
    for size in ["300x200", "40x30", "161x121"] {
        let (width, height) = size.split_once('x').unwrap();
        display.act(&["windowsize", &window, width, height]);
        let path = directory.path().join("sized.png");
        succeed(directory.path(), &["render", &cornell(), "--size", size, "-q", "-o", "sized.png"]);
        let picture = Screen::load(&path);
        display.wait_until(size, |screen| picture.is_shown_on(screen));
    }
    display.act(&["key", "Escape"]);
    ended(viewer);
}

#[test]
fn windows_without_area_and_sudden_sizes_are_no_trouble() {
    let (directory, display) = (TempDir::new().unwrap(), Display::start(320, 240));
    let viewer = viewer(directory.path(), &display, &cornell(), &["--spp", "1"]);
    let window = display.focus("kdray");
    for round in 0..3 {
        for (width, height) in [(1, 1), (300, 20), (20, 200), (2, 1), (310, 230), (1, 1)] {
            display.act(&["windowsize", &window, &(width + round).to_string(), &height.to_string()]);
        }
        display.act(&["windowunmap", "--sync", &window, "windowsize", &window, "50", "50"]);
        display.act(&["windowmap", "--sync", &window]);
    }
    display.act(&["windowsize", &window, "160", "120"]);
    let picture = rendered(directory.path(), &cornell(), &[]);
    display.act(&["windowfocus", "--sync", &window, "key", "Tab"]);
    display.wait_until("the picture", |screen| picture.is_shown_on(screen));
    display.act(&["key", "Escape"]);
    let text = stderr(&ended(viewer));
    assert!(!text.contains("warning"), "{text}");
}

#[test]
fn without_a_display_it_says_so() {
    let directory = TempDir::new().unwrap();
    for display in [None, Some(":98765")] {
        let mut command = kdray(directory.path(), &["view", &cornell()]);
        command.env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY").env_remove("WAYLAND_SOCKET");
        let output = command.envs(display.map(|display| ("DISPLAY", display))).output().unwrap();
        let text = stderr(&output);
        assert_eq!((output.status.code(), text.lines().count()), (Some(4), 1), "{text}");
        assert!(text.starts_with("error: no display to open a window on: "), "{text}");
    }
}

#[test]
fn usage_mistakes_are_refused_before_there_is_a_window() {
    let directory = TempDir::new().unwrap();
    let cases: &[(&[&str], i32, &str)] = &[
        (&["--screenshot", "x.png"], 2, "--frames"),
        (&["--frames", "0"], 2, "--frames"),
        (&["--frames", "1", "--screenshot", "x.jpg"], 2, "x.jpg"),
        (&["--budget-ms", "0"], 2, "--budget-ms"),
        (&["--vsync", "maybe"], 2, "--vsync"),
        (&["--frames", "1", "--record", "none"], 5, "none"),
        (&["--frames", "1", "--screenshot", "none/x.png"], 5, "none/x.png"),
    ];
    for (more, code, named) in cases {
        support::command::fail(directory.path(), &[&["view", "none.toml"], *more].concat(), *code, named);
    }
}

/// The validation layer's best-practice messages, enabled by an environment variable, stand in for an error.
#[test]
fn a_validation_message_fails() {
    let (directory, display) = (TempDir::new().unwrap(), Display::start(320, 240));
    let mut command = kdray(directory.path(), &["view", &cornell(), "--frames", "1", "--validate", "-q"]);
    command.env("DISPLAY", &display.name).env(COMPLAINTS.0, COMPLAINTS.1);
    let output = command.output().unwrap();
    let text = stderr(&output);
    assert_eq!(output.status.code(), Some(4), "{text}");
    assert!(text.lines().last().unwrap().starts_with("error: the validation layer"), "{text}");
}
