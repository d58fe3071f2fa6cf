//! Tests that pictures are written bit for bit, and whole or not at all.

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::Command,
};

use kdray::{
    frame::{Aov, Picture},
    layout::PixelAovs,
    output::{self, Format, OutputError},
};
use tempfile::TempDir;

/// Returns a picture of noise that compresses badly, with floats that a careless conversion would change.
fn picture(width: u32, height: u32) -> Picture {
    let n_pixels = width * height;
    let mut state = 1_u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        state
    };
    let special = [0.0, -0.0, f32::MIN_POSITIVE / 4.0, 65_520.0, 1e30, f32::INFINITY, 0.1, 1.0 / 3.0];
    Picture {
        width,
        height,
        radiance: (0..n_pixels)
            .map(|i| [special[i as usize % special.len()], next() as f32 / 7e8, -(next() as f32), 1.0])
            .collect(),
        display: (0..n_pixels)
            .map(|_| [(next() >> 24) as u8, (next() >> 24) as u8, (next() >> 24) as u8, 255])
            .collect(),
    }
}

fn names(directory: &Path) -> Vec<String> {
    let mut names: Vec<_> =
        fs::read_dir(directory).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// Returns the bits of every RGB value, so that -0 differs from 0.
fn bits(rgba: &[[f32; 4]]) -> Vec<[u32; 3]> {
    rgba.iter().map(|&[r, g, b, _]| [r, g, b].map(f32::to_bits)).collect()
}

#[test]
fn png_holds_the_display_values() {
    let directory = TempDir::new().unwrap();
    for (width, height) in [(1, 1), (1, 7), (67, 41)] {
        let picture = picture(width, height);
        let path = directory.path().join("x.png");
        output::write_picture(&path, &picture).unwrap();
        let read = image::open(&path).unwrap();
        assert_eq!(read.color(), image::ColorType::Rgb8);
        assert_eq!((read.width(), read.height()), (width, height));
        let expected: Vec<u8> = picture.display.iter().flat_map(|&[r, g, b, _]| [r, g, b]).collect();
        assert_eq!(read.into_bytes(), expected);
    }
    assert_eq!(names(directory.path()), ["x.png"]);
}

#[test]
fn exr_holds_the_radiance_bit_for_bit() {
    let directory = TempDir::new().unwrap();
    for (width, height) in [(1, 1), (1, 7), (67, 41)] {
        let picture = picture(width, height);
        let path = directory.path().join("x.EXR");
        output::write_picture(&path, &picture).unwrap();
        let read = image::open(&path).unwrap();
        assert_eq!(read.color(), image::ColorType::Rgb32F);
        assert_eq!((read.width(), read.height()), (width, height));
        let read: Vec<_> = read.to_rgb32f().pixels().map(|pixel| pixel.0.map(f32::to_bits)).collect();
        assert_eq!(read, bits(&picture.radiance));
    }
    assert_eq!(names(directory.path()), ["x.EXR"]);
}

#[test]
fn the_same_picture_is_the_same_file() {
    let directory = TempDir::new().unwrap();
    let picture = picture(700, 500);
    for name in ["x.exr", "x.png"] {
        let path = directory.path().join(name);
        let write = || {
            output::write_picture(&path, &picture).unwrap();
            fs::read(&path).unwrap()
        };
        let first = write();
        assert!((0..20).all(|_| write() == first), "{name}");
    }
}

#[test]
fn pixel_aovs_that_contradict_the_size_are_an_error() {
    let directory = TempDir::new().unwrap();
    let path = directory.path().join("x.exr");
    for n in [0, 3, 5] {
        let pixel_aovs = vec![PixelAovs::default(); n];
        let error = output::write_layers(
            &path,
            &picture(2, 2),
            &output::Layers { aovs: &[Aov::Depth], pixel_aovs: &pixel_aovs, ..Default::default() },
        )
        .unwrap_err();
        assert!(matches!(error, OutputError::Encode { .. }), "{error}");
    }
    assert!(names(directory.path()).is_empty());
}

#[test]
fn a_name_without_a_known_ending_is_refused() {
    for name in ["x", "x.", "x.jpg", "png", ".png", "x.png.gz", ""] {
        let error = output::write_picture(Path::new(name), &picture(1, 1)).unwrap_err();
        assert!(matches!(error, OutputError::UnknownEnding { .. }), "{name}: {error}");
    }
    assert_eq!(Format::of(Path::new("a.b/c.PnG")).unwrap(), Format::Png);
}

#[test]
fn a_picture_that_contradicts_its_size_is_an_error() {
    let directory = TempDir::new().unwrap();
    let picture = Picture { width: 3, ..picture(2, 2) };
    for name in ["x.png", "x.exr"] {
        let error = output::write_picture(&directory.path().join(name), &picture).unwrap_err();
        assert!(matches!(error, OutputError::Encode { .. }), "{error}");
    }
    assert!(names(directory.path()).is_empty());
}

/// The directory is a file or is missing. Permission bits would not stop a test that runs as root.
#[test]
fn a_directory_that_cannot_take_a_file_is_an_error() {
    let directory = TempDir::new().unwrap();
    let file = directory.path().join("file");
    fs::write(&file, "kept").unwrap();
    for parent in [file.clone(), file.join("below"), directory.path().join("missing")] {
        let path = parent.join("x.png");
        for error in [output::check(&path), output::write_picture(&path, &picture(1, 1))].map(Result::unwrap_err) {
            assert!(matches!(error, OutputError::NoDirectory { .. }), "{error}");
            assert!(error.to_string().contains("x.png") && !error.to_string().contains('\n'), "{error}");
        }
    }
    let path = directory.path().join("x.png");
    fs::create_dir(&path).unwrap();
    for error in [output::check(&path), output::write_picture(&path, &picture(1, 1))].map(Result::unwrap_err) {
        assert!(matches!(error, OutputError::IsDirectory { .. }), "{error}");
    }
    assert_eq!(names(directory.path()), ["file", "x.png"]);
    assert_eq!(fs::read(&file).unwrap(), b"kept");
}

#[test]
fn checking_leaves_nothing_behind_and_changes_nothing() {
    let directory = TempDir::new().unwrap();
    let path = directory.path().join("x.png");
    output::check(&path).unwrap();
    assert!(names(directory.path()).is_empty());
    fs::write(&path, "old").unwrap();
    output::check(&path).unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"old");
    assert_eq!(names(directory.path()), ["x.png"]);
}

#[cfg(unix)]
mod unix {
    use std::os::unix::fs::{PermissionsExt, symlink};

    use super::*;

    const CHILD: &str = "KDRAY_TEST_FULL_DISK";

    fn mode(path: &Path) -> u32 {
        fs::metadata(path).unwrap().permissions().mode() & 0o777
    }

    /// A limit on the size of files simulates a full disk: `write` fails half-way, and no privileges are needed.
    #[test]
    fn a_disk_that_fills_up_leaves_what_was_there() {
        if let Some(path) = env::var_os(CHILD) {
            let path = PathBuf::from(path);
            output::check(&path).unwrap();
            let error = output::write_picture(&path, &picture(256, 256)).unwrap_err();
            assert!(matches!(error, OutputError::Write { .. }), "{error}");
            return;
        }
        let directory = TempDir::new().unwrap();
        let old = directory.path().join("old.exr");
        fs::write(&old, "old").unwrap();
        for name in ["old.exr", "new.exr", "new.png"] {
            let child = Command::new("sh")
                .args(["-c", "trap '' XFSZ; ulimit -f 16; exec \"$0\" \"$@\""])
                .arg(env::current_exe().unwrap())
                .args(["--exact", "unix::a_disk_that_fills_up_leaves_what_was_there"])
                .env(CHILD, directory.path().join(name))
                .output()
                .unwrap();
            let report = String::from_utf8_lossy(&child.stdout);
            assert!(child.status.success() && report.contains("1 passed"), "{name}: {report}");
            assert_eq!(names(directory.path()), ["old.exr"], "{name}");
            assert_eq!(fs::read(&old).unwrap(), b"old");
        }
    }

    #[test]
    fn a_device_is_written_to_directly_and_its_error_reported() {
        let directory = TempDir::new().unwrap();
        // macOS has no /dev/full.
        let devices = [("/dev/full", false), ("/dev/null", true)].into_iter();
        for (device, fits) in devices.filter(|(device, _)| Path::new(device).exists()) {
            let path = directory.path().join("x.png");
            symlink(device, &path).unwrap();
            output::check(&path).unwrap();
            let written = output::write_picture(&path, &picture(9, 9));
            assert_eq!(written.is_ok(), fits, "{device}");
            assert_eq!(fs::read_link(&path).unwrap(), Path::new(device));
            fs::remove_file(&path).unwrap();
            assert!(names(directory.path()).is_empty());
        }
    }

    #[test]
    fn a_link_is_followed_to_its_file() {
        let directory = TempDir::new().unwrap();
        let (link, file) = (directory.path().join("x.png"), directory.path().join("file"));
        fs::write(&file, "old").unwrap();
        symlink("file", &link).unwrap();
        output::write_picture(&link, &picture(2, 2)).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(&fs::read(&file).unwrap()[1..4], b"PNG");
        assert_eq!(names(directory.path()), ["file", "x.png"]);
    }

    /// The picture's path is a link to a link to a file in another directory. The file does not exist yet.
    #[test]
    fn a_link_that_leads_nowhere_gets_the_file_it_names() {
        let directory = TempDir::new().unwrap();
        let path = |name: &str| directory.path().join(name);
        fs::create_dir(path("a")).unwrap();
        symlink("a/second", path("first.png")).unwrap();
        symlink("../third", path("a/second")).unwrap();
        output::check(&path("first.png")).unwrap();
        assert_eq!(names(directory.path()), ["a", "first.png"]);
        output::write_picture(&path("first.png"), &picture(2, 2)).unwrap();
        assert_eq!(names(directory.path()), ["a", "first.png", "third"]);
        assert_eq!(names(&path("a")), ["second"]);
        assert_eq!(fs::read_link(path("first.png")).unwrap(), Path::new("a/second"));
        assert_eq!(&fs::read(path("third")).unwrap()[1..4], b"PNG");
    }

    #[test]
    fn a_link_into_no_directory_or_a_circle_is_an_error() {
        let directory = TempDir::new().unwrap();
        let path = |name: &str| directory.path().join(name);
        symlink("missing/x", path("nowhere.png")).unwrap();
        symlink("circle.png", path("circle.png")).unwrap();
        for name in ["nowhere.png", "circle.png"] {
            assert!(output::check(&path(name)).is_err(), "{name}");
            let error = output::write_picture(&path(name), &picture(1, 1)).unwrap_err();
            assert!(error.to_string().contains(name), "{error}");
        }
        assert_eq!(names(directory.path()), ["circle.png", "nowhere.png"]);
    }

    #[test]
    fn a_file_is_the_same_by_whatever_name() {
        let directory = TempDir::new().unwrap();
        let path = |name: &str| directory.path().join(name);
        fs::create_dir(path("a")).unwrap();
        symlink("a", path("b")).unwrap();
        symlink("b/x.png", path("link")).unwrap();
        let same = ["a/x.png", "b/x.png", "a/../a/./x.png", "link"];
        let file = output::regular_file(&path("a/x.png")).unwrap();
        for is_there in [false, true] {
            for name in same {
                assert_eq!(output::regular_file(&path(name)), Some(file.clone()), "{name}, {is_there}");
            }
            fs::write(path("a/x.png"), "").unwrap();
        }
        assert_ne!(output::regular_file(&path("a/y.png")), Some(file));
        assert_eq!(output::regular_file(Path::new("/dev/null")), None);
        assert_eq!(output::regular_file(&path("a")), None);
    }

    #[test]
    fn a_new_file_gets_the_umask_and_an_old_one_keeps_its_permissions() {
        let directory = TempDir::new().unwrap();
        let plain = directory.path().join("plain");
        fs::write(&plain, "").unwrap();
        let path = directory.path().join("x.png");
        output::write_picture(&path, &picture(2, 2)).unwrap();
        assert_eq!(mode(&path), mode(&plain));
        fs::set_permissions(&path, fs::Permissions::from_mode(0o640)).unwrap();
        output::write_picture(&path, &picture(3, 2)).unwrap();
        assert_eq!(mode(&path), 0o640);
    }
}
