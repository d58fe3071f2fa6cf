//! Tests of `kdray render` with several scenes, and of its time limit.

use std::{fs, io::Write, path::Path, process::Stdio};

use crate::support::command::{cornell, fail, kdray, names, stderr, stdout, succeed};
use tempfile::TempDir;

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
const SMALL: [&str; 4] = ["--cpu", "--size", "16x12", "--spp"];

/// Creates the scenes `a/x.obj`, `b/x.obj` and `b/y.obj`, the broken `bad.obj`, and the folder `out`.
fn with_scenes() -> TempDir {
    let directory = TempDir::new().unwrap();
    let path = |name: &str| directory.path().join(name);
    ["a", "b", "out"].iter().for_each(|folder| fs::create_dir(path(folder)).unwrap());
    ["a/x.obj", "b/x.obj", "b/y.obj"].iter().for_each(|scene| fs::write(path(scene), TRIANGLE).unwrap());
    fs::write(path("bad.obj"), "f 1 2 3\n").unwrap();
    directory
}

fn render<'a>(scenes: &[&'a str], more: &[&'a str]) -> Vec<&'a str> {
    [&["render"], scenes, &SMALL, &["1"], more].concat()
}

/// Scenes of one name get pictures of different names, in any order.
#[test]
fn each_scene_has_a_picture_of_its_own() {
    let directory = with_scenes();
    let path = directory.path();
    for scenes in [["a/x.obj", "b/x.obj", "b/y.obj"], ["b/y.obj", "b/x.obj", "a/x.obj"]] {
        let output = succeed(path, &render(&scenes, &["-o", "out/"]));
        assert_eq!(names(&path.join("out")), ["a-x.obj.png", "b-x.obj.png", "y.png"]);
        let text = stdout(&output);
        let lines: Vec<_> = text.lines().collect();
        for (line, scene) in lines.iter().zip(scenes) {
            assert!(line.starts_with(&format!("{scene}: 1 triangles, 16x12, 1 sample, ")), "{text}");
            assert!(line.contains(", wrote out/") && line.ends_with(".png"), "{text}");
        }
        assert_eq!((lines.len(), lines[3]), (4, "3 drawn, 0 failed"), "{text}");
        fs::remove_dir_all(path.join("out")).unwrap();
        fs::create_dir(path.join("out")).unwrap();
    }
    let output = succeed(path, &render(&["a/x.obj", "./a/x.obj"], &["-q", "-o", "out/{}-small.exr", "--aov", "cost"]));
    assert!(output.stdout.is_empty() && output.stderr.is_empty(), "{}{}", stdout(&output), stderr(&output));
    assert_eq!(names(&path.join("out")), ["x-small.cost.png", "x-small.exr"]);
    // A pattern of the shell may find a single file.
    succeed(path, &render(&["a/x.obj"], &["-o", "out"]));
    assert!(path.join("out/x.png").exists());
}

#[test]
fn a_scene_that_fails_does_not_stop_the_others() {
    let directory = with_scenes();
    let path = directory.path();
    let scenes = ["a/x.obj", "bad.obj", "none.obj", "b/y.obj"];
    let output = kdray(path, &render(&scenes, &["-o", "out/"])).output().unwrap();
    let (text, reports) = (stderr(&output), stdout(&output));
    assert_eq!(output.status.code(), Some(3), "{text}");
    let errors: Vec<_> = text.lines().filter(|line| line.starts_with("error: ")).collect();
    assert!(errors[0].starts_with("error: bad.obj") && errors[1].starts_with("error: none.obj: "), "{text}");
    assert_eq!((errors.len(), errors[2]), (3, "error: 2 drawn, 2 failed"), "{text}");
    assert_eq!(reports.lines().count(), 2, "{reports}");
    assert_eq!(names(&path.join("out")), ["x.png", "y.png"]);
    // Notes name the scene that they are about, once.
    fs::write(path.join("dark.toml"), "ambient = [0, 0, 0]\n[[mesh]]\nfile = 'a/x.obj'\n").unwrap();
    fs::write(
        path.join("up.stl"),
        "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n\
        endloop\nendfacet\nendsolid\n",
    )
    .unwrap();
    let text = stderr(&succeed(path, &render(&["dark.toml", "up.stl"], &["-o", "out/"])));
    assert!(text.lines().any(|line| line.starts_with("warning: dark.toml: nothing lights the scene")), "{text}");
    assert!(text.lines().any(|line| line.starts_with("note: up.stl: +z points up")), "{text}");
}

#[test]
fn a_list_names_scenes() {
    let directory = with_scenes();
    let path = directory.path();
    let list = "# all of b\nb/x.obj\r\n\n  \nb/y.obj\n";
    fs::write(path.join("list"), list).unwrap();
    succeed(path, &render(&["a/x.obj"], &["--list", "list", "-o", "out/"]));
    assert_eq!(names(&path.join("out")), ["a-x.obj.png", "b-x.obj.png", "y.png"]);
    let mut child = kdray(path, &render(&[], &["--list", "-", "-o", "out/", "--skip-existing"]))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(list.as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(stdout(&output).ends_with("1 drawn, 0 failed, 1 exist already\n"), "{}", stdout(&output));
    assert!(path.join("out/x.png").exists());
    fs::write(path.join("empty"), "# none\n").unwrap();
    let output = succeed(path, &render(&[], &["--list", "empty"]));
    assert_eq!(stdout(&output), "0 drawn, 0 failed\n");
    fail(path, &render(&[], &["--list", "absent"]), 3, "`absent`: cannot be read as a list of scenes");
}

#[test]
fn what_is_for_one_scene_is_refused() {
    let directory = with_scenes();
    let path = directory.path();
    ["list", "y.png"].iter().for_each(|list| fs::write(path.join(list), "a/x.obj\n").unwrap());
    let two = ["a/x.obj", "b/y.obj"];
    let refused = |more: &[&str], named: &str| fail(path, &render(&two, more), 2, named);
    refused(&["--path", "p.toml"], "--path is for a single scene");
    refused(&["--frames", "all"], "--frames is for a single scene");
    refused(&["--tile", "1/2"], "--tile is for a single scene");
    refused(&["--profile", "x.json"], "--profile is for a single scene");
    refused(&["--repeat", "2"], "--repeat is for a single scene");
    refused(&["-o", "x.png"], "--output `x.png` names one picture");
    refused(&["-o", "{}.jpg"], "jpg");
    refused(&["-o", "{}.png", "--list", "y.png"], "--output would overwrite `y.png`");
    fail(path, &render(&two, &["-o", "absent/"]), 5, "absent");
    fail(path, &render(&[], &["--list", "list", "-o", "x.png"]), 2, "--output `x.png` names one picture");
    assert_eq!(names(path), ["a", "b", "bad.obj", "list", "out", "y.png"]);
}

/// Renders a scene whose samples take longer than the limit.
fn limited(directory: &Path, limit: &str, scenes: &[&str], more: &[&str]) -> std::process::Output {
    let long = ["--cpu", "--size", "64x48", "--integrator", "path", "--spp", "65536", "--time-limit", limit];
    kdray(directory, &[&["render"], scenes, &long, more].concat()).output().unwrap()
}

#[test]
fn a_time_limit_ends_a_scene() {
    let directory = with_scenes();
    let path = directory.path();
    let scene = cornell();
    // On a busy machine, the first samples take longer than the shortest time.
    let limits = ["2s", "20s", "200s"];
    let drawn = limits.iter().map(|limit| limited(path, limit, &[&scene], &["-o", "out/x.exr"]));
    let output = drawn.into_iter().find(|output| output.status.success()).expect("a picture");
    let text = stderr(&output);
    assert!(text.contains("warning: the picture ends with the samples so far, since --time-limit 2"), "{text}");
    // The file states its number of samples, and is the picture of that number.
    let report = stdout(&output);
    let n_samples = report.split(" samples a pixel").next().unwrap().split(' ').next_back().unwrap();
    let arguments = ["--cpu", "--size", "64x48", "--integrator", "path", "--spp", n_samples, "-q", "-o", "y.exr"];
    succeed(path, &[&["render", &scene], &arguments[..]].concat());
    let pixels = |name: &str| crate::support::command::pixels(&path.join(name));
    assert!(pixels("out/x.exr") == pixels("y.exr"), "{n_samples}");

    fs::remove_file(path.join("out/x.exr")).unwrap();
    let output = limited(path, "1us", &["a/x.obj", &scene], &["-o", "out/"]);
    let text = stderr(&output);
    assert_eq!(output.status.code(), Some(3), "{text}");
    assert!(text.contains("error: a/x.obj: nothing was drawn within --time-limit 1us: it was still loading"), "{text}");
    assert!(text.ends_with("error: 0 drawn, 2 failed\n") && names(&path.join("out")).is_empty(), "{text}");
}

/// A structure whose build takes long is given up, and what goes on does not keep the next scene from its threads.
#[test]
fn a_scene_that_takes_too_long_does_not_stop_the_others() {
    let directory = with_scenes();
    let path = directory.path();
    let sphere = "[[mesh]]\ngenerator = 'sphere'\nradius = 1\ntriangles = N\n";
    fs::write(path.join("large.toml"), sphere.replace('N', "4000000")).unwrap();
    // On a busy machine, the small scene takes seconds, too.
    let output = ["1s", "3s", "9s"].iter().map(|limit| {
        let limited = ["--build", "best", "--time-limit", limit, "-o", "out/"];
        kdray(path, &render(&["large.toml", "a/x.obj"], &limited)).output().unwrap()
    });
    let mut texts = output.map(|output| (output.status.code(), stderr(&output)));
    let is_as_expected = |(code, text): (Option<i32>, String)| {
        let error = "error: large.toml: nothing was drawn within --time-limit ";
        code == Some(3) && text.starts_with(error) && text.ends_with("error: 1 drawn, 1 failed\n")
    };
    assert!(texts.any(is_as_expected));
    assert_eq!(names(&path.join("out")), ["x.png"]);
}
