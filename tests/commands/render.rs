//! Tests the samples, crops, tone curves, layers and camera paths of `kdray render`.

use std::{fs, path::Path, process::Output};

use crate::support::command::{cornell, fail, names, stderr, stdout, succeed};
use exr::prelude::{FlatSamples, ReadChannels, ReadLayers};
use tempfile::TempDir;

/// Renders a small picture of the Cornell box on the CPU, in a directory.
fn render(directory: &Path, more: &[&str]) -> Output {
    let scene = cornell();
    let size = if more.contains(&"--size") { &[][..] } else { &["--size", "64x48"] };
    succeed(directory, &[&["render", &scene, "--cpu"], size, more].concat())
}

fn refused(directory: &Path, code: i32, more: &[&str], named: &str) {
    let scene = cornell();
    fail(directory, &[&["render", &scene, "--size", "64x48", "--cpu"], more].concat(), code, named);
}

fn pixels(directory: &Path, name: &str) -> image::RgbImage {
    image::open(directory.join(name)).unwrap().into_rgb8()
}

#[test]
fn more_samples_smooth_edges_and_are_counted() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    render(path, &["-o", "1.png", "--denoise", "off"]);
    let output = render(path, &["-o", "8.png", "--denoise", "off", "--spp", "8", "--profile", "8.json"]);
    assert!(stdout(&output).contains("8 samples a pixel"), "{}", stdout(&output));
    let json: serde_json::Value = serde_json::from_slice(&fs::read(path.join("8.json")).unwrap()).unwrap();
    assert_eq!((json["samples"].as_u64(), json["bounces"][0]["n_rays"].as_u64()), (Some(8), Some(8 * 64 * 48)));
    let n_colours = |name| pixels(path, name).pixels().map(|p| p.0).collect::<std::collections::HashSet<_>>().len();
    assert!(n_colours("8.png") > n_colours("1.png"));
}

#[test]
fn a_crop_is_a_part_of_the_picture() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    render(path, &["-o", "whole.png", "--spp", "2"]);
    let output = render(path, &["-o", "part.png", "--spp", "2", "--crop", "10,5,40,17"]);
    assert!(stdout(&output).contains("64x48 (10,5,40,17 of it)"), "{}", stdout(&output));
    let part = image::imageops::crop_imm(&pixels(path, "whole.png"), 10, 5, 30, 12).to_image();
    assert_eq!(part, pixels(path, "part.png"));
    refused(path, 2, &["--crop", "10,5,65,17"], "64x48");
    refused(path, 2, &["--crop", "0,0,4294967295,1"], "beyond the picture");
}

/// A picture that ends by the clock has some samples, and is that of as many samples.
#[test]
fn a_time_is_filled_with_samples() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    let paths = ["--integrator", "path", "--max-depth", "2"];
    for integrator in [&paths[..], &["--integrator", "whitted"]] {
        let n_samples_in = |time: &&str| {
            let output =
                render(path, &[integrator, &["--time", *time, "-o", "timed.exr", "--profile", "x.json"]].concat());
            let json: serde_json::Value = serde_json::from_slice(&fs::read(path.join("x.json")).unwrap()).unwrap();
            let n_samples = json["samples"].as_u64().unwrap();
            let text = stdout(&output);
            assert!(n_samples == 1 || text.contains(&format!("{n_samples} samples a pixel")), "{text}");
            n_samples
        };
        // On a busy machine, the first sample takes longer than the shortest time.
        let n_samples = ["700ms", "7s", "70s"].iter().map(n_samples_in).find(|&n| n > 1).expect("several samples");
        render(path, &[integrator, &["--spp", &n_samples.to_string(), "-o", "counted.exr"]].concat());
        assert_eq!(channels(&path.join("timed.exr")), channels(&path.join("counted.exr")));
        render(path, &[integrator, &["--time", "1ms", "-o", "one.exr"]].concat());
        render(path, &[integrator, &["--spp", "1", "-o", "counted.exr"]].concat());
        assert_eq!(channels(&path.join("one.exr")), channels(&path.join("counted.exr")));
    }
    refused(path, 2, &["--time", "0s"], "expected a time above 0");
    refused(path, 2, &["--time", "30"], "expected a number with a unit");
    refused(path, 2, &["--time", "1s", "--spp", "4"], "--spp");
}

/// Layers of light are written by their names, in a film as well. Without other layers, no AOVs are computed.
#[test]
fn light_is_written_in_layers() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    let of_paths = ["--integrator", "path", "--spp", "2"];
    let arguments = ["-o", "light.exr", "--aov", "indirect,emission", "--profile", "light.json"];
    render(path, &[&of_paths[..], &arguments].concat());
    let written = channels(&path.join("light.exr"));
    let found: Vec<_> = written.iter().map(|channel| channel.0.as_str()).collect();
    let expected = ["B", "G", "R", "emission.B", "emission.G", "emission.R", "indirect.B", "indirect.G", "indirect.R"];
    assert_eq!(found, expected);
    let profile = fs::read_to_string(path.join("light.json")).unwrap();
    assert!(profile.contains("path_layers") && !profile.contains("\"pixel_aovs\""), "{profile}");
    fs::write(path.join("p.toml"), PATH).unwrap();
    let film = ["--path", "p.toml", "--frames", "0-1", "-o", "f#.exr", "--aov", "direct"];
    render(path, &[&of_paths[..], &film].concat());
    let [first, second] = ["f0.exr", "f1.exr"].map(|name| channels(&path.join(name)));
    assert!(first.len() == 6 && first[3].0 == "direct.B" && first != second);
    refused(path, 2, &["--integrator", "whitted", "--aov", "direct", "-o", "a.exr"], "a layer of the light of paths");
}

#[test]
fn curves_change_what_is_shown_and_not_what_is() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    for curve in ["linear", "agx", "aces", "neutral"] {
        render(path, &["-o", &format!("{curve}.png"), "--tonemap", curve]);
        render(path, &["-o", &format!("{curve}.exr"), "--tonemap", curve]);
    }
    render(path, &["-o", "default.png"]);
    let read = |name: &str| crate::support::command::pixels(&path.join(name));
    assert!(read("default.png") == read("linear.png"));
    assert!(read("agx.png") != read("linear.png") && read("agx.png") != read("aces.png"));
    assert!(read("agx.exr") == read("linear.exr") && read("aces.exr") == read("linear.exr"));
}

/// Returns the channels of an EXR file with their names. Samples are given as bits.
fn channels(path: &Path) -> Vec<(String, &'static str, Vec<u32>)> {
    let reader = exr::prelude::read().no_deep_data().largest_resolution_level().all_channels();
    let image = reader.first_valid_layer().all_attributes().from_file(path).unwrap();
    let channel = |channel: &exr::prelude::AnyChannel<FlatSamples>| {
        let (kind, bits) = match &channel.sample_data {
            FlatSamples::F32(values) => ("f32", values.iter().map(|value| value.to_bits()).collect()),
            FlatSamples::U32(values) => ("u32", values.clone()),
            FlatSamples::F16(_) => panic!("no halves"),
        };
        (channel.name.to_string(), kind, bits)
    };
    image.layer_data.channel_data.list.iter().map(channel).collect()
}

#[test]
fn aovs_are_layers_beside_the_colour() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    let output = render(path, &["-o", "x.exr", "--aov", "depth,normal,id,rays,depth"]);
    assert!(stdout(&output).ends_with("wrote x.exr\n"), "{}", stdout(&output));
    render(path, &["-o", "plain.exr"]);
    let (with, plain) = (channels(&path.join("x.exr")), channels(&path.join("plain.exr")));
    let kinds: Vec<_> = with.iter().map(|(name, kind, _)| (name.as_str(), *kind)).collect();
    let floats = |names: &[&'static str]| names.iter().map(|name| (*name, "f32")).collect::<Vec<_>>();
    let mut expected = floats(&["B", "G", "R", "depth.Z"]);
    expected.extend([("id.ID", "u32")]);
    expected.extend(floats(&["normal.X", "normal.Y", "normal.Z"]));
    expected.extend([("rays.N", "u32")]);
    assert_eq!(kinds, expected);
    assert!(with.iter().all(|(.., bits)| bits.len() == 64 * 48));
    for colour in &plain {
        assert!(with.contains(colour), "{} is the same as without layers", colour.0);
    }
    let named = |name: &str| &with.iter().find(|channel| channel.0 == name).unwrap().2;
    // The scene has 34 triangles. Pixels around the box show no triangle.
    assert!(named("id.ID").iter().all(|id| *id < 34 || *id == u32::MAX));
    let is_far = |z: &u32| f32::from_bits(*z) == f32::INFINITY;
    assert!(named("id.ID").iter().zip(named("depth.Z")).all(|(id, z)| (*id == u32::MAX) == is_far(z)));
    assert_eq!(names(path), ["plain.exr", "x.exr"]);
}

#[test]
fn the_costs_are_a_heat_map_too() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    let output = render(path, &["-o", "x.png", "--aov", "cost", "--crop", "0,0,40,30"]);
    let text = stdout(&output);
    assert!(["wrote x.exr\n", "wrote x.cost.png\n", "wrote x.png\n"].iter().all(|line| text.contains(line)), "{text}");
    assert_eq!(names(path), ["x.cost.png", "x.exr", "x.png"]);
    let map = pixels(path, "x.cost.png");
    assert!(map.width() > 40 && map.height() > 30);
    let costs = channels(&path.join("x.exr"));
    let (name, kind, values) = &costs[3];
    assert_eq!((name.as_str(), *kind, values.len()), ("cost.N", "u32", 1200));
    refused(path, 5, &["--aov", "cost", "-o", "none/x.png"], "none");
}

/// A part of a picture is rendered with the same tree as the whole picture. Another tree has other nodes and thus
/// other costs.
#[test]
fn a_part_costs_what_it_costs_in_the_whole() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    let render = |name: &str, more: &[&str]| {
        render(path, &[&["-o", name, "--aov", "cost", "--profile", "x.json"], more].concat());
        let json: serde_json::Value = serde_json::from_slice(&fs::read(path.join("x.json")).unwrap()).unwrap();
        let costs = channels(&path.join(name)).into_iter().find(|(name, ..)| name == "cost.N").unwrap().2;
        (json["choices"]["build"].clone(), costs)
    };
    let (whole_tree, whole) = render("whole.exr", &[]);
    let (part_tree, part) = render("part.exr", &["--crop", "30,20,34,24"]);
    let expected: Vec<_> = (20..24).flat_map(|y| whole[y * 64 + 30..][..4].to_vec()).collect();
    assert_eq!((part_tree, part), (whole_tree, expected));
    // The two kinds of trees must give different costs, or the test could not tell them apart.
    assert_ne!(render("fast.exr", &["--build", "fast"]).1, render("best.exr", &["--build", "best"]).1);
}

/// Repetitions do not count as work for the choice of the tree, so that a measurement shows what a single run does.
#[test]
fn repetitions_do_not_change_the_tree() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    let tree = |more: &[&str]| {
        render(path, &[&["-o", "x.png", "--size", "16x8", "--profile", "x.json"], more].concat());
        let json: serde_json::Value = serde_json::from_slice(&fs::read(path.join("x.json")).unwrap()).unwrap();
        let word = |name: &str| json["choices"]["build"][name].as_str().unwrap().to_owned();
        (word("value"), word("by"))
    };
    let words = |value: &str, by: &str| (value.to_owned(), by.to_owned());
    assert_eq!(tree(&[]), words("fast", "rule"));
    assert_eq!(tree(&["--repeat", "50"]), words("fast", "rule"));
    assert_eq!(tree(&["--spp", "50"]), words("best", "rule"));
    assert_eq!(tree(&["--build", "best"]), words("best", "pinned"));
}

const PATH: &str = "
    [[keyframe]]
    frame = 0
    eye = [0, 2.75, 10.7]
    target = [0, 2.75, 0]
    vertical_fov = 39.5
    [[keyframe]]
    frame = 2
    eye = [1, 3, 9]
    target = [0, 2.75, 0]
";

/// Only the pictures that are missing are rendered, and files that exist stay as they are.
#[test]
fn existing_pictures_are_left_out() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    fs::write(path.join("path.toml"), PATH).unwrap();
    fs::write(path.join("f.1.png"), "old").unwrap();
    let film = ["--path", "path.toml", "-o", "f.#.png", "--skip-existing"];
    let output = render(path, &film);
    assert!(stderr(&output).contains("note: 1 picture exists already\n"), "{}", stderr(&output));
    assert_eq!(names(path), ["f.0.png", "f.1.png", "f.2.png", "path.toml"]);
    assert_eq!(fs::read(path.join("f.1.png")).unwrap(), b"old");
    // Nothing is left to do, so the scene is not even loaded.
    let none = ["render", "none.toml", "--cpu", "--skip-existing", "-o"];
    succeed(path, &[&none[..], &["f.1.png"]].concat());
    let output = succeed(path, &[&none[..], &["f.#.png", "--path", "path.toml"]].concat());
    assert!(stderr(&output).contains("note: 3 pictures exist already\n") && output.stdout.is_empty());
    // A picture without its layers is not complete.
    fail(path, &[&none[..], &["f.1.png", "--aov", "depth"]].concat(), 3, "none.toml");
    render(path, &["--path", "path.toml", "--frames", "0-2x2", "-o", "g.#.png"]);
    assert_eq!(names(path), ["f.0.png", "f.1.png", "f.2.png", "g.0.png", "g.2.png", "path.toml"]);
}

#[test]
fn a_path_makes_a_picture_a_frame() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    fs::write(path.join("p.toml"), PATH).unwrap();
    let output = render(path, &["--path", "p.toml", "-o", "out.##.png"]);
    assert!(stdout(&output).ends_with("wrote 3 pictures, out.00.png to out.02.png\n"), "{}", stdout(&output));
    assert_eq!(names(path), ["out.00.png", "out.01.png", "out.02.png", "p.toml"]);
    render(path, &["-o", "still.png"]);
    // The first keyframe is the scene's own camera. A frame is the same alone and in the whole path.
    assert_eq!(pixels(path, "still.png"), pixels(path, "out.00.png"));
    render(path, &["--path", "p.toml", "-o", "again.####.png", "--frames", "1", "--aov", "cost"]);
    assert_eq!(pixels(path, "again.0001.png"), pixels(path, "out.01.png"));
    assert!(path.join("again.0001.cost.png").exists() && path.join("again.0001.exr").exists());
    assert_ne!(pixels(path, "out.01.png"), pixels(path, "out.02.png"));
}

#[test]
fn bad_paths_are_refused_before_rendering() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    refused(path, 3, &["--path", "none.toml"], "none.toml");
    fs::write(path.join("bad.toml"), "[[keyframe]]\nframe = 0\neye = [0, 0, 0]\n").unwrap();
    refused(path, 3, &["--path", "bad.toml"], "bad.toml:1");
    // Half way, eye and target coincide.
    let through = "[[keyframe]]\nframe = 0\neye = [0, 0, -1]\ntarget = [0, 0, 0]\n\
                   [[keyframe]]\nframe = 2\neye = [0, 0, 1]\ntarget = [0, 0, 0]\n";
    fs::write(path.join("through.toml"), through).unwrap();
    refused(path, 2, &["--path", "through.toml"], "at frame 1,");
    fs::write(path.join("short.toml"), PATH.replace("= 0\n", "= 0.2\n").replace("= 2\n", "= 0.8\n")).unwrap();
    refused(path, 2, &["--path", "short.toml"], "no whole frame");
    assert_eq!(names(path), ["bad.toml", "short.toml", "through.toml"]);
}

#[test]
fn frames_differ_by_the_camera_alone_on_the_device_too() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    fs::write(path.join("p.toml"), PATH).unwrap();
    let scene = cornell();
    let arguments = ["render", &scene, "--size", "64x48", "--validate", "--path", "p.toml", "--spp", "3"];
    let output = succeed(path, &[&arguments[..], &["--frames", "0-1", "-o", "a#.png"]].concat());
    assert!(stderr(&output).contains("rendering"), "{}", stderr(&output));
    succeed(path, &[&arguments[..], &["--frames", "1", "-o", "b#.png"]].concat());
    assert_eq!(pixels(path, "a1.png"), pixels(path, "b1.png"));
}

/// Pictures of paths know their noise, which only they have, and a filter reduces it.
#[test]
fn the_noise_of_paths_is_written_and_filtered() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    let of_paths = ["--integrator", "path", "--spp", "4"];
    render(path, &[&of_paths[..], &["-o", "noisy.exr", "--aov", "variance,samples"]].concat());
    let channels = channels(&path.join("noisy.exr"));
    let bits = |name: &str| &channels.iter().find(|(found, ..)| found == name).expect("the channel").2;
    assert!(bits("samples.N").iter().all(|&n| n == 4));
    let variances: Vec<_> = bits("variance.Y").iter().map(|&bits| f32::from_bits(bits)).collect();
    assert!(variances.iter().all(|v| (0.0..1e3).contains(v)) && variances.iter().any(|&v| v > 0.0));
    for filter in ["off", "edge"] {
        render(path, &[&of_paths[..], &["-o", &format!("{filter}.png"), "--denoise", filter]].concat());
    }
    let roughness = |name| {
        let picture = pixels(path, name);
        let rows = picture.rows().map(|row| row.map(|pixel| i32::from(pixel.0[1])).collect::<Vec<_>>());
        rows.flat_map(|row| row.windows(2).map(|pair| (pair[0] - pair[1]).abs()).collect::<Vec<_>>()).sum::<i32>()
    };
    assert!(2 * roughness("edge.png") < roughness("off.png"));
    refused(path, 2, &["--integrator", "whitted", "--denoise", "edge"], "--integrator path");
    refused(path, 2, &["--integrator", "whitted", "--aov", "samples", "-o", "a.exr"], "--integrator path");
}
