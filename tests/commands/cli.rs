//! Tests the `kdray` command: exit codes, one-line errors, files and closed pipes.

use std::{
    fs,
    path::Path,
    process::{Command, Output},
};

use crate::support::command::{COMPLAINTS, cornell, fail, kdray, names, pixels, stderr, stdout, succeed};
use serde_json::Value;
use tempfile::TempDir;

#[test]
fn usage_mistakes_are_refused_before_the_scene_is_read() {
    let directory = TempDir::new().unwrap();
    let cases: &[(&[&str], &str)] = &[
        (&[], "subcommand"),
        (&["rendre"], "rendre"),
        (&["render"], "SCENE"),
        (&["render", ""], "SCENE"),
        (&["render", "none.toml", "--sice", "1x1"], "--sice"),
        (&["render", "none.toml", "--size", "640"], "640"),
        (&["render", "none.toml", "--size", "0x480"], "0x480"),
        (&["render", "none.toml", "--size", "640x99999"], "640x99999"),
        (&["render", "none.toml", "--size", "-1x2"], "-1"),
        (&["render", "none.toml", "--max-depth", "0"], "--max-depth"),
        (&["render", "none.toml", "--max-depth", "65"], "1..=64"),
        (&["render", "none.toml", "--denoise", "median"], "median"),
        (&["render", "none.toml", "--denoise-threshold", "nan"], "--denoise-threshold"),
        (&["render", "none.toml", "--denoise", "off", "--denoise-threshold", "1"], "--denoise off"),
        (&["render", "none.toml", "--denoise", "edge", "--denoise-threshold", "1"], "--denoise edge"),
        (&["render", "none.toml", "--exposure", "0"], "--exposure"),
        (&["render", "none.toml", "--exposure", "inf"], "--exposure"),
        (&["render", "none.toml", "--tonemap", "film"], "linear, agx, aces, neutral"),
        (&["render", "none.toml", "--spp", "0"], "--spp"),
        (&["render", "none.toml", "--up", "x"], "y, z, auto"),
        (&["render", "none.toml", "--eye", "1,2"], "three numbers"),
        (&["render", "none.toml", "--eye", "1,2,3", "--camera", "0"], "--camera"),
        (&["render", "none.toml", "--target", "1,2,nan"], "three numbers"),
        (&["render", "none.toml", "--fov", "180"], "0.1 to 170"),
        (&["render", "none.toml", "--light", "0,0,0"], "no direction"),
        (&["convert", "none.obj", "a.toml", "--light", "off"], "or none"),
        (&["render", "none.toml", "--background", "0,-1,0"], "below 0"),
        (&["render", "none.toml", "--spp", "2", "--trace", "x.json"], "single sample"),
        (&["render", "none.toml", "--crop", "1,2,3"], "x0,y0,x1,y1"),
        (&["render", "none.toml", "--crop", "5,2,5,9"], "x0 must be less than x1"),
        (&["render", "none.toml", "--aov", "depth,colour"], "depth, normal, position"),
        (&["render", "none.toml", "--frames", "some"], "expected all"),
        (&["render", "none.toml", "--turntable", "4", "--frames", "2-4"], "a turn of 4 frames has no frame 4"),
        (&["render", "none.toml", "--turntable", "0"], "--turntable"),
        (&["render", "none.toml", "--at", "nan"], "expected a number of seconds"),
        (&["render", "none.toml", "--frame", "2", "--fps", "0"], "frames a second above 0"),
        (&["render", "none.toml", "--frame", "2", "--at", "1"], "cannot be used with"),
        (&["render", "none.toml", "--path", "p.toml", "--frames", "2-1"], "comes after the last"),
        (&["render", "none.toml", "--path", "p.toml", "--repeat", "2"], "--repeat"),
        (&["render", "none.toml", "--path", "p.toml", "-o", "x.exr"], "####"),
        (&["render", "none.toml", "--path", "p.toml", "-o", "x.gif", "--aov", "depth"], "a file for each frame"),
        (&["render", "none.toml", "--path", "p.toml", "-o", "x#.#.png"], "more than one"),
        (&["render", "none.toml", "--traversal", "bvh"], "short-stack, "),
        (&["render", "none.toml", "--accel", "bvh"], "kdtree, grid, grid2"),
        (
            &["render", "none.toml", "--accel", "grid", "--traversal", "mask"],
            "--traversal names an algorithm for the kd-tree",
        ),
        (&["render", "none.toml", "--accel", "grid2", "--build", "best"], "--build chooses a kd-tree"),
        (
            &["bench", "size", "--accel", "grid2", "--traversal", "mask"],
            "--traversal names an algorithm for the kd-tree",
        ),
        (&["bench", "traversal", "none.obj", "--variants", "grid3"], "grid, grid2"),
        (&["render", "none.toml", "--primary", "rays"], "raster, software-raster, trace"),
        (&["render", "none.toml", "--threads", "0"], "--threads"),
        (&["render", "none.toml", "--cpu", "--device", "0"], "--device"),
        (&["render", "none.toml", "--device", ""], "--device"),
        (&["render", "none.toml", "-o", "x.jpg"], "x.jpg"),
        (&["render", "none.toml", "-o", "x"], ".png"),
        (&["render", "none.toml", "-o", "x.png", "--profile", "x.png"], "same file"),
        (&["inspect"], "SCENE"),
        (&["convert", "none.obj"], "<OUT>"),
        (&["devices", "0"], "'0'"),
    ];
    for (arguments, named) in cases {
        fail(directory.path(), arguments, 2, named);
    }
    assert!(names(directory.path()).is_empty());
}

#[test]
fn a_scene_that_cannot_be_loaded_is_named() {
    let directory = TempDir::new().unwrap();
    fs::write(directory.path().join("broken.toml"), "triangles = [[[\n").unwrap();
    fs::write(directory.path().join("binary.toml"), [0xff, 0xfe, 0, 1, 2]).unwrap();
    fs::create_dir(directory.path().join("folder.toml")).unwrap();
    for scene in ["none.toml", "broken.toml", "binary.toml", "folder.toml", "two\nlines.toml"] {
        let named = scene.split('\n').next().unwrap();
        fail(directory.path(), &["render", scene, "--cpu", "-o", "x.png"], 3, named);
        fail(directory.path(), &["inspect", scene], 3, named);
        fail(directory.path(), &["inspect", scene, "--json"], 3, named);
    }
    assert_eq!(names(directory.path()), ["binary.toml", "broken.toml", "folder.toml"]);
}

#[test]
fn a_device_that_is_not_there_is_named() {
    let directory = TempDir::new().unwrap();
    fail(directory.path(), &["render", &cornell(), "-q", "--device", "99"], 4, "99");
    fail(directory.path(), &["render", &cornell(), "-q", "--device", "abacus"], 4, "abacus");
    assert!(names(directory.path()).is_empty());
}

/// The tests run on software drivers, which are not GPUs.
#[test]
fn a_gpu_can_be_required() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    let scene = cornell();
    // What needs no GPU is not read.
    for scene in [&scene, "none.toml"] {
        for more in [&[][..], &["--device", "0"], &["--device", "all"]] {
            let arguments = [&["render", scene, "-o", "x.png", "--require", "gpu"], more].concat();
            fail(path, &arguments, 4, "is a software driver");
        }
    }
    fail(path, &["render", &scene, &scene, "--require", "gpu"], 4, "is a software driver");
    fs::write(path.join("rays.npy"), "").unwrap();
    let cast = ["cast", &scene, "rays.npy", "-o", "x.npz", "--require", "gpu"];
    fail(path, &cast, 4, "--require gpu: no usable GPU found: ");
    fail(path, &[&cast[..], &["--device", "0"]].concat(), 4, "is a software driver");
    fail(path, &["render", &scene, "--require", "gpu", "--cpu"], 2, "--cpu");
    fail(path, &["render", &scene, "--require", "tpu"], 2, "gpu");
    assert_eq!(names(path), ["rays.npy"]);
}

#[test]
fn a_machine_without_a_driver_is_told_so() {
    let directory = TempDir::new().unwrap();
    for arguments in [&["devices"][..], &["render", &cornell(), "-q"]] {
        let output = kdray(directory.path(), arguments)
            .env("VK_DRIVER_FILES", "/dev/null")
            .env("VK_ICD_FILENAMES", "/dev/null")
            .output()
            .unwrap();
        let text = stderr(&output);
        assert_eq!(output.status.code(), Some(4), "{arguments:?}: {text}");
        assert_eq!(text.lines().filter(|line| line.starts_with("error: ")).count(), 1, "{text}");
    }
}

#[test]
fn a_file_that_cannot_be_written_is_named_before_rendering() {
    let directory = TempDir::new().unwrap();
    fs::write(directory.path().join("file"), "kept").unwrap();
    fs::create_dir(directory.path().join("folder.png")).unwrap();
    for path in ["none/x.png", "file/x.exr", "folder.png"] {
        fail(directory.path(), &["render", "none.toml", "--cpu", "-o", path], 5, path);
    }
    fail(directory.path(), &["render", "none.toml", "--cpu", "--profile", "none/x.json"], 5, "none/x.json");
    assert_eq!(names(directory.path()), ["file", "folder.png"]);
}

#[test]
fn help_and_version() {
    let directory = TempDir::new().unwrap();
    for arguments in [&["--help"][..], &["help", "render"], &["render", "--help"], &["inspect", "-h"], &["-V"]] {
        let output = succeed(directory.path(), arguments);
        assert!(stdout(&output).contains("kdray") && stderr(&output).is_empty(), "{arguments:?}");
    }
    let help = stdout(&succeed(directory.path(), &["render", "--help"]));
    for word in ["--spp", "--crop", "--aov", "- agx: ", "--path"] {
        assert!(help.contains(word), "{word}");
    }
    for word in ["--size", "--max-depth", "- mask-boxes: ", "- software-raster: ", "paper", "--validate", "SCENE"] {
        assert!(help.contains(word), "{word}");
    }
}

#[test]
fn devices_lists_what_there_is() {
    let directory = TempDir::new().unwrap();
    let text = stdout(&succeed(directory.path(), &["devices"]));
    let mut lines = text.lines();
    assert!(lines.next().unwrap().starts_with("device"));
    assert!(lines.next().unwrap().starts_with('0'), "{text}");
}

#[test]
fn inspect_describes_the_scene_and_its_tree() {
    let directory = TempDir::new().unwrap();
    let text = stdout(&succeed(directory.path(), &["inspect", &cornell()]));
    let json: Value =
        serde_json::from_slice(&succeed(directory.path(), &["inspect", &cornell(), "--json"]).stdout).unwrap();
    let tree = &json["tree"];
    assert!(tree["n_nodes"].as_u64() >= tree["n_leaves"].as_u64() && tree["n_leaves"].as_u64() >= Some(1));
    let of_materials = json["materials"].as_array().unwrap().iter().map(|used| used["triangles"].as_u64().unwrap());
    assert_eq!(Some(of_materials.sum::<u64>()), json["triangles"].as_u64());
    for material in json["materials"].as_array().unwrap() {
        assert!(text.contains(material["name"].as_str().unwrap()), "{text}");
    }
    for row in ["nodes", "leaves", "empty leaves", "depth", "references a triangle", "SAH cost", "bytes", "build ms"] {
        assert!(text.lines().any(|line| line.starts_with(row)), "{row}: {text}");
    }
}

#[test]
fn inspect_tells_which_light_is_chosen() {
    let directory = TempDir::new().unwrap();
    let write = |name: &str, content: &str| fs::write(directory.path().join(name), content).unwrap();
    let lighting = |name: &str| {
        let text = stdout(&succeed(directory.path(), &["inspect", name]));
        let json = succeed(directory.path(), &["inspect", name, "--json"]).stdout;
        let row = text.lines().find(|line| line.starts_with("lights ")).unwrap().to_owned();
        (row, serde_json::from_slice::<Value>(&json).unwrap()["lighting"].clone())
    };
    write("m.obj", "mtllib m.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n");
    write("m.mtl", "newmtl m\nPm 1\nPr 0.1\n");
    let (row, json) = lighting("m.obj");
    assert!(row.ends_with("a main light and a second one from outside, chosen by kdray"), "{row}");
    assert_eq!((json["chosen"].as_str(), json["integrator"].as_str()), (Some("outside"), Some("whitted")));
    assert!(json["studio"].is_array() && json["ambient"][0].as_f64() > json["ambient_from_below"][0].as_f64());
    assert_eq!((json["exposure"].as_f64(), json["background"][1].as_f64().is_some()), (Some(1.0), true));
    write("m.toml", "ambient = [0.5, 0.5, 0.5]\n[[mesh]]\nfile = 'm.obj'\n");
    let (row, json) = lighting("m.toml");
    assert!(row.ends_with("as the file states") && json["chosen"].is_null(), "{row}");
    assert_eq!(json["ambient"], json["ambient_from_below"]);
    write("m.mtl", "newmtl m\nKe 9\n");
    let (row, json) = lighting("m.obj");
    assert!(row.ends_with("none, since surfaces that shine light the scene"), "{row}");
    assert_eq!((json["chosen"].as_str(), json["integrator"].as_str()), (Some("surfaces"), Some("path")));
    assert!(json["exposure"].is_null() && json["studio"].is_null());
    write("r.toml", "[[mesh]]\ngenerator = 'room'\nsize = [6, 3, 9]\n");
    let (row, json) = lighting("r.toml");
    assert!(row.ends_with("one in the middle and one at the eye, chosen by kdray"), "{row}");
    assert_eq!(json["chosen"].as_str(), Some("inside"));
}

/// Inspection counts the lights of paths, and tells whether a tree picks them.
#[test]
fn inspect_tells_how_paths_pick_lights() {
    let directory = TempDir::new().unwrap();
    let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    fs::write(directory.path().join("m.mtl"), "newmtl glow\nKe 1 1 1\n").unwrap();
    for (n, expected) in [(255, "table"), (256, "tree")] {
        let obj = format!("mtllib m.mtl\nusemtl glow\n{}", format!("{corners}f -3 -2 -1\n").repeat(n));
        fs::write(directory.path().join("m.obj"), obj).unwrap();
        fs::write(directory.path().join("s.toml"), "[[mesh]]\nfile = 'm.obj'\n").unwrap();
        let text = stdout(&succeed(directory.path(), &["inspect", "s.toml"]));
        let json = succeed(directory.path(), &["inspect", "s.toml", "--json"]).stdout;
        let lights = serde_json::from_slice::<Value>(&json).unwrap()["path_lights"].clone();
        // A scene without lights gets some, and a background.
        let n_others = lights["lights"].as_u64().unwrap() - n as u64;
        assert_eq!((n_others, lights["picked_by"].as_str()), (3, Some(expected)));
        assert!(
            text.lines().any(|line| line.starts_with("a ray's source is picked from a") && line.ends_with(expected)),
            "{text}"
        );
    }
}

/// A scene file with three cameras, the last of which is orthographic, a spot light, and a mesh file with a map.
fn write_scene(directory: &Path) {
    let write = |name: &str, content: &str| fs::write(directory.join(name), content).unwrap();
    write("m.mtl", "newmtl wood\nKd 0.1 0.2 0.3\nmap_Kd a.png\nNs 9\n");
    write("m.obj", "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl wood\nf 1/1 2/1 3/1\n");
    image::RgbaImage::from_pixel(4, 2, image::Rgba([250, 240, 230, 255])).save(directory.join("a.png")).unwrap();
    let cameras = ["left", "right"].map(|name| {
        let x = name.len();
        format!("[[cameras]]\nname = '{name}'\neye = [{x}, 0, 5]\ntarget = [0, 0, 0]\n")
    });
    let plan = "[[cameras]]\nname = 'plan'\neye = [0, 0, 5]\ntarget = [0, 0, 0]\northographic_height = 2.5\n";
    let light = "[[light]]\nkind = 'spot'\nposition = [0, 0, 4]\ndirection = [0, 0, -1]\nintensity = [9, 9, 9]\n\
                 inner_angle = 10\nouter_angle = 30\n";
    let meshes = "[[mesh]]\nfile = 'm.obj'\n".repeat(2);
    write("s.toml", &format!("{}{plan}{light}{meshes}", cameras.concat()));
}

#[test]
fn inspect_lists_what_a_scene_consists_of() {
    let directory = TempDir::new().unwrap();
    write_scene(directory.path());
    let text = stdout(&succeed(directory.path(), &["inspect", "s.toml"]));
    let json = succeed(directory.path(), &["inspect", "s.toml", "--json", "--camera", "1"]).stdout;
    let json: Value = serde_json::from_slice(&json).unwrap();
    assert_eq!((json["meshes"][0]["triangles"].as_u64(), json["meshes"][0]["instances"].as_u64()), (Some(1), Some(2)));
    let wood = &json["materials"][0];
    assert_eq!((wood["name"].as_str(), wood["model"].as_str()), (Some("wood"), Some("phong")));
    assert_eq!((wood["terms"]["Ns"].as_f64(), wood["maps"]["base colour"].as_str()), (Some(9.0), Some("a.png")));
    assert!(wood["terms"]["Ni"].is_null() && wood["opacity"] == "blend" && wood["double_sided"] == true);
    assert_eq!(json["schema"], 3);
    let image = &json["images"][0];
    assert_eq!(
        (image["width"].as_u64(), image["height"].as_u64(), image["bytes"].as_u64()),
        (Some(4), Some(2), Some(32))
    );
    assert_eq!((image["channels"].as_str(), image["used_by"][0]["material"].as_str()), (Some("8 bit"), Some("wood")));
    assert_eq!(
        (json["lights"][0]["kind"].as_str(), json["lights"][0]["direction"][2].as_f64()),
        (Some("spot"), Some(-1.0))
    );
    assert!((json["lights"][0]["outer_angle"].as_f64().unwrap() - 30.0).abs() < 1e-4);
    assert_eq!((json["cameras"][1]["name"].as_str(), json["camera"]["eye"][0].as_f64()), (Some("right"), Some(5.0)));
    assert_eq!(
        (json["camera"]["vertical_fov"].as_f64(), &json["camera"]["orthographic_height"]),
        (Some(45.0), &Value::Null)
    );
    let plan = &json["cameras"][2];
    assert_eq!((&plan["vertical_fov"], plan["orthographic_height"].as_f64()), (&Value::Null, Some(2.5)));
    assert!(
        text.lines().any(|line| line.starts_with("2 ") && line.contains("plan") && line.ends_with("2.5")),
        "{text}"
    );
    let memory = &json["texture_memory"];
    // The table of sRGB has 256 words. Each image has three levels of 8, 2 and 1 texels, and a word for each level.
    assert!(memory["texels"].as_u64() >= Some(4 * (256 + 14)) && memory["uvs"].as_u64() == Some(2 * 24), "{memory}");
    for row in ["mesh", "look of material", "image", "spot light at", "camera", "textures on a device"] {
        assert!(text.lines().any(|line| line.starts_with(row)), "{row}: {text}");
    }
    let bounds = text.lines().find(|line| line.starts_with("bounds")).unwrap();
    assert_eq!(bounds, "bounds (0, 0, 0) to (1, 1, 0), size (1, 1, 0)");
    assert!(
        text.contains("base colour of wood")
            && text.lines().any(|line| line.starts_with("1") && line.contains("right"))
    );
}

#[test]
fn cameras_and_scenes_are_chosen() {
    let directory = TempDir::new().unwrap();
    write_scene(directory.path());
    let picture = |camera: &[&str]| {
        let render = ["render", "s.toml", "--cpu", "-q", "--size", "32x24", "-o", "x.png"];
        succeed(directory.path(), &[&render, camera].concat());
        pixels(&directory.path().join("x.png"))
    };
    let [first, second] = [picture(&["--camera", "left"]), picture(&["--camera", "1"])];
    assert!(first == picture(&[]) && first != second && second == picture(&["--camera", "right"]));
    let wrong = ["render", "s.toml", "--cpu", "--camera", "up"];
    fail(directory.path(), &wrong, 3, "s.toml: there is no camera `up`, but 0 `left`, 1 `right`, 2 `plan`");
    fail(directory.path(), &["inspect", "m.obj", "--camera", "0"], 3, "the file names no cameras");
    fail(directory.path(), &["inspect", "s.toml", "--scene", "0"], 3, "only glTF files name scenes");
}

#[test]
fn convert_writes_a_scene_file() {
    let directory = TempDir::new().unwrap();
    write_scene(directory.path());
    let path = |name: &str| directory.path().join(name);
    assert_eq!(stdout(&succeed(directory.path(), &["convert", "m.obj", "c.toml"])), "wrote c.toml\n");
    for (file, picture) in [("m.obj", "a.exr"), ("c.toml", "b.exr")] {
        succeed(directory.path(), &["render", file, "--cpu", "-q", "--size", "32x24", "-o", picture]);
    }
    assert!(pixels(&path("a.exr")) == pixels(&path("b.exr")));
    let written = fs::read(path("c.toml")).unwrap();
    fail(directory.path(), &["convert", "m.obj", "c.toml"], 2, "`c.toml` exists: --force replaces it");
    fail(directory.path(), &["convert", "m.obj", "c.txt"], 2, "must end in .toml");
    fail(directory.path(), &["convert", "s.toml", "./s.toml", "--force"], 2, "is read as IN");
    fail(directory.path(), &["convert", "m.obj", "none/c.toml"], 5, "none/c.toml");
    fs::create_dir(path("sub")).unwrap();
    fail(directory.path(), &["convert", "m.obj", "sub/c.toml"], 3, "m.obj: does not lie below the folder of");
    assert_eq!(fs::read(path("c.toml")).unwrap(), written);
    let quiet = succeed(directory.path(), &["convert", "s.toml", "c.toml", "--force", "-q"]);
    assert!(quiet.stdout.is_empty() && fs::read(path("c.toml")).unwrap() == fs::read(path("s.toml")).unwrap());
}

#[test]
fn inspect_describes_grids() {
    let directory = TempDir::new().unwrap();
    for (kind, name) in [("grid", "grid"), ("grid2", "two-level grid")] {
        let text = stdout(&succeed(directory.path(), &["inspect", &cornell(), "--accel", kind]));
        let json = stdout(&succeed(directory.path(), &["inspect", &cornell(), "--accel", kind, "--json"]));
        let json: Value = serde_json::from_str(&json).unwrap();
        let grid = &json["grid"];
        assert!(grid["n_cells"].as_u64() > grid["n_empty_cells"].as_u64() && json["tree"].is_null(), "{json}");
        assert!(grid["n_references"].as_u64() >= json["triangles"].as_u64());
        for row in [name, "resolution", "cells", "empty cells", "references", "times coarsened", "bytes", "build ms"] {
            assert!(text.lines().any(|line| line.starts_with(row)), "{row}: {text}");
        }
    }
}

/// Grids give the same picture as the kd-tree. Their reports name no traversal.
#[test]
fn render_takes_grids() {
    let directory = TempDir::new().unwrap();
    for more in [&[][..], &["--cpu"]] {
        let picture = |accel: &str| {
            let files = ["-o", "x.png", "--profile", "x.json", "--aov", "depth,normal,cost", "--validate"];
            let files = &files[..files.len() - more.len()];
            let text = stdout(&render_small(directory.path(), &[files, &["--accel", accel], more].concat()));
            let json: Value = serde_json::from_slice(&fs::read(directory.path().join("x.json")).unwrap()).unwrap();
            (pixels(&directory.path().join("x.png")), text, json)
        };
        let (expected, _, tree) = picture("kdtree");
        assert!(tree["choices"]["traversal"].is_object() && tree["choices"]["accel"] == "kdtree");
        for accel in ["grid", "grid2"] {
            let (found, text, json) = picture(accel);
            assert!(found == expected, "{accel} {more:?}");
            assert!(text.contains("cells") && json["grid"]["n_cells"].is_u64(), "{text}");
            assert!(json["choices"]["traversal"].is_null() && json["choices"]["accel"] == accel, "{json}");
        }
    }
}

/// Renders a small picture of the Cornell box in a directory.
fn render_small(directory: &Path, more: &[&str]) -> Output {
    let scene = cornell();
    succeed(directory, &[&["render", &scene, "--size", "64x48"], more].concat())
}

#[test]
fn render_writes_the_picture_it_names() {
    let directory = TempDir::new().unwrap();
    let output = render_small(directory.path(), &["-o", "x.png"]);
    let picture = image::open(directory.path().join("x.png")).unwrap();
    assert_eq!((picture.width(), picture.height()), (64, 48));
    assert!(stdout(&output).ends_with("wrote x.png\n"), "{}", stdout(&output));
    let output = render_small(directory.path(), &["--cpu", "--threads", "1"]);
    assert!(stdout(&output).ends_with("wrote cornell.png\n"), "{}", stdout(&output));
    assert_eq!(names(directory.path()), ["cornell.png", "x.png"]);
}

#[test]
fn quiet_says_nothing() {
    let directory = TempDir::new().unwrap();
    let output = render_small(directory.path(), &["--cpu", "-q", "-o", "x.exr"]);
    assert!(output.stdout.is_empty() && output.stderr.is_empty(), "{}{}", stdout(&output), stderr(&output));
    assert_eq!(names(directory.path()), ["x.exr"]);
}

#[test]
fn the_profile_says_what_the_tables_say() {
    let directory = TempDir::new().unwrap();
    for more in [&["--cpu"][..], &["--traversal", "stack", "--denoise", "off"]] {
        let output = render_small(directory.path(), &[&["-o", "x.png", "--profile", "x.json"], more].concat());
        let text = stdout(&output);
        let json: Value = serde_json::from_slice(&fs::read(directory.path().join("x.json")).unwrap()).unwrap();
        assert_eq!(
            (json["options"]["width"].as_u64(), json["bounces"][0]["n_rays"].as_u64()),
            (Some(64), Some(64 * 48))
        );
        assert!(json["options"]["denoise"].is_string() && json["device"].is_string());
        for key in ["load_ms", "build_ms", "render_ms"] {
            assert!(json[key].is_f64(), "{key}");
        }
        for pass in json["pass_totals"].as_array().unwrap() {
            assert!(text.contains(pass["name"].as_str().unwrap()), "{text}");
        }
        assert!(text.contains(&json["tree"]["n_nodes"].to_string()) && text.contains("Mrays/s"), "{text}");
    }
    assert_eq!(names(directory.path()), ["x.json", "x.png"]);
}

#[test]
fn the_validation_layer_has_nothing_to_say() {
    let directory = TempDir::new().unwrap();
    render_small(directory.path(), &["--validate", "-o", "x.png"]);
}

#[test]
fn a_validation_message_is_listed_and_fails() {
    let directory = TempDir::new().unwrap();
    let scene = cornell();
    let output = kdray(directory.path(), &["render", &scene, "--size", "64x48", "--validate", "-q", "-o", "x.png"])
        .env(COMPLAINTS.0, COMPLAINTS.1)
        .output()
        .unwrap();
    let text = stderr(&output);
    assert_eq!(output.status.code(), Some(4), "{text}");
    assert!(text.contains("validation: "), "{text}");
    assert!(text.lines().last().unwrap().starts_with("error: the validation layer"), "{text}");
}

#[cfg(unix)]
mod unix {
    use std::os::unix::fs::symlink;

    use super::*;

    /// Runs a shell script in which "$@" is the command. The script can close pipes and limit the size of files.
    fn shell(directory: &Path, script: &str, arguments: &[&str]) -> Output {
        let mut command = Command::new("bash");
        command.args(["-c", &format!("set -o pipefail; {script}"), "bash", env!("CARGO_BIN_EXE_kdray")]);
        command.args(arguments).current_dir(directory).output().unwrap()
    }

    #[test]
    fn a_reader_that_leaves_is_no_error() {
        let directory = TempDir::new().unwrap();
        let scene = cornell();
        let render = ["render", &scene, "--cpu", "--size", "64x48", "-o", "x.png"];
        for arguments in [&["--help"][..], &["devices"], &["inspect", &scene], &render] {
            for script in ["\"$@\" | true", "\"$@\" 2>&1 | true", "\"$@\" >&-", "\"$@\" 2>&-", "\"$@\" >&- 2>&-"] {
                let output = shell(directory.path(), script, arguments);
                assert_eq!(output.status.code(), Some(0), "{script} {arguments:?}: {}", stderr(&output));
            }
        }
        let output = shell(directory.path(), "\"$@\" 2>&-", &["render", "none.toml"]);
        assert_eq!(output.status.code(), Some(3));
    }

    #[test]
    fn a_report_that_does_not_fit_is_an_error() {
        let directory = TempDir::new().unwrap();
        let output = shell(directory.path(), "\"$@\" >/dev/full", &["devices"]);
        assert_eq!(output.status.code(), Some(5));
        assert!(stderr(&output).starts_with("error: cannot write to standard output"), "{}", stderr(&output));
    }

    #[test]
    fn a_full_disk_leaves_what_was_there() {
        let directory = TempDir::new().unwrap();
        fs::write(directory.path().join("x.exr"), "old").unwrap();
        symlink("/dev/full", directory.path().join("full.png")).unwrap();
        let scene = cornell();
        // A limit on the size of files simulates a full disk without privileges.
        for (limit, path) in [("ulimit -f 8", "x.exr"), ("ulimit -f 8", "new.exr"), ("true", "full.png")] {
            let arguments = ["render", &scene, "--cpu", "-q", "--size", "256x256", "-o", path];
            let output = shell(directory.path(), &format!("{limit}; exec \"$@\""), &arguments);
            let text = stderr(&output);
            assert_eq!(output.status.code(), Some(5), "{path}: {text}");
            assert!(text.starts_with("error: ") && text.contains(path) && text.lines().count() == 1, "{text}");
        }
        assert_eq!(names(directory.path()), ["full.png", "x.exr"]);
        assert_eq!(fs::read(directory.path().join("x.exr")).unwrap(), b"old");
    }
}
