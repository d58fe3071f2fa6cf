//! Runs the examples, and tests that they show what they should.

use std::{path::PathBuf, process::Command};

use crate::support::{
    command::{pixels, shipped, succeed},
    kept,
};
use tempfile::TempDir;

/// Runs an example and returns what it prints. `cargo test` builds the examples, unless it runs only certain tests.
fn run(example: &str, arguments: &[&str]) -> String {
    let folder = PathBuf::from(env!("CARGO_BIN_EXE_kdray")).with_file_name("examples");
    let output = Command::new(folder.join(example)).args(arguments).output().expect("the example runs");
    assert!(output.status.success(), "{example}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}

#[test]
fn render_writes_the_picture_that_the_command_writes() {
    if kept::leaves_out("the example flattens") {
        return;
    }
    let directory = TempDir::new().unwrap();
    let path = |name: &str| directory.path().join(name).to_str().unwrap().to_owned();
    let printed = run("render", &[&shipped("cornell.toml"), &path("example.png")]);
    assert!(printed.starts_with(&path("example.png")), "{printed}");
    succeed(directory.path(), &["render", &shipped("cornell.toml"), "-q", "-o", "command.png"]);
    let pixels = |name: &str| pixels(path(name).as_ref());
    assert!(pixels("example.png") == pixels("command.png"));
}

/// The box is open in front. Its five walls fill the picture but for the corners.
#[test]
fn cast_draws_the_materials_that_the_camera_sees() {
    let printed = run("cast", &[&shipped("cornell.toml")]);
    let rows: Vec<Vec<char>> = printed.lines().map(|line| line.chars().collect()).collect();
    assert_eq!((rows.len(), rows[0].len()), (28, 64));
    let (left, right) = (rows[14][8], rows[14][55]);
    assert!(left != right && left != ' ' && right != ' ', "{printed}");
    assert_eq!(rows[0][0], ' ', "{printed}");
}

/// Runs an example under the validation layer with synchronization validation. There must be no messages.
fn run_validated(example: &str, arguments: &[&str]) -> String {
    let folder = PathBuf::from(env!("CARGO_BIN_EXE_kdray")).with_file_name("examples");
    let output = Command::new(folder.join(example))
        .args(arguments)
        .env("VK_INSTANCE_LAYERS", "VK_LAYER_KHRONOS_validation")
        .env("VK_LAYER_ENABLES", "VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT")
        .output()
        .expect("the example runs");
    let [printed, errors] = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    assert!(output.status.success(), "{example}: {errors}");
    assert!(!printed.contains("Validation") && !errors.contains("Validation"), "{example}: {printed}{errors}");
    printed
}

#[test]
fn a_program_with_a_device_of_its_own_gets_the_picture_that_the_command_writes() {
    if kept::leaves_out("the example flattens") {
        return;
    }
    let directory = TempDir::new().unwrap();
    let path = |name: &str| directory.path().join(name).to_str().unwrap().to_owned();
    run_validated("own_device", &[&shipped("cornell.toml"), &path("example.png")]);
    succeed(directory.path(), &["render", &shipped("cornell.toml"), "-q", "-o", "command.png"]);
    let pixels = |name: &str| image::open(path(name)).unwrap().into_rgb8();
    assert!(pixels("example.png") == pixels("command.png"));
}

/// The box is open in front, so not all rays hit it.
#[test]
fn a_program_casts_in_its_own_command_buffer() {
    let printed = run_validated("record_cast", &[&shipped("cornell.toml")]);
    let n_hits: u32 = printed.split(' ').next().and_then(|word| word.parse().ok()).expect("a number");
    assert!((60_000..95_000).contains(&n_hits), "{printed}");
}
