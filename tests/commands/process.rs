//! Tests what ends the command from outside: signals while it works, and limits on the size of files and on memory.

use std::{
    fs::{self, File},
    io::{BufRead, BufReader, Read},
    os::unix::process::ExitStatusExt,
    path::Path,
    process::{Child, ChildStdout, Command, ExitStatus, Output, Stdio},
    thread,
    time::{Duration, Instant},
};

use crate::support::{
    command::{Messages, PATIENCE, cornell, kdray, names, pixels, shipped, stderr, succeed},
    kept,
};
use npyz::WriterBuilder;
use rustix::process::{Pid, Signal, kill_process};
use tempfile::TempDir;

const N_RAYS: u64 = 1_500_000;

/// Creates a directory with a triangle and so many rays that writing their hits takes a while.
fn with_rays() -> TempDir {
    let directory = TempDir::new().unwrap();
    fs::write(directory.path().join("mesh.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let file = std::io::BufWriter::new(File::create(directory.path().join("rays.npy")).unwrap());
    let mut array = npyz::WriteOptions::new().default_dtype().shape(&[N_RAYS, 6]).writer(file).begin_nd().unwrap();
    for ix in 0..N_RAYS {
        let x = ix as f32 / N_RAYS as f32;
        [x, 0.25, 1.0, 0.0, 0.0, -1.0].iter().for_each(|number| array.push(number).unwrap());
    }
    array.finish().unwrap();
    directory
}

const CAST: [&str; 9] = ["cast", "mesh.obj", "rays.npy", "-o", "hits.npz", "--cpu", "-q", "--threads", "2"];

/// Returns a command that signals can end, even if the tests run with these signals ignored. A shell ignores SIGINT
/// for jobs in the background.
fn interruptible(directory: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new("env");
    command.args(["--default-signal=INT,HUP,TERM", env!("CARGO_BIN_EXE_kdray")]).args(arguments);
    command.current_dir(directory).stdin(Stdio::null());
    command
}

/// Returns whether the command has begun to write a file under a temporary name.
fn has_begun_to_write(directory: &Path) -> bool {
    fs::read_dir(directory).unwrap().flatten().any(|entry| {
        let is_temporary = entry.file_name().to_string_lossy().starts_with(".kdray-");
        is_temporary && entry.metadata().is_ok_and(|metadata| metadata.len() > 0)
    })
}

/// Waits until a condition holds, or the child has ended.
fn wait_until(child: &mut Child, is_so: impl Fn() -> bool) {
    let start = Instant::now();
    while !is_so() && child.try_wait().unwrap().is_none() {
        assert!(start.elapsed() < PATIENCE, "it never came to that");
        thread::sleep(Duration::from_micros(200));
    }
}

fn send(child: &Child, signal: Signal) {
    // It is not an error if the child has just ended.
    let _ = kill_process(Pid::from_child(child), signal);
}

/// Waits for the end of a child that was sent a signal.
fn end_of(child: &mut Child) -> ExitStatus {
    let start = Instant::now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return status;
        }
        assert!(start.elapsed() < PATIENCE, "the signal did not end it");
        thread::sleep(Duration::from_millis(1));
    }
}

/// Casts the rays and sends the signals `delay` after the command has begun to write hits. Returns its exit status.
fn interrupt(directory: &Path, signals: &[Signal], delay: Duration) -> ExitStatus {
    let mut child = interruptible(directory, &CAST).stderr(Stdio::null()).spawn().unwrap();
    wait_until(&mut child, || has_begun_to_write(directory));
    thread::sleep(delay);
    signals.iter().for_each(|signal| send(&child, *signal));
    end_of(&mut child)
}

#[test]
fn a_signal_leaves_the_target_whole_or_as_it_was_and_no_other_file() {
    let directory = with_rays();
    let target = directory.path().join("hits.npz");
    assert!(kdray(directory.path(), &CAST).status().unwrap().success());
    let whole = fs::read(&target).unwrap();
    let mut n_interrupted = 0;
    let all = [&[Signal::INT][..], &[Signal::TERM], &[Signal::HUP], &[Signal::INT, Signal::INT, Signal::TERM]];
    // On a busy machine, the command often ends before a signal reaches it.
    for (turn, signals) in all.iter().cycle().enumerate() {
        if turn >= 16 && n_interrupted >= 4 {
            break;
        }
        assert!(turn < 400, "only {n_interrupted} of {turn} were interrupted while they wrote");
        let before: &[u8] = if turn % 2 == 0 { b"old" } else { &whole[..0] };
        if before.is_empty() {
            let _ = fs::remove_file(&target);
        } else {
            fs::write(&target, before).unwrap();
        }
        let status = interrupt(directory.path(), signals, Duration::from_millis(turn as u64 % 16 * 4));
        match status.signal() {
            Some(signal) => {
                assert!(signals.iter().any(|sent| sent.as_raw() == signal), "{status}");
                n_interrupted += 1;
                // The target may have been completed just before.
                let found = fs::read(&target).unwrap_or_default();
                assert!(found == before || found == whole, "turn {turn}: {} bytes", found.len());
                let others: Vec<_> = names(directory.path()).into_iter().filter(|name| name != "hits.npz").collect();
                assert_eq!(others, ["mesh.obj", "rays.npy"], "turn {turn}, {signals:?}");
            }
            None => assert!(status.success() && fs::read(&target).unwrap() == whole, "turn {turn}: {status}"),
        }
    }
}

#[test]
fn a_signal_that_was_ignored_stays_ignored() {
    let directory = with_rays();
    let mut child = Command::new("sh")
        .args(["-c", "trap '' HUP; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_kdray")])
        .args(CAST)
        .current_dir(directory.path())
        .spawn()
        .unwrap();
    wait_until(&mut child, || has_begun_to_write(directory.path()));
    send(&child, Signal::HUP);
    assert!(end_of(&mut child).success());
    assert_eq!(names(directory.path()), ["hits.npz", "mesh.obj", "rays.npy"]);
}

/// Without a complete sample, there is nothing to write.
#[test]
fn a_long_rendering_ends_at_once() {
    let directory = TempDir::new().unwrap();
    let scene = cornell();
    let arguments =
        ["render", &scene, "--cpu", "--size", "2000x1500", "--integrator", "path", "--spp", "16", "-o", "x.png"];
    for signal in [Signal::INT, Signal::TERM] {
        let log = directory.path().join("log");
        let mut child =
            interruptible(directory.path(), &arguments).stderr(File::create(&log).unwrap()).spawn().unwrap();
        wait_until(&mut child, || fs::read_to_string(&log).unwrap().contains("rendering"));
        let sent = Instant::now();
        send(&child, signal);
        assert_eq!(end_of(&mut child).signal(), Some(signal.as_raw()));
        assert!(sent.elapsed() < Duration::from_secs(10), "{:?}", sent.elapsed());
        assert_eq!(names(directory.path()), ["log"]);
    }
}

/// Small pictures of paths.
const SMALL: [&str; 7] = ["--cpu", "--size", "64x48", "--integrator", "path", "--denoise", "off"];

/// A rendering that has at least one complete sample, with its files and what it prints.
struct Begun {
    directory: TempDir,
    child: Child,
    messages: Messages,
    report: BufReader<ChildStdout>,
}

impl Begun {
    /// Begins to render scenes with very many samples. A scheduler's progress tells when samples are complete: loading
    /// and building are the first tenth of a scene.
    fn render(scenes: &[&str], more: &[&str]) -> Self {
        let directory = TempDir::new().unwrap();
        let common = ["--spp", "65536", "--progress", "openjd"];
        let mut command = interruptible(directory.path(), &[&["render"], scenes, &SMALL, &common, more].concat());
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let messages = Messages::of(&mut child);
        let mut report = BufReader::new(child.stdout.take().unwrap());
        let least = 10.1 / scenes.len() as f64;
        let has_samples = |line: &str| {
            let percent = line.strip_prefix("openjd_progress: ").map(|percent| percent.trim().parse::<f64>().unwrap());
            percent.is_some_and(|percent| percent >= least)
        };
        let mut line = String::new();
        while !has_samples(&line) {
            line.clear();
            assert!(report.read_line(&mut line).unwrap() > 0, "it has ended");
        }
        Self { directory, child, messages, report }
    }

    fn files(&self) -> Vec<String> {
        names(self.directory.path())
    }

    /// Returns how the command has ended, and the rest of what it has printed.
    fn end(&mut self) -> (ExitStatus, String) {
        let status = end_of(&mut self.child);
        let mut rest = String::new();
        self.report.read_to_string(&mut rest).unwrap();
        (status, rest)
    }
}

#[test]
fn ctrl_c_writes_the_samples_so_far() {
    if kept::leaves_out("the command that is interrupted flattens") {
        return;
    }
    let scene = cornell();
    for more in [&[][..], &["--noise", "0.0001"]] {
        let mut begun = Begun::render(&[&scene], &[&["-o", "x.exr"], more].concat());
        send(&begun.child, Signal::INT);
        begun.messages.wait_for("note: interrupted: ");
        let (status, text) = begun.end();
        assert_eq!(status.signal(), Some(Signal::INT.as_raw()), "{text}");
        assert_eq!(begun.files(), ["x.exr"]);
        assert!(text.contains("\nwrote x.exr\n"), "{text}");
        if more.is_empty() {
            // The picture is that of the samples which the report states.
            let n_samples = text.split(" samples a pixel").next().unwrap().split(' ').next_back().unwrap();
            let counted = ["-q", "-o", "y.exr", "--spp", n_samples];
            succeed(begun.directory.path(), &[&["render", &scene], &SMALL[..], &counted].concat());
            let read = |name: &str| pixels(&begun.directory.path().join(name));
            assert!(read("x.exr") == read("y.exr"), "{n_samples}");
        }
    }
}

/// SIGTERM and SIGHUP mean that there is no time, and what others would take for complete is not cut.
#[test]
fn other_signals_and_other_pictures_end_at_once() {
    let scene = cornell();
    let film = "[[keyframe]]\nframe = 0\neye = [0.5, 0.5, 2]\ntarget = [0.5, 0.5, 0]\n";
    let path = TempDir::new().unwrap();
    fs::write(path.path().join("p.toml"), film).unwrap();
    let path = path.path().join("p.toml").display().to_string();
    let cases: [(Signal, &[&str]); 5] = [
        (Signal::TERM, &["-o", "x.exr"]),
        (Signal::HUP, &["-o", "x.exr"]),
        (Signal::INT, &["-o", "x.exr", "--skip-existing"]),
        (Signal::INT, &["-o", "x.exr", "--samples", "0-65520"]),
        (Signal::INT, &["-o", "x#.exr", "--path", &path]),
    ];
    for (signal, more) in cases {
        let mut begun = Begun::render(&[&scene], more);
        send(&begun.child, signal);
        let (status, text) = begun.end();
        assert_eq!(status.signal(), Some(signal.as_raw()), "{more:?} {text}");
        assert!(begun.files().is_empty(), "{more:?}");
    }
}

/// The second Ctrl-C ends the command, whether or not the picture is written by then.
#[test]
fn ctrl_c_twice_ends_at_once() {
    let scene = cornell();
    for _ in 0..4 {
        let mut begun = Begun::render(&[&scene], &["-o", "x.exr"]);
        send(&begun.child, Signal::INT);
        begun.messages.wait_for("note: interrupted: ");
        send(&begun.child, Signal::INT);
        assert_eq!(begun.end().0.signal(), Some(Signal::INT.as_raw()));
        let files = begun.files();
        assert!(files.is_empty() || files == ["x.exr"], "{files:?}");
        files.iter().for_each(|name| drop(pixels(&begun.directory.path().join(name))));
    }
}

#[test]
fn ctrl_c_ends_a_list_after_the_present_scene() {
    let (scene, other) = (cornell(), shipped("lamp.toml"));
    let mut begun = Begun::render(&[&scene, &other], &[]);
    send(&begun.child, Signal::INT);
    begun.messages.wait_for("interrupted: ");
    let (status, text) = begun.end();
    assert_eq!(status.signal(), Some(Signal::INT.as_raw()), "{text}");
    assert_eq!(begun.files(), ["cornell.png"]);
    assert!(text.ends_with("1 drawn, 0 failed, 1 not begun\n"), "{text}");
}

/// Runs the command in a shell that first sets a limit.
fn limited(directory: &Path, limit: &str, arguments: &[&str]) -> Output {
    let mut command = Command::new("bash");
    command.args(["-c", &format!("{limit}; exec \"$0\" \"$@\""), env!("CARGO_BIN_EXE_kdray")]).args(arguments);
    command.current_dir(directory).stdin(Stdio::null()).output().unwrap()
}

/// Asserts an exit code and a single error line that contains all words.
fn assert_refused(output: &Output, code: i32, words: &[&str]) {
    let text = stderr(output);
    assert_eq!(output.status.code(), Some(code), "{}: {text}", output.status);
    let errors: Vec<_> = text.lines().filter(|line| line.starts_with("error: ")).collect();
    assert_eq!(errors.len(), 1, "{text}");
    assert!(words.iter().all(|word| errors[0].contains(word)), "{words:?}: {}", errors[0]);
}

#[test]
fn a_file_beyond_the_limit_on_files_is_an_error_of_its_output() {
    let directory = with_rays();
    for file in ["new.npz", "rays.npz"] {
        fs::write(directory.path().join("rays.npz"), "old").unwrap();
        let arguments = ["cast", "mesh.obj", "rays.npy", "-o", file, "--cpu", "-q"];
        let output = limited(directory.path(), "ulimit -f 1000", &arguments);
        assert_refused(&output, 5, &[file, "File too large"]);
        assert_eq!(names(directory.path()), ["mesh.obj", "rays.npy", "rays.npz"]);
        assert_eq!(fs::read(directory.path().join("rays.npz")).unwrap(), b"old");
    }
}

/// Limit of the address space in KiB. It suffices for a small scene on two threads and for no more.
const LIMIT: &str = "ulimit -v 900000";

#[test]
fn a_scene_that_does_not_fit_in_memory_is_refused() {
    let directory = TempDir::new().unwrap();
    let path = |name: &str| directory.path().join(name);
    let sphere = "[[mesh]]\ngenerator = 'sphere'\nradius = 1\ntriangles = 8000000\n";
    fs::write(path("one.toml"), format!("ambient = [1, 1, 1]\n{sphere}")).unwrap();
    let part = sphere.replace("8000000", "800000");
    fs::write(path("parts.toml"), format!("ambient = [1, 1, 1]\n{}", part.repeat(12))).unwrap();
    fs::write(path("mesh.obj"), format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{}", "f 1 2 3\n".repeat(8_000_000))).unwrap();
    let cases: [(&str, &[&str]); 3] = [
        ("one.toml", &["one.toml:2: mesh 1: a scene of 8000000 triangles needs some 1.7 GiB", "available"]),
        ("parts.toml", &["parts.toml:", "of memory", "available"]),
        ("mesh.obj", &["mesh.obj: a scene of 8000000 triangles needs some 1.4 GiB"]),
    ];
    for (scene, words) in cases {
        let arguments = ["render", scene, "--cpu", "-q", "--threads", "2", "--size", "64x48", "-o", "x.png"];
        assert_refused(&limited(directory.path(), LIMIT, &arguments), 3, words);
    }
    assert_eq!(names(directory.path()), ["mesh.obj", "one.toml", "parts.toml"]);
}

#[test]
fn a_picture_that_does_not_fit_in_memory_is_refused() {
    let directory = TempDir::new().unwrap();
    let scene = cornell();
    let render = |size: &str, more: &[&str]| {
        let arguments = ["render", &scene, "--cpu", "-q", "--threads", "2", "-o", "x.exr", "--size", size];
        limited(directory.path(), LIMIT, &[&arguments[..], more].concat())
    };
    assert_refused(&render("4096x4096", &[]), 3, &["a picture of 4096x4096 pixels needs some 1.0 GiB", "available"]);
    assert_refused(&render("4000x3000", &["--spp", "2", "--aov", "depth"]), 3, &["a picture of 4000x3000 pixels"]);
    assert!(names(directory.path()).is_empty());
    assert_eq!(render("64x48", &[]).status.code(), Some(0));
    let cropped = render("16384x16384", &["--crop", "8000,8000,8064,8048"]);
    assert_eq!(cropped.status.code(), Some(0), "{}", stderr(&cropped));
}
