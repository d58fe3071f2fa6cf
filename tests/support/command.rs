//! Runs the command `kdray` as its users do.

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
};

/// Returns the command with arguments, to be run in a directory.
pub fn kdray(directory: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_kdray"));
    // Tests do not depend on what a user has measured.
    command.current_dir(directory).args(arguments).env("KDRAY_CACHE", "").stdin(Stdio::null());
    command
}

pub fn cornell() -> String {
    shipped("cornell.toml")
}

/// Returns the path of a scene that comes with the program.
pub fn shipped(scene: &str) -> String {
    let path: PathBuf = [env!("CARGO_MANIFEST_DIR"), "scenes", scene].iter().collect();
    path.into_os_string().into_string().unwrap()
}

pub fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

pub fn stderr(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!text.contains("panicked"), "{text}");
    text
}

/// Runs the command, which has to succeed.
pub fn succeed(directory: &Path, arguments: &[&str]) -> Output {
    let output = kdray(directory, arguments).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", stderr(&output));
    output
}

/// Runs the command, which has to fail with an exit code and one line that names what went wrong.
pub fn fail(directory: &Path, arguments: &[&str], code: i32, named: &str) {
    let output = kdray(directory, arguments).output().unwrap();
    let text = stderr(&output);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {text}");
    let errors: Vec<_> = text.lines().filter(|line| line.starts_with("error: ")).collect();
    assert_eq!(errors.len(), 1, "{arguments:?}: {text}");
    assert_eq!(text.lines().last(), Some(errors[0]), "{arguments:?}");
    assert!(errors[0].contains(named), "{arguments:?}: {} does not name {named}", errors[0]);
    assert!(output.stdout.is_empty(), "{arguments:?}: {}", stdout(&output));
}

/// Returns the colours of a picture's file, without what the file says of its origin.
pub fn pixels(path: &Path) -> Vec<f32> {
    image::open(path).unwrap().into_rgb32f().into_raw()
}

/// Returns the sorted names of the files in a directory.
pub fn names(directory: &Path) -> Vec<String> {
    let mut names: Vec<_> =
        fs::read_dir(directory).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}
