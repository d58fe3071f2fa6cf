//! Tests of films: animations of glTF files, and turns around scenes.

use std::{collections::BTreeMap, fs, path::Path};

use base64::{Engine, engine::general_purpose::STANDARD};
use exr::prelude::{FlatSamples, ReadChannels, ReadLayers};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::support::{
    animated::moving,
    command::{fail, kdray, lose_device_at, names, stderr, stdout, succeed},
};

/// Writes `moving.gltf`.
fn with_model(morphs: bool) -> TempDir {
    let directory = TempDir::new().unwrap();
    fs::write(directory.path().join("moving.gltf"), moving(morphs).to_string()).unwrap();
    directory
}

fn pixels(path: &Path) -> Vec<u8> {
    image::open(path).unwrap().into_rgb8().into_raw()
}

const SMALL: [&str; 7] = ["-q", "--size", "40x30", "--exposure", "1", "--spp", "1"];

/// A frame is the same alone, in sequence, and as a picture at its time, whether instances move or trees are built.
#[test]
fn frames_of_an_animation_are_pictures_at_their_times() {
    for morphs in [false, true] {
        let directory = with_model(morphs);
        let path = directory.path();
        for device in ["--cpu", "--validate"] {
            for (instances, accel) in [("flatten", "kdtree"), ("keep", "kdtree"), ("keep", "grid2")] {
                let common = [&SMALL[..], &[device, "--instances", instances, "--accel", accel]].concat();
                let render = |more: &[&str]| succeed(path, &[&["render", "moving.gltf"], &common[..], more].concat());
                render(&["--frames", "0-4", "--fps", "2", "--profile", "p.json", "-o", "f#.png"]);
                let profile: Value = serde_json::from_slice(&fs::read(path.join("p.json")).unwrap()).unwrap();
                let work = &profile["last_moment"];
                assert_eq!((&work["n_moved"], &work["n_deformed"]), (&json!(1), &json!(u32::from(morphs))), "{work}");
                render(&["--frames", "3", "--fps", "2", "-o", "alone#.png"]);
                render(&["--at", "1.5", "-o", "at.png"]);
                render(&["--frame", "3", "--fps", "2", "-o", "frame.png"]);
                let at = pixels(&path.join("at.png"));
                for same in ["f3.png", "alone3.png", "frame.png"] {
                    assert!(pixels(&path.join(same)) == at, "{same}, {device} {instances} {accel} {morphs}");
                }
                let frames = [0, 1, 2, 3, 4].map(|frame| pixels(&path.join(format!("f{frame}.png"))));
                assert!(frames.windows(2).all(|pair| pair[0] != pair[1]), "something moves in each frame");
            }
        }
    }
}

/// Returns [`moving`] with a sheet of 3200 triangles, which becomes a wave, in place of the square that grows.
fn with_wave() -> Value {
    const N: u32 = 40;
    let at = |ix: u32| [(ix % (N + 1)) as f32 / N as f32, (ix / (N + 1)) as f32 / N as f32];
    let corners: Vec<[f32; 3]> = (0..(N + 1) * (N + 1)).map(|ix| [at(ix)[0], at(ix)[1], 0.0]).collect();
    let raised = |[x, y, _]: &[f32; 3]| [0.3 * (9.0 * y).sin(), 0.0, 0.4 * (11.0 * x + 3.0 * y).sin()];
    let added: Vec<[f32; 3]> = corners.iter().map(raised).collect();
    let quad = |ix: u32| {
        let a = ix / N * (N + 1) + ix % N;
        [a, a + 1, a + N + 2, a, a + N + 2, a + N + 1]
    };
    let indices: Vec<u32> = (0..N * N).flat_map(quad).collect();
    let parts = [bytemuck::cast_slice(&corners), bytemuck::cast_slice(&added), bytemuck::cast_slice::<_, u8>(&indices)];
    let mut file = moving(true);
    let push = |file: &mut Value, list: &str, item: Value| {
        let list = file[list].as_array_mut().unwrap();
        list.push(item);
        list.len() - 1
    };
    let data = parts.concat();
    let uri = format!("data:application/octet-stream;base64,{}", STANDARD.encode(&data));
    let buffer = push(&mut file, "buffers", json!({ "byteLength": data.len(), "uri": uri }));
    let mut begin = 0;
    let accessors = parts.map(|part| {
        let view = json!({ "buffer": buffer, "byteOffset": begin, "byteLength": part.len() });
        begin += part.len();
        let view = push(&mut file, "bufferViews", view);
        let (kind, component, n) = match part.len() == 4 * indices.len() {
            true => ("SCALAR", 5125, indices.len()),
            false => ("VEC3", 5126, corners.len()),
        };
        push(
            &mut file,
            "accessors",
            json!({ "bufferView": view, "componentType": component, "count": n, "type": kind }),
        )
    });
    let [positions, target, indices] = accessors;
    file["meshes"][1]["primitives"] = json!([
        { "attributes": { "POSITION": positions }, "indices": indices, "targets": [{ "POSITION": target }] }
    ]);
    file
}

/// The device builds the tree or grid of the wave in each frame, and the one of the square is the host's.
#[test]
fn films_are_the_same_by_the_devices_structures_of_deformed_meshes() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    fs::write(path.join("wave.gltf"), with_wave().to_string()).unwrap();
    let render = |option: &str, build: &str| {
        let file = format!("{build}#.png");
        let more = ["--validate", "--instances", "keep", option, build, "--frames", "0-3", "--fps", "2"];
        let files = ["--profile", "p.json", "-o", &file];
        succeed(path, &[&["render", "wave.gltf"], &SMALL[..], &more, &files].concat());
        let frames = [0, 1, 2, 3].map(|frame| pixels(&path.join(format!("{build}{frame}.png"))));
        let profile: Value = serde_json::from_slice(&fs::read(path.join("p.json")).unwrap()).unwrap();
        (frames, profile)
    };
    let (expected, of_host) = render("--build", "best");
    assert!(of_host["device_build"].is_null());
    for (option, build, last_stage) in
        [("--build", "gpu", "kdtree_leaves"), ("--accel", "grid", "grid_leaves"), ("--accel", "grid2", "grid_leaves")]
    {
        let (found, of_device) = render(option, build);
        assert!(found == expected, "{build}");
        assert!(found.windows(2).all(|pair| pair[0] != pair[1]), "something moves in each frame");
        let stages = of_device["device_build"]["stages"].as_array().expect("stages");
        assert!(stages.iter().any(|stage| stage["name"] == last_stage), "{of_device}");
        assert_eq!(of_device["last_moment"]["n_deformed"], json!(1));
    }
}

/// The device is lost at every other submit, among them those of builds in the middle of the film.
#[test]
fn a_device_that_is_lost_in_a_film_ends_it_with_a_message() {
    let (directory, layer) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    let path = directory.path();
    fs::write(path.join("wave.gltf"), with_wave().to_string()).unwrap();
    let more = ["--instances", "keep", "--build", "gpu", "--traversal", "mask", "--frames", "0-1", "--fps", "2"];
    let arguments = [&["render", "wave.gltf", "-o", "f#.png"], &SMALL[..], &more].concat();
    let mut at_builds = Vec::new();
    for submit in (1..).step_by(2) {
        let mut command = kdray(path, &arguments);
        lose_device_at(&mut command, submit, layer.path());
        let output = command.output().unwrap();
        let text = stderr(&output);
        if output.status.success() {
            assert_eq!(text, "");
            break;
        }
        assert_eq!(output.status.code(), Some(4), "{submit}: {text}");
        assert!(text.starts_with("error: ") && text.lines().count() == 1 && text.contains("lost"), "{submit}: {text}");
        if text.contains("`kdtree_") || text.contains("`structure_") {
            at_builds.push(fs::read_dir(path).unwrap().count() - 1);
        }
    }
    assert!(at_builds.first() < at_builds.last(), "frames before builds that failed: {at_builds:?}");
}

#[test]
fn what_does_not_move_is_no_film() {
    let directory = with_model(false);
    let path = directory.path();
    fs::write(path.join("still.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    fail(path, &["render", "still.obj", "--cpu", "--frames", "0-2"], 2, "still.obj: nothing moves");
    fail(path, &["render", "moving.gltf", "--cpu", "--frames", "0-2", "--animation", "none"], 2, "nothing moves");
    let unknown = ["render", "moving.gltf", "--cpu", "--at", "1", "--animation", "fly"];
    fail(path, &unknown, 3, "there is no animation `fly`, but 0 `slide`");
    assert_eq!(names(path), ["moving.gltf", "still.obj"]);
    let output = succeed(path, &[&["render", "moving.gltf", "--cpu"], &SMALL[1..]].concat());
    assert!(stderr(&output).contains("animations, which --at SECONDS shows: slide"), "{}", stderr(&output));
}

#[test]
fn animations_are_listed() {
    let directory = with_model(true);
    let text = stdout(&succeed(directory.path(), &["inspect", "moving.gltf"]));
    assert!(text.contains("0          slide   0.000  2.000         ?      2       1        0"), "{text}");
    let json: Value =
        serde_json::from_str(&stdout(&succeed(directory.path(), &["inspect", "moving.gltf", "--json"]))).unwrap();
    let expected = json!([{ "name": "slide", "begin": 0.0, "end": 2.0, "moved_nodes": 2, "morphed_nodes": 1 }]);
    assert_eq!(json["animations"], expected);
}

/// A scene file whose mesh and light move by keys, from 0.5 to 2 seconds.
const KEYED: &str = "\
[camera]
eye = [0, 0, 8]
target = [0, 0, 0]

[[light]]
kind = 'point'
intensity = [15, 15, 15]
keys = [{ time = 0.5, position = [0, 0, 5] }, { time = 2, position = [3, 3, 5] }]

[[mesh]]
generator = 'box'
size = [2, 1, 1]
keys = [
    { time = 1, translate = [-1, 0, 0], rotate = [0, 0, 0] },
    { time = 2, translate = [1, 0, 0], rotate = [0, 0, 90] },
]
";

/// All frames of an animation, of a scene file or a glTF file. A pack has the same frames.
#[test]
fn all_frames_are_those_from_the_first_key_to_the_last() {
    let directory = with_model(false);
    let path = directory.path();
    fs::write(path.join("keyed.toml"), KEYED).unwrap();
    succeed(path, &["pack", "keyed.toml", "-q"]);
    let film = |scene: &str, more: &[&str]| {
        succeed(path, &[&["render", scene, "--cpu", "--frames", "all"], &SMALL[..], more].concat())
    };
    film("keyed.toml", &["--fps", "4", "-o", "k#.png"]);
    film("keyed.kdpack", &["--fps", "4", "-o", "p#.png"]);
    film("moving.gltf", &["--fps", "2", "-o", "m#.png"]);
    let made = |first: char| names(path).iter().filter(|it| it.starts_with(first) && it.ends_with("png")).count();
    assert_eq!((made('k'), made('p'), made('m')), (7, 7, 5));
    let frame = |name: &str| pixels(&path.join(name));
    for ix in 2..=8 {
        let (own, at) = (frame(&format!("k{ix}.png")), format!("{}", f64::from(ix) / 4.0));
        assert!(own == frame(&format!("p{ix}.png")), "packed frame {ix}");
        succeed(path, &[&["render", "keyed.toml", "--cpu", "--at", &at, "-o", "at.png"], &SMALL[..]].concat());
        assert!(own == frame("at.png"), "frame {ix}");
        assert!(ix == 2 || own != frame(&format!("k{}.png", ix - 1)), "something moves in frame {ix}");
    }
    let text = stdout(&succeed(path, &["inspect", "keyed.kdpack"]));
    assert!(text.contains("0          keys   0.500  2.000         1      1       0        1"), "{text}");
    fs::write(path.join("still.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    fail(path, &["render", "still.obj", "--cpu", "--frames", "all"], 2, "still.obj: nothing moves");
    let late = KEYED.replace("time = 2,", "time = 1e9,");
    fs::write(path.join("late.toml"), late).unwrap();
    fail(path, &["render", "late.toml", "--cpu", "--frames", "all"], 2, "late.toml: no frames from 0 to 1000000");
}

/// What moves by keys is blurred as what a glTF file moves is: parts of the samples are joined to the same picture.
#[test]
fn keys_are_blurred() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    fs::write(path.join("keyed.toml"), KEYED).unwrap();
    let common = ["render", "keyed.toml", "--cpu", "--spp", "32", "--at", "1.25", "--fps", "2"];
    let options = ["-q", "--size", "40x30", "--integrator", "path", "--denoise", "off"];
    let render = |more: &[&str]| succeed(path, &[&common[..], &options, more].concat());
    render(&["--shutter", "0,1", "-o", "whole.exr"]);
    render(&["--shutter", "0,1", "--samples", "0-16", "-o", "a.exr"]);
    render(&["--shutter", "0,1", "--samples", "16-32", "-o", "b.exr"]);
    render(&["-o", "sharp.exr"]);
    succeed(path, &["merge", "a.exr", "b.exr", "-q", "-o", "joined.exr"]);
    let radiance = |name: &str| image::open(path.join(name)).unwrap().into_rgb32f().into_raw();
    assert!(radiance("joined.exr") == radiance("whole.exr"));
    assert!(radiance("sharp.exr") != radiance("whole.exr"));
}

/// A long box is seen whole from all sides, and fills some of the pictures.
#[test]
fn a_turn_cuts_nothing() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    let scene = "[[mesh]]\ngenerator = 'box'\nsize = [6, 1, 0.5]\ntransform = { translate = [40, 3, 2] }\n";
    fs::write(path.join("box.toml"), scene).unwrap();
    let (width, height) = (48, 36);
    for more in [&[][..], &["--eye", "40,30,9"], &["--eye", "40,3,22", "--target", "40,3,2", "--fov", "12"]] {
        let common = [&SMALL[..1], &["--size", "48x36", "--spp", "1", "--cpu"], more].concat();
        succeed(path, &[&["render", "box.toml", "--turntable", "6", "-o", "t#.png"], &common[..]].concat());
        let mut most_wide = 0;
        for frame in 0..6 {
            let picture = image::open(path.join(format!("t{frame}.png"))).unwrap().into_rgb8();
            let background = *picture.get_pixel(0, 0);
            let is_border = |x: u32, y: u32| x == 0 || y == 0 || x == width - 1 || y == height - 1;
            let seen: Vec<_> = picture.enumerate_pixels().filter(|(_, _, pixel)| **pixel != background).collect();
            assert!(seen.len() > 20 && !seen.iter().any(|(x, y, _)| is_border(*x, *y)), "frame {frame}, {more:?}");
            let columns = seen.iter().map(|(x, ..)| *x);
            most_wide = most_wide.max(columns.clone().max().unwrap() - columns.min().unwrap());
        }
        assert!(most_wide > width * 3 / 4, "{most_wide}, {more:?}");
        let again =
            [&["render", "box.toml", "--turntable", "6", "--frames", "4", "-o", "u#.png"], &common[..]].concat();
        succeed(path, &again);
        assert!(pixels(&path.join("u4.png")) == pixels(&path.join("t4.png")));
    }
}

/// A film in one file has the pictures of the numbered files, in their order.
#[test]
fn one_file_has_all_frames() {
    use std::{fs::File, io::BufReader, process::Command};

    use image::{AnimationDecoder, codecs::gif::GifDecoder};

    let directory = with_model(false);
    let path = directory.path();
    let open = |name: &str| BufReader::new(File::open(path.join(name)).unwrap());
    let film = |more: &[&str]| {
        let args = [&["render", "moving.gltf", "--cpu", "--frames", "0-3", "--fps", "2"], &SMALL[..], more].concat();
        succeed(path, &args)
    };
    film(&["-o", "f#.png"]);
    let frames = [0, 1, 2, 3].map(|ix| pixels(&path.join(format!("f{ix}.png"))));

    film(&["-o", "film.png"]);
    let told = ["render", "moving.gltf", "--cpu", "--frames", "0-1", "--size", "8x6", "-o", "told.png"];
    assert!(succeed(path, &told).stdout.ends_with(b"wrote 2 pictures to told.png\n"));
    let mut reader = png::Decoder::new(open("film.png")).read_info().unwrap();
    assert_eq!(reader.info().animation_control.map(|it| (it.num_frames, it.num_plays)), Some((4, 0)));
    let mut buffer = vec![0; reader.output_buffer_size().unwrap()];
    for frame in &frames {
        let info = reader.next_frame(&mut buffer).unwrap();
        assert!(&buffer[..info.buffer_size()] == frame);
        let control = reader.info().frame_control.unwrap();
        assert_eq!((control.delay_num, control.delay_den), (1, 2));
    }

    film(&["-o", "film.gif"]);
    let gif = GifDecoder::new(open("film.gif")).unwrap().into_frames().collect_frames().unwrap();
    assert_eq!(gif.len(), 4);
    for (gif, frame) in gif.iter().zip(&frames) {
        assert_eq!(gif.delay().numer_denom_ms(), (500, 1));
        let rgb = gif.buffer().pixels().flat_map(|pixel| pixel.0[..3].to_vec());
        let off = rgb.zip(frame).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / frame.len() as f64;
        assert!(off < 4.0, "{off}");
    }

    film(&["-o", "film.y4m"]);
    let y4m = fs::read(path.join("film.y4m")).unwrap();
    let header = b"YUV4MPEG2 W40 H30 F2:1 Ip A1:1 C444 XCOLORRANGE=LIMITED\n";
    assert!(y4m.starts_with(header) && y4m.len() == header.len() + 4 * (6 + 3 * 40 * 30));
    let output = film(&["-o", "-"]);
    assert!(output.stdout == y4m, "standard output has nothing else");
    // A program that decodes videos finds the same colours, if there is one.
    let decoded = Command::new("ffmpeg")
        .args([
            "-v",
            "error",
            "-i",
            "film.y4m",
            "-vf",
            "scale=in_color_matrix=bt709:flags=accurate_rnd+full_chroma_int",
        ])
        .args(["-f", "rawvideo", "-pix_fmt", "rgb24", "-"])
        .current_dir(path)
        .output();
    if let Ok(decoded) = decoded {
        assert_eq!(decoded.stdout.len(), 4 * frames[0].len());
        let far = decoded.stdout.iter().zip(frames.iter().flatten()).filter(|(a, b)| a.abs_diff(**b) > 2).count();
        assert_eq!(far, 0);
    }
}

/// Writes `bar.gltf`: a white bar of width 1 that moves from the left, -1.5 <= x <= -0.5, by 2 to the right in 2
/// seconds, seen by a camera for which x is -2 to 2. With `deforms`, morph targets move it.
fn with_bar(deforms: bool) -> TempDir {
    let corners = [[-1.5_f32, -1.0, 0.0], [-0.5, -1.0, 0.0], [-0.5, 1.0, 0.0], [-1.5, 1.0, 0.0]];
    let bytes = [
        bytemuck::cast_slice::<f32, u8>(corners.as_flattened()),
        bytemuck::cast_slice::<f32, u8>([[2.0_f32, 0.0, 0.0]; 4].as_flattened()),
        bytemuck::cast_slice::<u32, u8>(&[0, 1, 2, 0, 2, 3]),
        bytemuck::cast_slice::<f32, u8>(&[0.0, 2.0]),
        bytemuck::cast_slice::<f32, u8>(&[0.0, 0.0, 0.0, 2.0, 0.0, 0.0]),
        bytemuck::cast_slice::<f32, u8>(&[0.0, 1.0]),
    ];
    let kinds = [("VEC3", 5126, 4), ("VEC3", 5126, 4), ("SCALAR", 5125, 6)];
    let kinds = kinds.into_iter().chain([("SCALAR", 5126, 2), ("VEC3", 5126, 2), ("SCALAR", 5126, 2)]);
    let accessor = |(ix, (kind, component, n)): (usize, (&str, u32, usize))| {
        let view = ix;
        json!({ "bufferView": view, "componentType": component, "count": n, "type": kind })
    };
    let accessors: Vec<_> = kinds.enumerate().map(accessor).collect();
    let mut begin = 0;
    let views: Vec<_> = (bytes.iter())
        .map(|bytes| {
            begin += bytes.len();
            json!({ "buffer": 0, "byteOffset": begin - bytes.len(), "byteLength": bytes.len() })
        })
        .collect();
    let data = bytes.concat();
    let (output, path) = if deforms { (5, "weights") } else { (4, "translation") };
    let mut primitive = json!({ "attributes": { "POSITION": 0 }, "indices": 2, "material": 0 });
    if deforms {
        primitive["targets"] = json!([{ "POSITION": 1 }]);
    }
    let model = json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0, 1, 2] }],
        "nodes": [
            { "mesh": 0 }, { "camera": 0, "translation": [0, 0, 5] },
            { "extensions": { "KHR_lights_punctual": { "light": 0 } } },
        ],
        "meshes": [{ "primitives": [primitive] }],
        "materials": [{ "extensions": { "KHR_materials_unlit": {} } }],
        "cameras": [{ "type": "orthographic", "orthographic": { "xmag": 2, "ymag": 0.5, "znear": 0.1, "zfar": 9 } }],
        "animations": [{
            "samplers": [{ "input": 3, "output": output }],
            "channels": [{ "sampler": 0, "target": { "node": 0, "path": path } }],
        }],
        "extensionsUsed": ["KHR_lights_punctual", "KHR_materials_unlit"],
        "extensions": { "KHR_lights_punctual": { "lights": [{ "type": "directional", "intensity": 3 }] } },
        "buffers": [{
            "byteLength": data.len(),
            "uri": format!("data:application/octet-stream;base64,{}", STANDARD.encode(&data)),
        }],
        "bufferViews": views, "accessors": accessors,
    });
    let directory = TempDir::new().unwrap();
    fs::write(directory.path().join("bar.gltf"), model.to_string()).unwrap();
    directory
}

/// The red channel of a row of a picture of 40x10 pixels.
fn row(path: &Path) -> Vec<f32> {
    let picture = image::open(path).unwrap().into_rgb32f();
    (0..40).map(|x| picture.get_pixel(x, 5)[0]).collect()
}

const BLURRED: [&str; 7] = ["-q", "--size", "40x10", "--integrator", "path", "--fps", "0.5"];

/// A pixel is as bright as the share of the time in which the bar is before it, whatever moves: the bar or the camera.
#[test]
fn what_moves_while_the_shutter_is_open_is_blurred() {
    let share = |x: f32, moved: f32| ((x + 1.5) / moved).clamp(0.0, 1.0) - ((x + 0.5) / moved).clamp(0.0, 1.0);
    // The share of a pixel, which weighs its surroundings by a tent of twice its width, right of an edge.
    let seen = |x: f32| match (10.0 * x).clamp(-1.0, 1.0) {
        u if u < 0.0 => (1.0 + u).powi(2) / 2.0,
        u => 1.0 - (1.0 - u).powi(2) / 2.0,
    };
    let check = |path: &Path, expected: &dyn Fn(f32) -> f32, (within, what): (f32, &str)| {
        for (ix, found) in row(path).into_iter().enumerate() {
            let expected = expected(-2.0 + 0.1 * (ix as f32 + 0.5));
            assert!((found - expected).abs() < within, "{what}: pixel {ix} is {found}, not {expected}");
        }
    };
    for (deforms, device, instances) in [
        (false, "--cpu", "auto"),
        (false, "--validate", "auto"),
        (false, "--cpu", "flatten"),
        (true, "--cpu", "auto"),
        (true, "--validate", "flatten"),
    ] {
        let directory = with_bar(deforms);
        let path = directory.path();
        // Frames under the validation layer are slow.
        let (spp, within) = if device == "--cpu" { ("256", 0.025) } else { ("64", 0.07) };
        let common = [&["render", "bar.gltf", "--instances", instances, device, "--spp", spp], &BLURRED[..]].concat();
        let render = |more: &[&str]| succeed(path, &[&common[..], more].concat());
        let what = format!("{deforms} {device} {instances}");
        render(&["--shutter", "0,1", "-o", "whole.exr"]);
        check(&path.join("whole.exr"), &|x| share(x, 2.0), (within, &what));
        // From the middle of the way on, and back: the last half is where the animation has ended.
        render(&["--at", "1", "--shutter=-0.5,0.5", "-o", "middle.exr"]);
        assert!(row(&path.join("middle.exr")) == row(&path.join("whole.exr")), "{what}");
        render(&["--at", "2", "--shutter", "0,0.5", "-o", "end.exr"]);
        check(&path.join("end.exr"), &|x| seen(x - 0.5) - seen(x - 1.5), (within, &what));
        // Parts of the samples are joined to the same picture; frames of films are such pictures.
        let rest = format!("16-{spp}");
        render(&["--shutter", "0,1", "--samples", "0-16", "-o", "a.exr"]);
        render(&["--shutter", "0,1", "--samples", &rest, "-o", "b.exr"]);
        succeed(path, &["merge", "a.exr", "b.exr", "-q", "-o", "joined.exr"]);
        render(&["--shutter", "0,1", "--frames", "0-1", "-o", "f#.exr"]);
        for same in ["joined.exr", "f0.exr"] {
            assert!(row(&path.join(same)) == row(&path.join("whole.exr")), "{same}, {what}");
        }
    }
    let directory = with_bar(false);
    let path = directory.path();
    let keyframe = |frame, x| format!("[[keyframe]]\nframe = {frame}\neye = [{x}, 0, 5]\ntarget = [{x}, 0, 0]\n");
    let keys = keyframe(0, 0) + &keyframe(1, -2);
    fs::write(path.join("path.toml"), keys).unwrap();
    let of_path = ["--cpu", "--spp", "64", "--animation", "none", "--path", "path.toml", "--frames", "0"];
    let render = |more: &[&str]| succeed(path, &[&["render", "bar.gltf"], &BLURRED[..], &of_path, more].concat());
    render(&["--shutter", "0,1", "-o", "moved#.exr"]);
    render(&["-o", "still#.exr"]);
    let [moved, still] = ["moved0.exr", "still0.exr"].map(|name| row(&path.join(name)));
    let sum = |row: &[f32]| row.iter().sum::<f32>();
    let n_lit = |row: &[f32]| row.iter().filter(|x| **x > 0.0).count();
    assert!(
        (sum(&moved) / sum(&still) - 1.0).abs() < 0.08 && n_lit(&moved) > 7 && n_lit(&still) < 6,
        "{moved:?} {still:?}"
    );
}

/// The channels of a file, by their names.
fn layers(path: &Path) -> BTreeMap<String, FlatSamples> {
    let reader = exr::prelude::read().no_deep_data().largest_resolution_level().all_channels();
    let image = reader.first_valid_layer().all_attributes().from_file(path).unwrap();
    let channels = image.layer_data.channel_data.list;
    channels.into_iter().map(|channel| (channel.name.to_string(), channel.sample_data)).collect()
}

/// The channels of some names, pixel by pixel.
fn vectors<const N: usize>(path: &Path, names: [&str; N]) -> Vec<[f32; N]> {
    let layers = layers(path);
    let channels = names.map(|name| layers[name].values_as_f32().collect::<Vec<_>>());
    (0..channels[0].len()).map(|ix| std::array::from_fn(|channel_ix| channels[channel_ix][ix])).collect()
}

/// The bar goes 2 units in a frame of 2 seconds, which are 20 pixels, whether it is moved or deformed.
#[test]
fn vectors_of_motion_are_those_of_the_bar() {
    for deforms in [false, true] {
        let directory = with_bar(deforms);
        let path = directory.path();
        for (integrator, device) in [("whitted", "--cpu"), ("path", "--cpu"), ("path", "--validate")] {
            let common = ["render", "bar.gltf", "-q", "--size", "40x10", "--denoise", "off", "--spp", "4"];
            let with = [&common[..], &["--aov", "motion,id", "--integrator", integrator, device]].concat();
            let render = |more: &[&str]| succeed(path, &[&with[..], more].concat());
            let check = |name: &str, expected: f32| {
                let found = vectors(&path.join(name), ["motion.X", "motion.Y"]);
                let hits: Vec<u32> =
                    layers(&path.join(name))["id.ID"].values_as_f32().map(|id| u32::from(id < 1e6)).collect();
                assert!(hits.iter().sum::<u32>() > 80);
                for (ix, (found, is_hit)) in found.into_iter().zip(hits).enumerate() {
                    let off = (found[0] - expected * is_hit as f32).abs().max(found[1].abs());
                    assert!(off < 1e-4, "{name}, {deforms} {integrator} {device}: {found:?} in pixel {ix}");
                }
            };
            render(&["--frames", "0-1", "--fps", "0.5", "-o", "film#.exr"]);
            check("film0.exr", 20.0);
            check("film1.exr", 0.0); // the animation has ended
            render(&["--at", "0.5", "--fps", "2", "-o", "at.exr"]);
            check("at.exr", 5.0);
            render(&["-o", "rest.exr"]);
            check("rest.exr", 0.0);
            for part in ["1", "2"] {
                let (tile, name) = (format!("{part}/2"), format!("{part}.exr"));
                render(&["--at", "0.5", "--fps", "2", "--tile", &tile, "-o", &name]);
            }
            succeed(path, &["merge", "1.exr", "2.exr", "-q", "-o", "joined.exr"]);
            check("joined.exr", 5.0);
            if integrator == "path" {
                render(&["--shutter", "0,0.5", "--fps", "2", "-o", "blurred.exr"]);
                check("blurred.exr", 5.0);
            }
        }
    }
}

/// A vector leads to the pixel of the next frame that shows where the point is then.
#[test]
fn vectors_of_motion_lead_to_the_next_frame() {
    let directory = with_model(true);
    let path = directory.path();
    let (width, height) = (60, 45);
    for device in ["--cpu", "--validate"] {
        let common = ["render", "moving.gltf", "-q", "--size", "60x45", "--spp", "1", "--denoise", "off", device];
        let film = ["--aov", "motion,position,id", "--frames", "0-1", "--fps", "2", "-o", "f#.exr"];
        succeed(path, &[&common[..], &film].concat());
        let of = |frame: u32| path.join(format!("f{frame}.exr"));
        let motion = vectors(&of(0), ["motion.X", "motion.Y"]);
        let [now, next] = [0, 1].map(|frame| vectors(&of(frame), ["id.ID", "position.X", "position.Y", "position.Z"]));
        let mut n_of_squares = [0; 2];
        for (ix, ([x, y], [id, px, py, pz])) in motion.into_iter().zip(now).enumerate() {
            if id > 3.0 {
                continue;
            }
            // One square goes half a unit to the right, and the other one grows by a quarter around its corner.
            let square = usize::from(id > 1.0);
            let expected = [[px + 0.5, py, pz], [0.2 + (px - 0.2) * 1.25, -1.2 + (py + 1.2) * 1.25, pz]][square];
            // The place in the next frame, from the centre of its first pixel on.
            let [x, y] = [(ix % width) as f32 + x, (ix / width) as f32 - y];
            let (left, top) = (x.floor(), y.floor());
            if left < 0.0 || top < 0.0 || left as usize + 1 >= width || top as usize + 1 >= height {
                continue;
            }
            let corner = top as usize * width + left as usize;
            let around = [corner, corner + 1, corner + width, corner + width + 1].map(|ix| next[ix]);
            if around.iter().any(|it| it[0] > 3.0 || usize::from(it[0] > 1.0) != square) {
                continue;
            }
            // Points of a plane before the camera lie in the picture as in the plane.
            let (u, v) = (x - left, y - top);
            for axis in 0..3 {
                let [a, b, c, d] = around.map(|it| it[1 + axis]);
                let found = (a * (1.0 - u) + b * u) * (1.0 - v) + (c * (1.0 - u) + d * u) * v;
                assert!((found - expected[axis]).abs() < 1e-3, "{device}: pixel {ix}, {found}, {expected:?}");
            }
            n_of_squares[square] += 1;
        }
        assert!(n_of_squares.iter().all(|n| *n > 30), "{n_of_squares:?}");
    }
}

/// Parts of pictures of other times or shutters are not joined.
#[test]
fn parts_have_one_time_and_one_shutter() {
    let directory = with_bar(false);
    let path = directory.path();
    let common = [&["render", "bar.gltf", "--cpu", "--spp", "32", "--instances", "keep"], &BLURRED[..5]].concat();
    let render = |more: &[&str]| succeed(path, &[&common[..], more].concat());
    let merge = |parts: [&str; 2]| succeed(path, &["merge", parts[0], parts[1], "-q", "-o", "joined.exr"]);
    let refused = |parts: [&str; 2], what: &str| {
        fail(path, &["merge", parts[0], parts[1], "-q", "-o", "joined.exr"], 3, what);
    };
    let (early, late) = (["--samples", "0-16"], ["--samples", "16-32"]);
    render(&[&early[..], &["--fps", "0.5", "--shutter", "0,0.1", "-o", "a.exr"]].concat());
    render(&[&late[..], &["--fps", "0.5", "--shutter", "0,0.1", "-o", "b.exr"]].concat());
    render(&[&late[..], &["--fps", "0.5", "--shutter", "0,0.3", "-o", "long.exr"]].concat());
    render(&[&late[..], &["--shutter", "0,0.1", "--fps", "24", "-o", "fast.exr"]].concat());
    merge(["a.exr", "b.exr"]);
    let own = "shutter: \"0,0.1 at 0.5 frames a second\" and ";
    refused(["a.exr", "long.exr"], &format!("{own}\"0,0.3 at 0.5 frames a second\""));
    refused(["a.exr", "fast.exr"], &format!("{own}\"0,0.1 at 24 frames a second\""));
    render(&[&early[..], &["--fps", "0.5", "--frames", "0-1", "-o", "early#.exr"]].concat());
    render(&[&late[..], &["--fps", "0.5", "--frames", "0-1", "-o", "late#.exr"]].concat());
    merge(["early1.exr", "late1.exr"]);
    refused(["early0.exr", "late1.exr"], "time: \"0 s\" and \"2 s\"");
}

/// The noise of a film is the same in all frames, or that of each frame's number, whichever frames are drawn.
#[test]
fn noise_is_fixed_or_new_in_each_frame() {
    let directory = with_bar(false);
    let path = directory.path();
    let key = |frame| format!("[[keyframe]]\nframe = {frame}\neye = [0, 0, 5]\ntarget = [0, 0, 0]\n");
    fs::write(path.join("path.toml"), key(0) + &key(9)).unwrap();
    for device in ["--cpu", "--validate"] {
        // A lens blurs the bar, with noise.
        let still = ["--animation", "none", "--path", "path.toml", "--spp", "4", "--aperture", "0.9", "--focus", "3"];
        let common = [&["render", "bar.gltf", device], &BLURRED[..], &still].concat();
        let render = |more: &[&str]| succeed(path, &[&common[..], more].concat());
        render(&["--frames", "2-3", "-o", "fixed#.exr"]);
        render(&["--frames", "2-3", "--seed", "frame", "-o", "new#.exr"]);
        render(&["--frames", "3", "--seed", "frame", "-o", "alone#.exr"]);
        render(&["--frames", "2", "--seed", "3", "-o", "three#.exr"]);
        let row = |name: &str| row(&path.join(name));
        assert!(row("fixed2.exr") == row("fixed3.exr") && row("new2.exr") != row("new3.exr"), "{device}");
        assert!(row("new3.exr") == row("alone3.exr") && row("new3.exr") == row("three2.exr"), "{device}");
        assert!(row("new2.exr") != row("fixed2.exr") && row("new2.exr") != row("alone3.exr"), "{device}");
    }
    for word in ["32768", "-1", "frames"] {
        fail(
            path,
            &["render", "bar.gltf", &format!("--seed={word}")],
            2,
            "expected a number from 0 to 32767, or frame",
        );
    }
}

#[test]
fn a_shutter_needs_motion_and_paths() {
    let directory = with_bar(false);
    let path = directory.path();
    fs::write(path.join("still.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let render = ["render", "bar.gltf", "--cpu", "--integrator", "path", "--shutter"];
    for (more, expected) in [
        (&["0,0"][..], "closes before it opens"),
        (&["0"], "expected OPEN,CLOSE"),
        (&["0,1", "--denoise", "edge"], "--shutter needs --denoise off"),
        (&["0,1", "--noise", "0.1"], "cannot be used with"),
        (&["0,1", "--animation", "none"], "bar.gltf: nothing moves, so --shutter needs"),
    ] {
        fail(path, &[&render[..], more].concat(), 2, expected);
    }
    let whitted = ["render", "bar.gltf", "--cpu", "--integrator", "whitted", "--shutter", "0,1"];
    fail(path, &whitted, 2, "--shutter needs --integrator path");
    fail(path, &["render", "still.obj", "--cpu", "--shutter", "0,1"], 2, "still.obj: nothing moves");
}
