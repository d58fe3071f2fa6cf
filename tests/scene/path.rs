//! Tests of camera paths: closed forms of the curve between keyframes, and refused files.

use std::fs;

use glam::{Vec3, vec3};
use kdray::scene::{Camera, CameraPath, Projection};
use tempfile::TempDir;

fn load(text: &str) -> Result<CameraPath, String> {
    let directory = TempDir::new().unwrap();
    let path = directory.path().join("p.toml");
    fs::write(&path, text).unwrap();
    CameraPath::load(&path).map_err(|error| error.to_string())
}

/// Returns the text of a keyframe whose camera looks along -z.
fn key(when: &str, eye: Vec3, fov: f32) -> String {
    let Vec3 { x, y, z } = eye;
    format!("[[keyframe]]\n{when}\neye = [{x}, {y}, {z}]\ntarget = [{x}, {y}, {}]\nvertical_fov = {fov}\n", z - 1.0)
}

/// Returns the text of a keyframe whose camera is orthographic.
fn orthographic_key(when: &str, eye: Vec3, height: f32) -> String {
    key(when, eye, 1.0).replace("vertical_fov = 1\n", &format!("orthographic_height = {height}\n"))
}

fn at(path: &CameraPath, frame: f64) -> Camera {
    path.camera_at(frame).expect("a camera")
}

fn fov_at(path: &CameraPath, frame: f64) -> f32 {
    let Projection::Perspective { vertical_fov_degrees } = at(path, frame).projection else { panic!("a perspective") };
    vertical_fov_degrees
}

#[test]
fn keyframes_are_met_and_ends_stand_still() {
    let eyes = [vec3(0.0, 0.0, 0.0), vec3(1.0, 5.0, 2.0), vec3(-3.0, 2.0, 2.0), vec3(7.0, 7.0, 7.0)];
    let frames = [3.0, 10.0, 11.5, 40.0];
    let text: String = (0..4).map(|i| key(&format!("frame = {}", frames[i]), eyes[i], 30.0 + i as f32)).collect();
    let path = load(&text).unwrap();
    assert_eq!((path.begin(), path.end(), path.fps), (3.0, 40.0, 25.0));
    for (i, (frame, eye)) in frames.into_iter().zip(eyes).enumerate() {
        let camera = at(&path, frame);
        let Camera { target, up, .. } = camera;
        assert_eq!((camera.eye, target, up, fov_at(&path, frame)), (eye, eye - Vec3::Z, Vec3::Y, 30.0 + i as f32));
    }
    assert_eq!((at(&path, 0.0), at(&path, 99.0)), (at(&path, 3.0), at(&path, 40.0)));
}

/// Uniform motion stays uniform, even if the keyframes are at irregular frames.
#[test]
fn even_motion_stays_even() {
    let speed = vec3(0.5, -1.0, 0.25);
    let text: String = [0.0, 1.0, 10.0, 14.0, 30.0]
        .map(|frame: f32| key(&format!("frame = {frame}"), frame * speed, 20.0 + frame))
        .concat();
    let path = load(&text).unwrap();
    for i in 0..=300 {
        let frame = f64::from(i) / 10.0;
        let camera = at(&path, frame);
        assert!((camera.eye - frame as f32 * speed).abs().max_element() < 1e-4, "{frame}: {}", camera.eye);
        assert!((fov_at(&path, frame) - 20.0 - frame as f32).abs() < 1e-4);
    }
}

/// Keyframes of an orthographic camera are met. In between, equal times change its scale by equal factors.
#[test]
fn an_orthographic_picture_is_magnified_evenly() {
    let text: String = (0..4)
        .map(|i| orthographic_key(&format!("frame = {}", 10 * i), Vec3::X * i as f32, 3.0 * 0.5_f32.powi(i)))
        .collect();
    let path = load(&text).unwrap();
    for frame in 0..=30 {
        let height = at(&path, f64::from(frame)).height_at(7.0);
        let expected = 3.0 * 0.5_f32.powf(frame as f32 / 10.0);
        assert!((height / expected - 1.0).abs() < 1e-5, "{frame}: {height}");
        assert!(frame % 10 != 0 || height == expected, "{frame}: {height}");
    }
}

/// Speed has no jumps, and so the position has none either.
#[test]
fn uneven_motion_is_smooth() {
    let eyes = [vec3(0.0, 0.0, 0.0), vec3(4.0, 1.0, 2.0), vec3(4.0, -3.0, 2.0), vec3(-5.0, 7.0, 0.0)];
    let text: String = (0..4).map(|i| key(&format!("frame = {}", 7 * i * i), eyes[i], 45.0)).collect();
    let path = load(&text).unwrap();
    let step = 0.01;
    let speed = |frame: f64| (at(&path, frame + step).eye - at(&path, frame - step).eye) / (2.0 * step as f32);
    for i in 100..6200 {
        let frame = f64::from(i) / 100.0;
        assert!((speed(frame + step) - speed(frame)).length() < 0.01, "a jump at {frame}");
    }
    // Catmull and Rom's slope at the second keyframe is the one from the first to the third keyframe.
    assert!((speed(7.0) - eyes[2] / 28.0).length() < 2e-3);
}

#[test]
fn times_are_frames_by_the_rate() {
    let text = format!("fps = 10\n{}{}", key("time = 0.5", Vec3::ZERO, 45.0), key("time = 2", Vec3::X, 45.0));
    let path = load(&text).unwrap();
    assert_eq!((path.fps, path.begin(), path.end()), (10.0, 5.0, 20.0));
    let one = load(&key("frame = 8", Vec3::X, 45.0)).unwrap();
    assert_eq!((at(&one, 0.0), at(&one, 8.0)), (at(&one, 9.0), at(&one, 8.5)));
}

#[test]
fn a_way_through_nothing_is_told() {
    let through = "[[keyframe]]\nframe = 0\neye = [0, 0, -1]\ntarget = [0, 0, 0]\n\
                   [[keyframe]]\nframe = 2\neye = [0, 0, 1]\ntarget = [0, 0, 0]\n";
    let path = load(through).unwrap();
    assert!(path.camera_at(1.0).is_none() && path.camera_at(0.9).is_some());
}

#[test]
fn bad_files_are_refused() {
    let good = key("frame = 4", Vec3::ZERO, 45.0);
    for (text, place, what) in [
        (String::new(), "p.toml", "no [[keyframe]]"),
        ("[[keyframe]".to_owned(), "p.toml:1", ""),
        ("keyframes = 1\n".to_owned(), "p.toml:1", "keyframes"),
        (good.replace("frame = 4", ""), "p.toml:1", "keyframe 1: has neither `frame` nor `time`"),
        (good.replace("frame = 4", "frame = 4\ntime = 1"), "p.toml:1", "both"),
        (good.replace("frame = 4", "frame = -1"), "p.toml:1", "outside 0"),
        (good.replace("frame = 4", "frame = nan"), "p.toml:1", "outside 0"),
        (good.replace("frame = 4", "time = 1e300"), "p.toml:1", "outside 0"),
        (good.replace("frame = 4", "frame = 'x'"), "p.toml:2", "invalid type"),
        (format!("{good}{good}"), "p.toml:6", "keyframe 2: frame 4 does not come after"),
        (good.replace("= 45", "= 0"), "p.toml:1", "vertical_fov"),
        (format!("{good}orthographic_height = 1\n"), "p.toml:1", "both `vertical_fov` and `orthographic_height`"),
        (orthographic_key("frame = 4", Vec3::ZERO, 0.0), "p.toml:1", "orthographic_height = 0 is outside"),
        (
            format!("{good}{}", orthographic_key("frame = 5", Vec3::ZERO, 1.0)),
            "p.toml:6",
            "keyframe 2: orthographic_height: either all keyframes have it or none",
        ),
        (
            format!("{}{}", orthographic_key("frame = 3", Vec3::ZERO, 1.0), good),
            "p.toml:6",
            "keyframe 2: orthographic_height: either all keyframes have it or none",
        ),
        (good.replace("eye = [0, 0, 0]", "eye = [0, 0, -1]"), "p.toml:1", "span no picture"),
        (good.replace("eye = [0, 0, 0]", "eye = [0, inf, 0]"), "p.toml:1", "eye"),
        (good.replace("eye = [0, 0, 0]", "eye = [0, 0]"), "p.toml:3", ""),
        (format!("fps = 0\n{good}"), "p.toml:1", "fps"),
        (format!("fps = nan\n{good}"), "p.toml:1", "fps"),
        (format!("speed = 2\n{good}"), "p.toml:1", "speed"),
    ] {
        let error = load(&text).expect_err(&text);
        let (_, at_place) = error.split_once(&format!("/{place}: ")).unwrap_or_else(|| panic!("{error}: not {place}"));
        assert!(at_place.contains(what) && error.lines().count() == 1, "{error}: not {what}");
    }
}
