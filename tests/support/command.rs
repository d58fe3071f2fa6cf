//! Runs the command `kdray` as its users do.

use std::{
    fs,
    io::{BufRead, BufReader},
    path::{Path, PathBuf},
    process::{Child, Command, Output, Stdio},
    sync::mpsc::{Receiver, channel},
    thread,
    time::{Duration, Instant},
};

use super::kept;

/// Time limit of each wait in the tests. It is longer than anything that they wait for takes on a busy machine.
/// Pictures that take seconds alone have taken more than two minutes beside ten busy programs on two cores.
pub const PATIENCE: Duration = Duration::from_secs(600);

/// An environment variable that makes the validation layer complain of what is no error, and its value: advice for a
/// vendor's GPUs, which kdray does not follow. Such a message stands in for an error.
pub const COMPLAINTS: (&str, &str) = (
    "VK_LAYER_ENABLES",
    "VK_VALIDATION_FEATURE_ENABLE_BEST_PRACTICES_EXT:VALIDATION_CHECK_ENABLE_VENDOR_SPECIFIC_NVIDIA",
);

/// Returns the command with arguments, to be run in a directory.
pub fn kdray(directory: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_kdray"));
    // Tests do not depend on what a user has measured.
    command.current_dir(directory).args(arguments).env("KDRAY_CACHE", "").stdin(Stdio::null());
    let has_instances =
        matches!(arguments.first(), Some(&("render" | "cast" | "view"))) && !arguments.contains(&"--instances");
    if has_instances && kept::is_asked_for() {
        command.args(["--instances", "keep"]);
    }
    command
}

/// Lets a command lose its device at a queue submit. Builds the Vulkan layer that simulates this in a directory.
pub fn lose_device_at(command: &mut Command, submit: u32, directory: &Path) {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/support/lose_device.c");
    let library = directory.join("lose_device.so");
    if !library.exists() {
        let compiled = Command::new("cc").args(["-shared", "-fPIC", "-o"]).arg(&library).arg(source).status();
        assert!(compiled.expect("cc, which Rust links with").success());
        let manifest = r#"{"file_format_version": "1.1.0", "layer": {"name": "VK_LAYER_lose_device", "type": "GLOBAL",
            "library_path": "./lose_device.so", "api_version": "1.3.0",
            "implementation_version": "1", "description": ""}}"#;
        fs::write(directory.join("lose_device.json"), manifest).unwrap();
    }
    command.env("VK_LAYER_PATH", directory).env("VK_INSTANCE_LAYERS", "VK_LAYER_lose_device");
    command.env("LOSE_DEVICE_AT", submit.to_string());
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

/// The lines that a running command writes to its standard error, which has to be piped.
pub struct Messages(Receiver<String>);

impl Messages {
    /// Reads the lines on a thread of its own, so that the command never waits for the test.
    pub fn of(command: &mut Child) -> Self {
        let (send, receive) = channel();
        let lines = BufReader::new(command.stderr.take().expect("a pipe")).lines();
        // Sending fails when the test has ended.
        thread::spawn(move || lines.map_while(Result::ok).for_each(|line| drop(send.send(line))));
        Self(receive)
    }

    /// Waits for the next line that contains `part` and returns it. The lines before it are dropped.
    ///
    /// # Panics
    /// No such line comes in time.
    pub fn wait_for(&self, part: &str) -> String {
        let begin = Instant::now();
        loop {
            let line = self.0.recv_timeout(PATIENCE.saturating_sub(begin.elapsed()));
            let line = line.unwrap_or_else(|error| panic!("no message contains `{part}`: {error}"));
            if line.contains(part) {
                return line;
            }
        }
    }
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
