//! Tests that the files of a scene are read below their own folders only, unless the user allows more. strace tells
//! which files the command opens.

use std::{fs, os::unix::fs::symlink, path::Path, process::Command};

use crate::support::command::{kdray, stderr};
use serde_json::json;
use tempfile::TempDir;

const OBJ: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n";

/// Creates a folder `scene` beside a folder of files whose names begin with `secret`, and links to them in `scene`.
/// Their content is sound, so that a scene with them loads.
fn folders() -> TempDir {
    let directory = TempDir::new().unwrap();
    let path = |name: &str| directory.path().join(name);
    fs::create_dir_all(path("scene")).unwrap();
    fs::create_dir_all(path("outside")).unwrap();
    fs::write(path("outside/secret.obj"), OBJ).unwrap();
    fs::write(path("outside/secret.mtl"), "newmtl m\nKd 1 0 0\n").unwrap();
    fs::write(path("outside/secret.bin"), bytemuck::cast_slice::<f32, u8>(&[0., 0., 0., 1., 0., 0., 0., 1., 0.]))
        .unwrap();
    image::RgbaImage::from_pixel(2, 2, image::Rgba([9, 9, 9, 255])).save(path("outside/secret.png")).unwrap();
    for ending in ["obj", "mtl", "bin", "png"] {
        symlink(format!("../outside/secret.{ending}"), path(&format!("scene/link.{ending}"))).unwrap();
    }
    symlink("../outside", path("scene/up")).unwrap();
    fs::write(path("scene/own.obj"), OBJ).unwrap();
    fs::write(path("scene/x.png"), "an output that exists lets the command look up all files").unwrap();
    directory
}

/// A file in the folder `scene` whose text names another file as `NAME`.
struct Case {
    file: &'static str,
    text: String,
    ending: &'static str,
    /// Whether the other file is needed. If not, it is left out with a warning.
    is_needed: bool,
}

fn cases() -> Vec<Case> {
    let case = |file, ending, is_needed, text: &str| Case { file, text: text.to_owned(), ending, is_needed };
    let gltf = json!({
        "asset": { "version": "2.0" }, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3" }],
        "bufferViews": [{ "buffer": 0, "byteLength": 36 }], "buffers": [{ "uri": "NAME", "byteLength": 36 }],
    });
    let ply = "ply\nformat ascii 1.0\ncomment TextureFile NAME\nelement vertex 3\nproperty float x\nproperty float y\n\
               property float z\nproperty float u\nproperty float v\nelement face 1\n\
               property list uchar int vertex_indices\nend_header\n0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2\n";
    vec![
        case("s.toml", "obj", true, "[[mesh]]\nfile = 'NAME'\n"),
        case("s.toml", "png", true, "materials.m = { map_Kd = 'NAME' }\n[[mesh]]\nfile = 'own.obj'\nmaterial = 'm'\n"),
        case("s.gltf", "bin", true, &gltf.to_string()),
        case("s.obj", "mtl", false, &format!("mtllib NAME\n{OBJ}")),
        case("s.mtl", "png", false, "newmtl m\nmap_Kd NAME\n"),
        case("s.ply", "png", false, ply),
    ]
}

/// Renders a scene under strace. Returns the exit code, the messages and the calls that open files.
fn traced(folder: &Path, scene: &str, more: &[&str]) -> (Option<i32>, String, String) {
    let render = ["render", scene, "--cpu", "--size", "8x8", "-o", "x.png"];
    let plain = kdray(folder, &[&render, more].concat());
    let mut command = Command::new("strace");
    command.args(["-f", "-qq", "-s", "4096", "-e", "trace=open,openat,openat2", "-o", "../calls"]);
    command.arg(plain.get_program()).args(plain.get_args()).current_dir(folder).env("KDRAY_CACHE", "");
    let output = command.output().expect("./setup installs strace");
    let calls = fs::read_to_string(folder.join("../calls")).unwrap();
    (output.status.code(), stderr(&output), calls)
}

#[test]
fn files_outside_are_read_only_if_they_are_allowed() {
    for case in cases() {
        let directory = folders();
        let folder = directory.path().join("scene");
        let absolute = format!("{}/outside/secret.{}", directory.path().display(), case.ending);
        let beside = format!("../outside/secret.{}", case.ending);
        let (link, below_link) = (format!("link.{}", case.ending), format!("up/secret.{}", case.ending));
        for name in [&absolute, &beside, &link, &below_link] {
            let of_case = format!("{} names {name}", case.file);
            fs::write(folder.join(case.file), case.text.replace("NAME", name)).unwrap();
            let scene = if case.file == "s.mtl" { "s.obj" } else { case.file };
            if scene != case.file {
                fs::write(folder.join(scene), format!("mtllib s.mtl\n{OBJ}")).unwrap();
            }
            let (code, told, calls) = traced(&folder, scene, &[]);
            assert_eq!(code, Some(if case.is_needed { 3 } else { 0 }), "{of_case}: {told}");
            assert!(told.contains("--allow-outside") && told.contains(name), "{of_case}: {told}");
            assert!(calls.contains(case.file), "{of_case}: {calls}");
            let is_outside = |call: &&str| {
                call.contains("secret") || call.contains("link.") || call.contains("/up\"") || call.contains("\"up\"")
            };
            assert_eq!(calls.lines().find(is_outside), None, "{of_case}");
            let (code, told, calls) = traced(&folder, scene, &["--allow-outside"]);
            assert_eq!(code, Some(0), "{of_case}: {told}");
            assert!(!told.contains("not read") && calls.lines().any(|call| is_outside(&call)), "{of_case}: {told}");
        }
    }
}

#[test]
fn conversion_names_files_outside_only_if_they_are_allowed() {
    let directory = folders();
    let folder = directory.path().join("scene");
    let run = |arguments: &[&str]| {
        let output = kdray(&folder, arguments).output().unwrap();
        (output.status.code(), stderr(&output))
    };
    let (code, told) = run(&["convert", "../outside/secret.obj", "c.toml"]);
    assert!(code == Some(3) && told.contains("does not lie below") && told.contains("--allow-outside"), "{told}");
    assert!(!folder.join("c.toml").exists());
    let (code, told) = run(&["convert", "../outside/secret.obj", "c.toml", "--allow-outside"]);
    assert_eq!(code, Some(0), "{told}");
    assert!(fs::read_to_string(folder.join("c.toml")).unwrap().contains("file = \"../outside/secret.obj\""));
    assert_eq!(run(&["inspect", "c.toml"]).0, Some(3));
    assert_eq!(run(&["inspect", "c.toml", "--allow-outside"]).0, Some(0));
}
