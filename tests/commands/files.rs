//! Tests that an output is refused if another output or a file that is read has the same path.

use std::{fs, path::Path};

use crate::support::command::{fail, names};
use tempfile::TempDir;

const MESH: &str = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n";

/// Creates a scene with a mesh and its material library in a folder `in`, a link `link` to that folder, and rays and
/// a camera path beside it.
fn with_scene() -> TempDir {
    let directory = TempDir::new().unwrap();
    let path = |name: &str| directory.path().join(name);
    fs::create_dir(path("in")).unwrap();
    fs::write(path("in/scene.toml"), "ambient = [1, 1, 1]\n[[mesh]]\nfile = 'mesh.obj'\n").unwrap();
    fs::write(path("in/mesh.obj"), MESH).unwrap();
    fs::write(path("in/a.mtl"), "newmtl m\nKd 1 0 0\n").unwrap();
    fs::write(path("path.toml"), "[[keyframe]]\nframe = 0\neye = [0, 0, 5]\ntarget = [0, 0, 0]\n").unwrap();
    fs::write(path("rays.npy"), "no rays, but that comes later").unwrap();
    directory
}

fn contents(directory: &Path) -> Vec<Vec<u8>> {
    ["in/scene.toml", "in/mesh.obj", "in/a.mtl", "path.toml", "rays.npy"]
        .map(|name| fs::read(directory.join(name)).unwrap())
        .to_vec()
}

/// Asserts that each command is refused with exit code 2 and an error line that contains the words, before any file
/// is read or written.
fn assert_refused(directory: &Path, cases: &[(&[&str], &str)]) {
    let (names_before, before) = (names(directory), contents(directory));
    for (arguments, words) in cases {
        fail(directory, arguments, 2, words);
    }
    assert_eq!((names(directory), contents(directory)), (names_before, before));
}

#[test]
fn one_file_by_two_spellings_is_no_two_outputs() {
    let directory = with_scene();
    let scene = "in/scene.toml";
    let cases: &[(&[&str], &str)] = &[
        (&["render", scene, "-o", "a.png", "--profile", "./a.png"], "--output and --profile name the same file"),
        (&["render", scene, "-o", "in/a.png", "--trace", "in/../in/a.png"], "--output and --trace name the same file"),
        (&["render", scene, "--profile", "scene.png"], "--output and --profile name the same file"),
        (&["render", scene, "-o", "a.png", "--aov", "cost", "--profile", "a.exr"], "--aov and --profile"),
        (&["render", scene, "-o", "a.png", "--aov", "cost", "--trace", "./a.cost.png"], "--aov and --trace"),
        (&["render", scene, "--profile", "x.json", "--trace", "./x.json"], "--profile and --trace"),
        (&["cast", scene, "rays.npy", "-o", "x.npz", "--json", "./x.npz"], "--output and --json name the same file"),
        (
            &["view", scene, "--frames", "1", "--screenshot", "a.png", "--profile", "./a.png"],
            "--screenshot and --profile name the same file",
        ),
        (&["bench", "traversal", scene, "--cpu", "--json", "x", "--svg", "./x"], "--json and --svg"),
    ];
    assert_refused(directory.path(), cases);
    let path = ["render", scene, "--cpu", "--path", "path.toml", "-o", "a.##.png", "--profile", "a.00.png"];
    fail(directory.path(), &path, 2, "--profile and --output name the same file");
}

#[test]
fn what_is_read_is_not_overwritten() {
    let directory = with_scene();
    let (scene, is_read) = ("in/scene.toml", "which is read as");
    let cases: &[(&[&str], &str)] = &[
        (&["render", scene, "--profile", "in/../in/scene.toml"], "is read as SCENE"),
        (&["render", scene, "--profile", "in/mesh.obj"], "which is read as a part of `in/scene.toml`"),
        (&["render", scene, "--trace", "in/./a.mtl"], is_read),
        (&["render", scene, "--path", "path.toml", "--profile", "./path.toml"], "is read as --path"),
        (&["cast", scene, "rays.npy", "-o", "x.npz", "--json", "./rays.npy"], "is read as RAYS"),
        (&["cast", "in/mesh.obj", "rays.npy", "-o", "x.npz", "--json", "./in/mesh.obj"], "is read as MESH"),
        (&["cast", "in/mesh.obj", "rays.npy", "-o", "x.npz", "--json", "in/a.mtl"], is_read),
        (&["view", scene, "--profile", "./in/scene.toml"], "is read as SCENE"),
        (&["bench", "traversal", scene, "--cpu", "--json", "in/mesh.obj"], is_read),
        (&["bench", "paper", "--scenes", "in", "--json", "in/cornell.toml"], is_read),
    ];
    assert_refused(directory.path(), cases);
    assert_eq!(names(directory.path()), ["in", "path.toml", "rays.npy"]);
}

#[cfg(unix)]
#[test]
fn links_are_followed_to_what_they_name() {
    use std::os::unix::fs::symlink;
    let directory = with_scene();
    let path = |name: &str| directory.path().join(name);
    symlink("in", path("link")).unwrap();
    symlink("link/scene.toml", path("to_scene.png")).unwrap();
    symlink("rays.npy", path("hits.npz")).unwrap();
    symlink("new.json", path("dangling.png")).unwrap();
    let scene = "in/scene.toml";
    let cases: &[(&[&str], &str)] = &[
        (&["render", scene, "-o", "to_scene.png"], "is read as SCENE"),
        (&["render", "link/scene.toml", "--profile", "in/scene.toml"], "is read as SCENE"),
        (&["render", scene, "--profile", "link/mesh.obj"], "is read as a part of"),
        (&["cast", scene, "rays.npy", "-o", "hits.npz"], "is read as RAYS"),
        (&["render", scene, "-o", "dangling.png", "--profile", "new.json"], "--output and --profile"),
    ];
    assert_refused(directory.path(), cases);
}
