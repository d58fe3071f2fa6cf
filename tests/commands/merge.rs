//! Tests of `kdray merge` and of the parts that it joins.

use std::{fs, path::Path};

use crate::support::command::{cornell, fail, names, stdout, succeed};
use exr::prelude::{FlatSamples, ReadChannels, ReadLayers};
use tempfile::TempDir;

const SIZE: &str = "40x30";

fn render(directory: &Path, output: &str, arguments: &[&str]) {
    let scene = cornell();
    let common = ["render", &scene, "--size", SIZE, "-q", "-o", output];
    succeed(directory, &[&common[..], arguments].concat());
}

/// Renders with the path tracer.
fn render_paths(directory: &Path, output: &str, arguments: &[&str]) {
    render(directory, output, &[&["--integrator", "path", "--max-depth", "3"], arguments].concat());
}

fn merge(directory: &Path, parts: &[&str], output: &str) -> String {
    stdout(&succeed(directory, &[&["merge"], parts, &["-o", output]].concat()))
}

/// The name and the bits of each channel.
type Channels = Vec<(String, Vec<u32>)>;

/// Returns the bits of all channels of a file, and its record.
fn contents(path: &Path) -> (Channels, String) {
    let reader = exr::prelude::read().no_deep_data().largest_resolution_level().all_channels();
    let image = reader.first_valid_layer().all_attributes().from_file(path).unwrap();
    let bits = |samples: &FlatSamples| match samples {
        FlatSamples::F32(samples) => samples.iter().map(|sample| sample.to_bits()).collect(),
        FlatSamples::U32(samples) => samples.clone(),
        FlatSamples::F16(_) => unreachable!("kdray writes no halves"),
    };
    let channels = image.layer_data.channel_data.list.iter();
    let channels = channels.map(|channel| (channel.name.to_string(), bits(&channel.sample_data))).collect();
    (channels, format!("{:?}", image.layer_data.attributes.other))
}

fn assert_same(directory: &Path, a: &str, b: &str) {
    let [(a_channels, a_record), (b_channels, b_record)] = [a, b].map(|name| contents(&directory.join(name)));
    assert!(a_channels == b_channels, "{a} and {b} differ");
    assert_eq!(a_record, b_record);
}

/// Sums of any ranges of samples, of all tiles, join to the bits of the picture that is rendered at once, on the device
/// and on the CPU.
#[test]
fn samples_and_tiles_join_to_the_same_bits() {
    for cpu in [&[][..], &["--cpu"]] {
        let directory = TempDir::new().unwrap();
        let path = directory.path();
        let aov = ["--aov", "depth,id,emission,direct,indirect,albedo,normal"];
        // The last samples need not be a multiple of 16.
        let spp = ["--spp", "100"];
        render_paths(path, "whole.exr", &[&spp, &aov[..], cpu].concat());
        for (part, options) in [
            ("a", &["--tile", "1/3"][..]),
            ("b", &["--tile", "2/3", "--samples", "0-48"]),
            ("c", &["--tile", "2/3", "--samples", "48-100"]),
            ("d", &["--tile", "3/3", "--samples", "0-16"]),
            ("e", &["--tile", "3/3", "--samples", "16-48"]),
            ("f", &["--tile", "3/3", "--samples", "48-100"]),
        ] {
            render_paths(path, &format!("{part}.exr"), &[&spp, options, &aov, cpu].concat());
        }
        let report = merge(path, &["f.exr", "e.exr", "d.exr", "c.exr", "b.exr", "a.exr"], "merged.exr");
        assert_eq!(report, "6 parts of cornell, 40x30 pixels with 100 samples\nwrote merged.exr\n");
        assert_same(path, "whole.exr", "merged.exr");
        // The comparison can fail: other samples make another picture.
        render_paths(path, "fewer.exr", &[&["--spp", "80"], &aov[..], cpu].concat());
        assert!(contents(&path.join("whole.exr")).0 != contents(&path.join("fewer.exr")).0);
    }
}

/// A seed has samples of its own, of which ranges and tiles are parts, and which are as many as a noise demands.
#[test]
fn seeds_are_other_pictures_of_the_same_light() {
    for device in ["--cpu", "--validate"] {
        let directory = TempDir::new().unwrap();
        let path = directory.path();
        let render = |name: &str, more: &[&str]| render_paths(path, name, &[&["--spp", "64", device], more].concat());
        render("plain.exr", &[]);
        render("zero.exr", &["--seed", "0"]);
        assert_same(path, "plain.exr", "zero.exr");
        let seed = ["--seed", "32767"];
        render("whole.exr", &seed);
        render("b.exr", &[&seed[..], &["--samples", "16-64", "--tile", "1/2"]].concat());
        render("c.exr", &[&seed[..], &["--samples", "16-64", "--tile", "2/2"]].concat());
        render("d.exr", &[&seed[..], &["--samples", "0-16", "--tile", "2/2"]].concat());
        render("e.exr", &[&seed[..], &["--samples", "0-16", "--tile", "1/2"]].concat());
        merge(path, &["b.exr", "c.exr", "d.exr", "e.exr"], "merged.exr");
        assert_same(path, "whole.exr", "merged.exr");
        render("noise.exr", &[&seed[..], &["--noise", "0.0001"]].concat());
        let light = |name: &str| -> Vec<f32> {
            let (channels, _) = contents(&path.join(name));
            channels.iter().flat_map(|(_, bits)| bits.iter().map(|bits| f32::from_bits(*bits))).collect()
        };
        let [plain, whole, noise] = ["plain.exr", "whole.exr", "noise.exr"].map(light);
        assert!(whole == noise && whole != plain, "{device}");
        let mean = |values: &[f32]| values.iter().sum::<f32>() / values.len() as f32;
        assert!((mean(&whole) / mean(&plain) - 1.0).abs() < 0.02, "{} {}", mean(&whole), mean(&plain));
    }
}

/// The counts of samples add up, and the variance is about that of all samples: the mean over the picture is within a
/// tenth.
#[test]
fn noise_is_that_of_all_samples() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    let noise = ["--cpu", "--spp", "80", "--aov", "variance,samples"];
    render_paths(path, "whole.exr", &noise);
    render_paths(path, "a.exr", &[&noise[..], &["--samples", "0-48"]].concat());
    render_paths(path, "b.exr", &[&noise[..], &["--samples", "48-80"]].concat());
    merge(path, &["a.exr", "b.exr"], "merged.exr");
    let channel = |file: &str, name: &str| {
        contents(&path.join(file)).0.into_iter().find(|(channel, _)| channel == name).unwrap().1
    };
    for (file, n_samples) in [("whole.exr", 80), ("a.exr", 48), ("b.exr", 32), ("merged.exr", 80)] {
        assert!(channel(file, "samples.N").iter().all(|n| *n == n_samples), "{file}");
    }
    let mean = |file: &str| {
        channel(file, "variance.Y").into_iter().map(|bits| f64::from(f32::from_bits(bits))).sum::<f64>() / 1200.0
    };
    let (whole, merged) = (mean("whole.exr"), mean("merged.exr"));
    assert!(whole > 0.0 && (merged / whole - 1.0).abs() < 0.1, "{merged}, {whole}");
    // The variance of a part is that of fewer samples.
    assert!(mean("a.exr") > 1.3 * whole, "{}", mean("a.exr"));
}

/// Tiles of the paper's tracer with the noise filter, whose windows overlap, join as well. What a display shows is
/// encoded again, within a step of 8 bits.
#[test]
fn filtered_tiles_join_to_a_png() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    let scene = [
        ["--integrator", "whitted", "--spp", "3", "--denoise", "paper"],
        ["--tonemap", "agx", "--exposure", "0.7", "--aov", "albedo,normal"],
    ]
    .concat();
    render(path, "whole.exr", &scene);
    render(path, "whole.png", &scene);
    render(path, "left.exr", &[&scene[..], &["--crop", "0,0,17,30"]].concat());
    render(path, "upper.exr", &[&scene[..], &["--crop", "17,0,40,11"]].concat());
    render(path, "lower.exr", &[&scene[..], &["--crop", "17,11,40,30"]].concat());
    let parts = ["left.exr", "upper.exr", "lower.exr"];
    merge(path, &parts, "merged.exr");
    assert_same(path, "whole.exr", "merged.exr");
    merge(path, &parts, "merged.png");
    let [whole, merged] =
        ["whole.png", "merged.png"].map(|name| image::open(path.join(name)).unwrap().into_rgb8().into_raw());
    assert!(whole.iter().zip(&merged).all(|(a, b)| a.abs_diff(*b) <= 1));
}

/// A crop is placed in the whole picture, as programs for compositing expect.
#[test]
fn a_crop_has_its_place_in_the_file() {
    let directory = TempDir::new().unwrap();
    render(directory.path(), "crop.exr", &["--crop", "7,5,20,9"]);
    let meta = exr::meta::MetaData::read_from_file(directory.path().join("crop.exr"), true).unwrap();
    let header = &meta.headers[0];
    let window = header.data_window();
    assert_eq!((window.position.0, window.position.1, window.size.0, window.size.1), (7, 5, 13, 4));
    let whole = header.shared_attributes.display_window;
    assert_eq!((whole.position.0, whole.position.1, whole.size.0, whole.size.1), (0, 0, 40, 30));
}

#[test]
fn what_is_missing_or_does_not_fit_is_named() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    let cpu = |name: &str, arguments: &[&str]| {
        render_paths(path, name, &[&["--cpu", "--spp", "64"], arguments].concat());
    };
    cpu("1.exr", &["--tile", "1/2", "--samples", "0-32"]);
    cpu("2.exr", &["--tile", "1/2", "--samples", "32-64"]);
    cpu("3.exr", &["--tile", "2/2"]);
    merge(path, &["1.exr", "2.exr", "3.exr"], "whole.exr");
    let refused = |parts: &[&str], named: &str| {
        fail(path, &[&["merge"], parts, &["-o", "x.exr"]].concat(), 3, named);
        assert!(!path.join("x.exr").exists());
    };
    refused(&["1.exr", "2.exr"], "the parts have gaps: the pixels of --crop 0,15,40,30 (the parts are 1.exr, 2.exr)");
    refused(
        &["1.exr", "3.exr"],
        "the parts have gaps: --samples 32-64 of --crop 0,0,40,15 (the parts are 1.exr, 3.exr)",
    );
    refused(&["3.exr", "2.exr", "3.exr", "1.exr"], "overlap: both have --samples 0-64 of --crop 0,15,40,30");
    cpu("rows.exr", &["--crop", "3,10,9,20"]);
    refused(&["1.exr", "2.exr", "3.exr", "rows.exr"], "overlap: both have the pixels of --crop 3,10,9,15");

    render_paths(path, "fewer.exr", &["--cpu", "--spp", "32", "--tile", "2/2"]);
    refused(&["1.exr", "2.exr", "fewer.exr"], "n_samples: 64 and 32");
    cpu("filter.exr", &["--tile", "2/2", "--pixel-filter", "box"]);
    refused(&["1.exr", "2.exr", "filter.exr"], "paths: {");
    cpu("seed.exr", &["--tile", "2/2", "--seed", "7"]);
    refused(&["1.exr", "2.exr", "seed.exr"], "seed: 0 and 7");
    cpu("layers.exr", &["--tile", "2/2", "--aov", "depth"]);
    refused(&["1.exr", "2.exr", "layers.exr"], "the layers are `` and `depth.Z`");
    let text = fs::read_to_string(cornell()).unwrap();
    let light = "[[light]]\nkind = \"point\"\nposition = [0.1, 0.1, 0.1]\nintensity = [1.0, 1.0, 1.0]\n";
    fs::write(path.join("cornell.toml"), format!("{text}\n{light}")).unwrap();
    let other = ["render", "cornell.toml", "--size", SIZE, "-q", "--cpu", "--spp", "64", "--integrator", "path"];
    succeed(path, &[&other[..], &["--max-depth", "3", "--tile", "2/2", "-o", "scene.exr"]].concat());
    refused(&["1.exr", "2.exr", "scene.exr"], "scene_hash: ");

    fs::write(path.join("empty.exr"), "").unwrap();
    refused(&["1.exr", "empty.exr"], "empty.exr: ");
    let whole = fs::read(path.join("3.exr")).unwrap();
    fs::write(path.join("cut.exr"), &whole[..whole.len() / 2]).unwrap();
    refused(&["1.exr", "2.exr", "cut.exr"], "cut.exr: ");
    refused(&["none.exr"], "none.exr: ");
    fail(path, &["merge", "1.exr", "-o", "1.exr"], 2, "--output would overwrite `1.exr`");
    fail(path, &["merge", "1.exr", "-o", "x.tif"], 2, "must end in .png or .exr");
    fail(path, &["merge", "-o", "x.png"], 2, "PART");
    assert!(!names(path).iter().any(|name| name.starts_with('x')));
}

/// Replaces bytes of a file that occur once by others of the same number.
fn patched(bytes: &[u8], from: &[u8], to: &[u8]) -> Vec<u8> {
    let places: Vec<_> = (0..bytes.len() - from.len()).filter(|&place| bytes[place..].starts_with(from)).collect();
    assert_eq!((places.len(), from.len()), (1, to.len()));
    [&bytes[..places[0]], to, &bytes[places[0] + from.len()..]].concat()
}

/// Headers are checked before memory is taken for what they promise, and parts of other versions are told apart.
#[test]
fn headers_are_checked_first() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    render_paths(path, "part.exr", &["--cpu", "--spp", "1"]);
    let good = fs::read(path.join("part.exr")).unwrap();
    let refused = |bytes: Vec<u8>, named: &str| {
        fs::write(path.join("bad.exr"), bytes).unwrap();
        fail(path, &["merge", "bad.exr", "-o", "x.exr"], 3, named);
    };
    let window = |x: i32, y: i32| {
        let ends = [0, 0, x, y].map(i32::to_le_bytes).concat();
        [&b"dataWindow\0box2i\0\x10\0\0\0"[..], &ends].concat()
    };
    refused(patched(&good, &window(39, 29), &window(99_999_999, 29)), "which are not those of its crop");
    let crop = |word: &str| format!("\"crop\":\"{word}\"").into_bytes();
    refused(patched(&good, &crop("0,0,40,30"), &crop("0,0,40,99")), "reaches beyond 40x30 pixels");
    let version = concat!("\"version\":\"", env!("CARGO_PKG_VERSION"), "\"");
    let other = version.replace("0.", "7.");
    refused(patched(&good, version.as_bytes(), other.as_bytes()), "kdray 7.");
    let curve = |word: &str| format!("\"tonemap\":\"{word}\"").into_bytes();
    refused(patched(&good, &curve("linear"), &curve("curved")), "`curved` is not one of");
}

/// Returns an OpenEXR file with another text of its record.
fn with_record(bytes: &[u8], change: impl Fn(&str) -> String) -> Vec<u8> {
    let head = b"kdray\0string\0";
    let place = (0..bytes.len()).find(|&place| bytes[place..].starts_with(head)).unwrap() + head.len();
    let (before, rest) = bytes.split_at(place);
    let (n_bytes, rest) = rest.split_at(4);
    let (text, rest) = rest.split_at(u32::from_le_bytes(n_bytes.try_into().unwrap()) as usize);
    let text = change(std::str::from_utf8(text).unwrap());
    [before, &(text.len() as u32).to_le_bytes(), text.as_bytes(), rest].concat()
}

/// Eight channels of 2^29 x 2^29 pixels have a number of bytes that is 0 in 64 bits.
#[test]
fn a_size_beyond_64_bits_is_refused() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    render_paths(path, "part.exr", &["--cpu", "--spp", "1", "--aov", "albedo,depth,id"]);
    let good = fs::read(path.join("part.exr")).unwrap();
    let side = 1 << 29;
    let window = |x: i32, y: i32| {
        let ends = [0, 0, x, y].map(i32::to_le_bytes).concat();
        [&b"dataWindow\0box2i\0\x10\0\0\0"[..], &ends].concat()
    };
    let bytes = patched(&good, &window(39, 29), &window(side - 1, side - 1));
    let bytes = with_record(&bytes, |record| {
        let crop = record.replace("0,0,40,30", &format!("0,0,{side},{side}"));
        let wide = crop.replace("\"width\":40", &format!("\"width\":{side}"));
        wide.replace("\"height\":30", &format!("\"height\":{side}"))
    });
    fs::write(path.join("bad.exr"), bytes).unwrap();
    fail(path, &["merge", "bad.exr", "-o", "x.exr"], 3, "needs");
}

/// An error that quotes the file is one line that a terminal can print.
#[test]
fn errors_do_not_pass_on_control_characters() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    render_paths(path, "part.exr", &["--cpu", "--spp", "1"]);
    let good = fs::read(path.join("part.exr")).unwrap();
    let bytes = with_record(&good, |record| record.replace("\"samples\":\"0-1\"", "\"samples\":\"\u{7f}\""));
    fs::write(path.join("bad.exr"), bytes).unwrap();
    let error = kdray::merge::merge(&[path.join("bad.exr")]).unwrap_err().to_string();
    assert!(error.contains("bad.exr: its record") && !error.chars().any(char::is_control), "{error:?}");
}

/// No flipped bit of a part gets into a picture.
#[test]
fn damage_is_noticed() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    render_paths(path, "part.exr", &["--cpu", "--spp", "16"]);
    let good = fs::read(path.join("part.exr")).unwrap();
    let (picture, _) = contents(&path.join("part.exr"));
    let mut n_refused = 0;
    for turn in 0..60 {
        let mut bytes = good.clone();
        // From the end of the magic number on, in steps that do not fit to the length of rows.
        let place = 8 + turn * (good.len() - 9) / 59;
        bytes[place] ^= 1 << (turn % 8);
        fs::write(path.join("bad.exr"), &bytes).unwrap();
        match kdray::merge::merge(&[path.join("bad.exr")]) {
            Err(error) => {
                n_refused += 1;
                assert!(error.to_string().contains("bad.exr: "), "{error}");
            }
            // A bit that no reader looks at, such as one of the offsets of blocks, may differ.
            Ok(merged) => {
                let red = merged.picture.radiance.iter().map(|pixel| pixel[0].to_bits());
                let expected = &picture.iter().find(|(name, _)| name == "R").unwrap().1;
                assert!(red.eq(expected.iter().copied()), "bit {} of byte {place}", turn % 8);
            }
        }
    }
    assert!(n_refused > 40, "{n_refused}");
}

#[test]
fn samples_that_cannot_be_joined_are_refused() {
    let directory = TempDir::new().unwrap();
    let scene = cornell();
    let refused = |arguments: &[&str], named: &str| {
        let all = [&["render", &scene, "--size", SIZE, "-o", "x.exr", "--cpu"], arguments].concat();
        fail(directory.path(), &all, 2, named);
    };
    let paths = ["--integrator", "path", "--samples"];
    refused(&["--integrator", "whitted", "--samples", "0-16"], "--samples needs --integrator path");
    refused(&[&paths[..], &["0-32", "--denoise", "paper"]].concat(), "--samples needs --denoise off");
    refused(&[&paths[..], &["0-128"]].concat(), "--samples 0-128 reaches beyond the picture's 64 samples");
    refused(&[&paths[..], &["0-8"]].concat(), "both numbers must be multiples of 16");
    refused(&[&paths[..], &["96-90"]].concat(), "the range is empty");
    let picture = ["render", &scene, "--cpu", "--integrator", "path", "--samples", "0-16"];
    for output in [&[][..], &["-o", "x.png"]] {
        fail(directory.path(), &[&picture, output].concat(), 2, "--samples needs --output FILE.exr");
    }
    for tile in ["0/4", "5/4", "1", "1/0", "a/b", "-1/2"] {
        refused(&[&format!("--tile={tile}")], "expected I/N");
    }
    refused(&["--tile", "1/31"], "the picture has 30 rows");
    refused(&["--tile", "1/2", "--crop", "0,0,1,1"], "--crop");
}
