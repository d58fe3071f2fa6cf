//! Tests of the window's time line, which plays the animations of a file.

use std::{cell::RefCell, fs, path::Path, process::Child, thread, time::Duration};

use serde_json::{Value, json};
use tempfile::TempDir;

use super::{
    ended,
    support::{
        animated::moving,
        command::{stderr, succeed},
        display::{Display, Screen},
    },
    viewer_of_size,
};

/// Arguments with which `view` and `render` draw the same pictures.
const SAME: [&str; 8] = ["--size", "480x360", "--primary", "trace", "--exposure", "1", "--spp", "4"];
/// Where the time line's first row is: the slider, and the number beside it.
const SLIDER: [&str; 2] = ["200", "313"];
const NUMBER: [&str; 2] = ["416", "313"];
/// Where it has the list of animations, and where the opened list has the second one of the file.
const LIST: [&str; 2] = ["267", "334"];
const SECOND: [&str; 2] = ["240", "309"];

/// Writes `moving.gltf` with a second animation, `back`, which moves the square that is at rest in `slide`.
fn with_model(morphs: bool, change: impl FnOnce(&mut Value)) -> TempDir {
    let mut model = moving(morphs);
    let place = model["nodes"][1].as_object_mut().unwrap().remove("translation").unwrap();
    model["nodes"].as_array_mut().unwrap().push(json!({ "translation": place, "children": [1] }));
    model["scenes"][0]["nodes"] = json!([0, 4, 2, 3]);
    // Where `back` leaves the camera, which sees something.
    model["nodes"][2]["translation"] = json!([0, 0, 6]);
    let mut back = model["animations"][0].clone();
    back["name"] = json!("back");
    back["channels"] = json!([{ "sampler": 0, "target": { "node": 1, "path": "translation" } }]);
    model["animations"].as_array_mut().unwrap().push(back);
    change(&mut model);
    let directory = TempDir::new().unwrap();
    fs::write(directory.path().join("moving.gltf"), model.to_string()).unwrap();
    directory
}

/// Starts a viewer of the file, without a panel at first.
fn player(directory: &Path, display: &Display, more: &[&str]) -> Child {
    let viewer =
        viewer_of_size(directory, display, "moving.gltf", &[&SAME[..], &["--no-overlay", "-q"], more].concat());
    display.focus("kdray");
    viewer
}

fn rendered(directory: &Path, more: &[&str]) -> Screen {
    // Each option may be given once.
    let same = if more.contains(&"--spp") { &SAME[..6] } else { &SAME };
    succeed(directory, &[&["render", "moving.gltf", "-q", "-o", "rendered.png"], same, more].concat());
    Screen::load(&directory.join("rendered.png"))
}

/// Does something that the screen shows.
fn seen(display: &Display, act: &[&str]) {
    let before = display.screen();
    display.act(act);
    display.wait_until(&format!("{act:?}"), |screen| *screen != before);
    // What is laid out has its size after the second time.
    thread::sleep(Duration::from_millis(300));
}

fn click(display: &Display, [x, y]: [&str; 2]) {
    seen(display, &["mousemove", x, y, "click", "1"]);
}

/// Drags the slider of the moment beyond its left or its right end.
fn drag_to(display: &Display, x: &str) {
    seen(display, &["key", "Tab"]);
    seen(display, &["mousemove", SLIDER[0], SLIDER[1], "mousedown", "1"]);
    seen(display, &["mousemove", x, SLIDER[1]]);
    display.act(&["mouseup", "1", "key", "Tab"]);
}

#[test]
fn a_moment_of_the_slider_is_that_of_render_and_is_refined() {
    for (morphs, more) in [(false, &[][..]), (true, &[]), (true, &["--cpu"]), (false, &["--integrator", "path"])] {
        let (directory, display) = (with_model(morphs, |_| ()), Display::start(640, 480));
        let path = directory.path();
        let at = |more_at: &[&str]| rendered(path, &[more_at, more].concat());
        let viewer = player(path, &display, more);
        let (at_rest, begin, end) = (at(&[]), at(&["--at", "0"]), at(&["--at", "2"]));
        display.wait_until("the file at rest", |screen| at_rest.is_shown_on(screen));
        drag_to(&display, "475");
        display.wait_until("the end", |screen| end.is_shown_on(screen));
        let unrefined = at(&["--at", "2", "--spp", "1"]);
        assert!(end != at_rest && end != unrefined, "samples of the moment were added up");
        drag_to(&display, "5");
        display.wait_until("the beginning", |screen| begin.is_shown_on(screen));
        seen(&display, &["key", "Tab"]);
        click(&display, NUMBER);
        display.act(&["type", "1.25"]);
        seen(&display, &["key", "Return"]);
        display.act(&["key", "Tab"]);
        let typed = at(&["--at", "1.25"]);
        display.wait_until("the moment that was typed", |screen| typed.is_shown_on(screen));
        display.act(&["key", "Escape"]);
        ended(viewer);
    }
}

#[test]
fn it_plays_and_rests() {
    for more in [&[][..], &["--cpu"], &["--integrator", "path"]] {
        let (directory, display) = (with_model(true, |_| ()), Display::start(640, 480));
        let viewer = player(directory.path(), &display, &[more, &["--at", "0.5"]].concat());
        let first = rendered(directory.path(), &[more, &["--at", "0.5"]].concat());
        display.wait_until("the first moment", |screen| first.is_shown_on(screen));
        display.act(&["key", "space"]);
        for _ in 0..6 {
            let before = display.screen();
            display.wait_until("another moment", |screen| *screen != before);
            let is_black = |pixel: &[u8; 3]| pixel == &[0; 3];
            assert!(!display.screen().pixels.iter().all(is_black), "a picture stays until the next one");
        }
        seen(&display, &["key", "space"]);
        let before = RefCell::new(None);
        display.wait_until("a picture that rests", |screen| {
            thread::sleep(Duration::from_millis(500));
            before.replace(Some(screen.clone())).as_ref() == Some(screen)
        });
        assert!(!first.is_shown_on(&display.screen()));
        display.act(&["key", "Escape"]);
        ended(viewer);
    }
}

#[test]
fn another_animation_is_chosen_in_the_list() {
    let (directory, display) = (with_model(false, |_| ()), Display::start(640, 480));
    let of = |animation: &str| rendered(directory.path(), &["--at", "1.5", "--animation", animation]);
    let viewer = player(directory.path(), &display, &["--at", "1.5", "--animation", "slide"]);
    let (slide, back) = (of("slide"), of("back"));
    assert!(slide != back);
    display.wait_until("the first animation", |screen| slide.is_shown_on(screen));
    seen(&display, &["key", "Tab"]);
    click(&display, LIST);
    click(&display, SECOND);
    display.act(&["key", "Tab"]);
    display.wait_until("the second animation", |screen| back.is_shown_on(screen));
    display.act(&["key", "Escape"]);
    ended(viewer);
}

/// All keys are steps, so that the moment is known while it plays. Pictures in motion are small.
#[test]
fn the_moment_that_is_seen_is_saved_in_full() {
    let steps = |model: &mut Value| {
        for animation in model["animations"].as_array_mut().unwrap() {
            let samplers = animation["samplers"].as_array_mut().unwrap();
            samplers.iter_mut().for_each(|sampler| sampler["interpolation"] = json!("STEP"));
        }
    };
    let (directory, display) = (with_model(true, steps), Display::start(640, 480));
    let (at_rest, moment) = (rendered(directory.path(), &[]), rendered(directory.path(), &["--at", "1", "--spp", "1"]));
    let viewer = player(directory.path(), &display, &["--budget-ms", "1"]);
    display.wait_until("the file at rest", |screen| at_rest.is_shown_on(screen));
    seen(&display, &["key", "space"]);
    let before = display.screen();
    assert!(!moment.is_shown_on(&before), "the picture in motion is small");
    display.act(&["key", "s"]);
    let saved = directory.path().join("moving-001.png");
    display.wait_until("that it has saved", |_| saved.exists());
    assert!(Screen::load(&saved) == moment);
    display.act(&["key", "Escape"]);
    ended(viewer);
}

/// Returns the pixels where the time line would be, beside the panel.
fn lower_edge(screen: &Screen) -> Vec<[u8; 3]> {
    (300..352).flat_map(|y| screen.pixels[y * screen.width..][340..464].to_vec()).collect()
}

#[test]
fn what_has_no_animations_has_no_time_line() {
    let still = |model: &mut Value| drop(model.as_object_mut().unwrap().remove("animations"));
    for (change, more, has_one) in
        [(None, &[][..], true), (None, &["--animation", "none"], false), (Some(still as fn(&mut Value)), &[], false)]
    {
        let directory = with_model(false, |model| change.into_iter().for_each(|change| change(model)));
        let display = Display::start(640, 480);
        let viewer = player(directory.path(), &display, more);
        let picture = rendered(directory.path(), more);
        display.wait_until("the picture", |screen| picture.is_shown_on(screen));
        seen(&display, &["key", "Tab"]);
        assert_eq!(lower_edge(&display.screen()) != lower_edge(&picture), has_one, "{more:?}");
        display.act(&["key", "Tab"]);
        display.wait_until("the picture", |screen| picture.is_shown_on(screen));
        if !has_one {
            display.act(&["key", "space"]);
            thread::sleep(Duration::from_millis(500));
            display.wait_until("the picture as before", |screen| picture.is_shown_on(screen));
        }
        display.act(&["key", "Escape"]);
        assert_eq!(stderr(&ended(viewer)), "");
    }
}
