//! The examples run, and show what they should.

mod support;

use std::{path::PathBuf, process::Command};

use support::command::{shipped, succeed};
use tempfile::TempDir;

/// Runs an example, which `cargo test` builds unless it is told to run certain tests only. Gives what it prints.
fn run(example: &str, arguments: &[&str]) -> String {
    let folder = PathBuf::from(env!("CARGO_BIN_EXE_kdray")).with_file_name("examples");
    let output = Command::new(folder.join(example)).args(arguments).output().expect("the example runs");
    assert!(output.status.success(), "{example}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}

#[test]
fn render_writes_the_picture_that_the_command_writes() {
    let directory = TempDir::new().unwrap();
    let path = |name: &str| directory.path().join(name).to_str().unwrap().to_owned();
    let printed = run("render", &[&shipped("cornell.toml"), &path("example.png")]);
    assert!(printed.starts_with(&path("example.png")), "{printed}");
    succeed(directory.path(), &["render", &shipped("cornell.toml"), "-q", "-o", "command.png"]);
    let bytes = |name: &str| std::fs::read(path(name)).unwrap();
    assert!(bytes("example.png") == bytes("command.png"));
}

/// The box is open in front: its five walls fill the picture but for its corners.
#[test]
fn cast_draws_the_materials_that_the_camera_sees() {
    let printed = run("cast", &[&shipped("cornell.toml")]);
    let rows: Vec<Vec<char>> = printed.lines().map(|line| line.chars().collect()).collect();
    assert_eq!((rows.len(), rows[0].len()), (28, 64));
    let (left, right) = (rows[14][8], rows[14][55]);
    assert!(left != right && left != ' ' && right != ' ', "{printed}");
    assert_eq!(rows[0][0], ' ', "{printed}");
}
