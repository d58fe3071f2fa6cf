//! Tests of films that all devices of this machine draw together. `.ci/run` runs them once more with two software
//! drivers, whose pictures differ in their last bits.

mod support;

use std::{collections::BTreeSet, env, fs, path::Path};

use kdray::gpu::{self, DeviceInfo};
use support::command::{cornell, names, stderr, stdout, succeed};
use tempfile::TempDir;

const PATH: &str = "[[keyframe]]\nframe = 0\neye = [0, 2.75, 10.7]\ntarget = [0, 2.75, 0]\n\
                    [[keyframe]]\nframe = 9\neye = [2, 2.75, 9.5]\ntarget = [0, 2, 0]\n";

/// Returns the devices that can render.
fn usable_devices() -> Vec<DeviceInfo> {
    let devices: Vec<_> = gpu::devices().unwrap().into_iter().filter(|it| it.missing.is_empty()).collect();
    let drivers: BTreeSet<_> = devices.iter().map(|it| &it.driver).collect();
    let n_named = env::var("VK_DRIVER_FILES").map_or(1, |files| files.split(':').count());
    assert!(drivers.len() >= n_named, "VK_DRIVER_FILES names {n_named} drivers, and these are found: {drivers:?}");
    devices
}

/// Returns the files of the frames of a film that devices have drawn, and what the command printed.
fn film(path: &Path, devices: &str, more: &[&str]) -> (Vec<Vec<u8>>, String) {
    let folder = path.join(devices);
    fs::create_dir_all(&folder).unwrap();
    let output = format!("{devices}/####.exr");
    let common = ["render", &cornell(), "--size", "32x24", "--path", "path.toml", "-o", &output, "--device", devices];
    let printed = succeed(path, &[&common, more].concat());
    let frames = names(&folder).iter().map(|name| fs::read(folder.join(name)).unwrap()).collect();
    (frames, stdout(&printed) + &stderr(&printed))
}

/// The record of a picture that all devices have drawn together names each kind once.
#[test]
fn a_picture_of_all_devices_names_each_kind_once() {
    let directory = TempDir::new().unwrap();
    let devices = usable_devices();
    let list: Vec<_> = devices.iter().chain(&devices).map(|it| it.index.to_string()).collect();
    let common = ["render", &cornell(), "--size", "16x12", "-o", "a.exr", "--device", &list.join(",")];
    succeed(directory.path(), &common);
    let mut names: Vec<&str> = Vec::new();
    devices.iter().for_each(|it| {
        if !names.contains(&it.name.as_str()) {
            names.push(&it.name)
        }
    });
    let expected = format!(r#""device":"{}","#, names.join("; "));
    let bytes = fs::read(directory.path().join("a.exr")).unwrap();
    assert!(bytes.windows(expected.len()).any(|part| part == expected.as_bytes()), "{expected}");
}

/// Each frame has the bytes of the file that its device writes alone, with the name of this device. A note says so if
/// the devices are of several kinds.
#[test]
fn each_frame_is_the_one_of_its_device() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    fs::write(path.join("path.toml"), PATH).unwrap();
    let devices = usable_devices();
    let kind = |device: &DeviceInfo| format!("{}, {}", device.name, device.driver);
    let kinds: BTreeSet<String> = devices.iter().map(kind).collect();
    // A single device is named twice.
    let indices: Vec<_> = devices.iter().chain(&devices).take(devices.len().max(2)).map(|it| it.index).collect();
    let list = indices.iter().map(ToString::to_string).collect::<Vec<_>>().join(",");
    let frames = format!("0-{}", 4 * indices.len() - 1);
    for more in [&["--integrator", "path", "--spp", "16"][..], &["--spp", "2", "--aov", "depth"]] {
        let more = [more, &["--primary", "trace", "--frames", &frames]].concat();
        let alone: Vec<_> = devices.iter().map(|it| (kind(it), film(path, &it.index.to_string(), &more).0)).collect();
        let named = kinds.iter().cloned().collect::<Vec<_>>().join("; ");
        let note = format!("note: the devices are of several kinds, which may round in different ways: {named}");
        let mut seen = BTreeSet::new();
        // On a busy machine, one device may draw all frames of a film before another one begins.
        for _ in 0..20 {
            let (together, printed) = film(path, &list, &more);
            assert_eq!(together.len(), 4 * indices.len());
            assert!(printed.contains(&format!("{} devices: each drew whole frames", indices.len())), "{printed}");
            assert_eq!(printed.lines().any(|line| line == note), kinds.len() > 1, "{printed}");
            for (ix, frame) in together.iter().enumerate() {
                let drawn_by = alone.iter().find(|(_, frames)| frames[ix] == *frame);
                seen.insert(&drawn_by.unwrap_or_else(|| panic!("no device draws frame {ix} alone as it is")).0);
            }
            if seen.len() == kinds.len() {
                break;
            }
        }
        assert_eq!(seen.len(), kinds.len(), "devices of all kinds have drawn frames");
    }
}
