//! Tests the messages of the command: each warning appears once, and names from files are printed without control
//! characters.

use std::{fs, path::Path, process::Output};

use base64::{Engine, engine::general_purpose::STANDARD};

use crate::support::command::{cornell, kdray, stderr, stdout, succeed};
use tempfile::TempDir;

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

/// Renders a small picture of a scene with the given text on the CPU.
fn render(directory: &Path, name: &str, text: &str) -> Output {
    fs::write(directory.join(name), text).unwrap();
    succeed(directory, &["render", name, "--cpu", "--size", "16x12", "-o", "x.png"])
}

fn warnings(output: &Output) -> Vec<String> {
    stderr(output).lines().filter(|line| line.starts_with("warning: ")).map(str::to_owned).collect()
}

#[test]
fn a_scene_that_nothing_lights_is_named_once() {
    let directory = TempDir::new().unwrap();
    let disc = "[[mesh]]\ngenerator = 'disc'\nradius = 1\nsegments = 8\n";
    let light = "[[light]]\nkind = 'directional'\ndirection = [-1, -2, -1]\nirradiance = [1, 1, 1]\n";
    let off = light.replace("[1, 1, 1]", "[0, 0, 0]");
    let shining = format!("ambient = [0, 0, 0]\nmaterials.m = {{ Ke = [1, 1, 1] }}\n{disc}material = 'm'\n");
    let emitter = format!("{shining}[render]\nintegrator = 'whitted'\n");
    let black = format!("ambient = [0, 0, 0]\n{disc}");
    for (text, emits) in [(&black, false), (&format!("{disc}{off}"), false), (&emitter, true)] {
        let told = warnings(&render(directory.path(), "dark.toml", text));
        let [line] = &told[..] else { panic!("{text}: {told:?}") };
        for part in ["dark.toml: nothing lights the scene", "[[light]]", "ambient = [0.3, 0.3, 0.3]", "irradiance"] {
            assert!(line.contains(part), "{line}");
        }
        assert_eq!(line.contains("Ke"), emits, "{line}");
    }
    let ambient = format!("ambient = [0.3, 0.3, 0.3]\n{disc}");
    for (name, text) in [
        ("a.toml", &shining[..]),
        ("a.toml", &ambient[..]),
        ("a.toml", &format!("{disc}{light}")),
        ("a.toml", disc),
        ("a.obj", TRIANGLE),
    ] {
        let told = warnings(&render(directory.path(), name, text));
        assert!(told.is_empty(), "{text}: {told:?}");
    }
    let quiet = ["render", "dark.toml", "--cpu", "-q", "--size", "16x12", "-o", "x.png"];
    assert!(succeed(directory.path(), &quiet).stderr.is_empty());
}

/// Renders a square with sides of one metre in UTM coordinates, where y is rounded to half metres.
#[test]
fn coordinates_far_from_the_origin_are_named_once() {
    let directory = TempDir::new().unwrap();
    let square = |x: f64, y: f64, side: f64| {
        let corners = [(x, y), (x + side, y), (x + side, y + side), (x, y + side)];
        corners.map(|(x, y)| format!("v {x} {y} 0\n")).concat() + "f 1 2 3 4\n"
    };
    let notes = |output: &Output| -> Vec<String> {
        assert!(warnings(output).is_empty(), "{:?}", warnings(output));
        let lines = stderr(output);
        lines.lines().filter(|line| line.contains("coordinates are large")).map(str::to_owned).collect()
    };
    let told = notes(&render(directory.path(), "utm.obj", &square(5e5, 5.2e6, 1.0)));
    let [line] = &told[..] else { panic!("{told:?}") };
    for part in ["note: utm.obj: ", "around [500001.0, 5200001.0, 0.0] of the file"] {
        assert!(line.contains(part), "{line}");
    }
    // From a distance of 256 times the extent, single precision has fewer than 2^16 steps across the scene.
    for (x, n_notes) in [(0.0, 0), (200.0, 0), (-200.0, 0), (256.0, 1), (-300.0, 1)] {
        let told = notes(&render(directory.path(), "a.obj", &square(x, 0.0, 1.0)));
        assert_eq!(told.len(), n_notes, "{x}: {told:?}");
    }
    assert!(warnings(&succeed(directory.path(), &["inspect", &cornell()])).is_empty());
}

/// Names of files and materials contain characters that would clear a terminal, set its title, forge a line or
/// reverse text.
#[test]
fn control_characters_never_reach_the_terminal() {
    let directory = TempDir::new().unwrap();
    let path = |name: &str| directory.path().join(name);
    let evil = "a\u{1b}[2J\u{7}\u{9b}31m\u{202e}b";
    let mesh = format!("mtllib {evil}.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl {evil}\nevil\u{1b}[2J 1\nf 1 2 3\n");
    fs::write(path(&format!("{evil}.obj")), mesh).unwrap();
    let material = "\"a\\u001b[2J\\nerror: forged\\u0007\"";
    let scene = format!(
        "materials.{material} = {{ Kd = [1, 1, 1] }}\n[[mesh]]\nfile = '{evil}.obj'\n[[mesh]]\n\
         generator = 'disc'\nradius = 1\nsegments = 8\nmaterial = {material}\n"
    );
    // TOML allows control characters in strings only as escapes.
    let escape = |c: char| if c.is_control() && c != '\n' { format!("\\u{:04x}", c as u32) } else { c.to_string() };
    let scene: String = scene.replace('\'', "\"").chars().map(escape).collect();
    fs::write(path(&format!("{evil}.toml")), scene).unwrap();
    let (obj, toml, none) = (format!("{evil}.obj"), format!("{evil}.toml"), format!("{evil}none.toml"));
    let picture = format!("{evil}.png");
    let cases: [(&[&str], i32); 6] = [
        (&["render", &toml, "--cpu", "--size", "16x12", "-o", &picture], 0),
        (&["inspect", &toml], 0),
        (&["inspect", &obj], 0),
        (&["render", &none, "--cpu"], 3),
        (&["render", &toml, "--cpu", "-o", &none], 2),
        (&["cast", &obj, &none, "-o", "x.npz", "--cpu"], 3),
    ];
    for (arguments, code) in cases {
        let output = kdray(directory.path(), arguments).output().unwrap();
        let text = stderr(&output) + &stdout(&output);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {}", text.escape_debug());
        let is_raw = |c: char| (c.is_control() && c != '\n') || c == '\u{202e}';
        assert!(!text.contains(is_raw) && text.contains("\\u{1b}[2J"), "{arguments:?}: {}", text.escape_debug());
        assert!(!text.lines().any(|line| line.starts_with("error: forged")), "{arguments:?}: {text}");
    }
}

#[test]
fn a_missing_mesh_is_reported_with_the_scene_s_line() {
    let directory = TempDir::new().unwrap();
    fs::write(directory.path().join("a.toml"), "ambient = [1, 1, 1]\n\n[[mesh]]\nfile = 'parts/none.obj'\n").unwrap();
    let output = kdray(directory.path(), &["render", "a.toml", "--cpu", "-q"]).output().unwrap();
    let text = stderr(&output);
    assert!(text.starts_with("error: a.toml:3: mesh 1: parts/none.obj: cannot be read"), "{text}");
}

/// Only where culling changes the picture, a warning tells of it.
#[test]
fn back_faces_that_the_camera_does_not_see_are_told() {
    let directory = TempDir::new().unwrap();
    let corners: Vec<u8> = [-1_f32, -1.0, 0.0, 1.0, -1.0, 0.0, 0.0, 1.0, 0.0].map(f32::to_le_bytes).concat();
    let data = STANDARD.encode(corners);
    let gltf = format!(
        r#"{{"asset": {{"version": "2.0"}}, "scenes": [{{"nodes": [0]}}], "nodes": [{{"mesh": 0}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}}}]}}],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
            "min": [-1, -1, 0], "max": [1, 1, 0]}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 36}}],
        "buffers": [{{"byteLength": 36, "uri": "data:application/octet-stream;base64,{data}"}}]}}"#
    );
    fs::write(directory.path().join("a.gltf"), gltf).unwrap();
    let told = |eye: &str, cull: &str| {
        let picture = ["--cpu", "--size", "16x12", "-o", "x.png", "--target", "0,0,0"];
        let arguments = [&["render", "a.gltf", "--eye", eye, "--cull", cull], &picture[..]].concat();
        warnings(&succeed(directory.path(), &arguments)).join("\n")
    };
    let behind = told("0,0,-4", "auto");
    assert!(behind.contains("pass through back faces of materials that are not doubleSided; --cull off"), "{behind}");
    assert!(behind.contains("0 of 768 rays of the camera meet a surface"), "{behind}");
    assert_eq!([told("0,0,-4", "off"), told("0,0,4", "auto"), told("0,0,4", "off")], ["", "", ""]);
}

/// The camera's rays tell before anything is drawn.
#[test]
fn a_picture_that_lacks_what_it_should_show_is_told() {
    let directory = TempDir::new().unwrap();
    let told = |text: &str| warnings(&render(directory.path(), "m.toml", text)).join("\n");
    let disc = "ambient = [1, 1, 1]\n[[mesh]]\ngenerator = 'disc'\nradius = 1\nsegments = 8\n";
    let away = "[camera]\neye = [0, 5, 0]\ntarget = [0, 9, 1]\n";
    let empty = told(&format!("{away}{}", disc.replace("ambient = [1, 1, 1]\n", "")));
    assert!(empty.contains("0 of 768 rays of the camera meet a surface: --eye and --target"), "{empty}");
    assert_eq!(told(disc), "");
    let line = "v 0 0 0\nv 1 1 1\nv 2 2 2\nf 1 2 3\n";
    let flat = warnings(&render(directory.path(), "line.obj", line)).join("\n");
    assert!(flat.contains("no triangle has an area"), "{flat}");
    let panes = |n: usize, opacity: f32| {
        let pane = |ix: usize| {
            format!(
                "[[mesh]]\ngenerator = 'disc'\nradius = 1\nsegments = 8\nmaterial = 'pane'\n\
                 transform = {{ translate = [0, {}, 0] }}\n",
                0.001 * ix as f32
            )
        };
        let panes: String = (0..n).map(pane).collect();
        told(&format!("ambient = [1, 1, 1]\nmaterials.pane = {{ d = {opacity} }}\n{panes}"))
    };
    // Rays have five levels, and pass 32 panes beside.
    assert_eq!(panes(36, 0.5), "");
    let hidden = panes(39, 0.5);
    assert!(hidden.contains("meet 37 see-through surfaces or more") && hidden.contains("--max-depth 8"), "{hidden}");
    assert_eq!(panes(39, 1.0), "", "opaque ones hide what they should");
    assert_eq!(panes(39, 0.001), "", "clear ones are not there");
}
