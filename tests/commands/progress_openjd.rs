//! Tests of `--progress openjd`: the lines of `kdray render` and `kdray merge` that engines of Open Job Description
//! read.

use std::{fs, path::Path, time::Instant};

use crate::support::command::{cornell, kdray, stderr, stdout, succeed};
use tempfile::TempDir;

/// Returns the messages of all lines `openjd_WHAT: MESSAGE`, and checks that no other line begins as they do.
fn messages(text: &str, what: &str) -> Vec<String> {
    let lines = text.lines().filter_map(|line| line.strip_prefix("openjd_")).map(|line| line.split_once(": ").unwrap());
    lines
        .filter(|(kind, _)| {
            assert!(["progress", "status", "fail"].contains(kind), "{text}");
            *kind == what
        })
        .map(|(_, message)| message.to_owned())
        .collect()
}

/// Returns the percents that the lines tell, which never go back and have one decimal.
fn percents(text: &str) -> Vec<f64> {
    let words = messages(text, "progress");
    let percents: Vec<f64> = words.iter().map(|word| word.parse().unwrap()).collect();
    assert!(percents.is_sorted_by(|a, b| a < b), "{words:?}");
    assert!(percents.iter().all(|percent| (0.0..=100.0).contains(percent)), "{words:?}");
    percents
}

const RENDER: [&str; 11] =
    ["render", "SCENE", "--size", "64x48", "--integrator", "path", "--threads", "1", "--cpu", "--denoise", "off"];

fn render(directory: &Path, scene: &str, arguments: &[&str]) -> String {
    let words: Vec<_> = RENDER.iter().map(|word| if *word == "SCENE" { scene } else { word }).collect();
    stdout(&succeed(directory, &[&words[..], arguments].concat()))
}

#[test]
fn an_engine_learns_stages_and_progress() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    // Lines are at least 300 ms apart. So many samples are drawn that there are some lines, however fast this machine.
    let mut n_samples = 640;
    let (text, seconds) = loop {
        let begin = Instant::now();
        let spp = n_samples.to_string();
        let text = render(path, &cornell(), &["--progress", "openjd", "--spp", &spp, "-o", "a.exr"]);
        let seconds = begin.elapsed().as_secs_f64();
        if seconds > 2.0 {
            break (text, seconds);
        }
        n_samples *= 2;
    };
    let most_lines = seconds * 4.0 + 3.0;
    let told = percents(&text);
    assert_eq!((told[0], told[told.len() - 1]), (0.0, 100.0));
    assert!(told.len() >= 4, "the progress of rendering is told: {told:?}");
    assert!((told.len() as f64) < most_lines, "at most a few lines a second: {told:?}");
    let stages = messages(&text, "status");
    assert_eq!((stages.len(), &*stages[2]), (3, "rendering 64x48"), "{stages:?}");
    assert!(stages[0].starts_with("loading ") && stages[1].starts_with("building "), "{stages:?}");
    // The report is there, too, but not with --quiet.
    assert!(text.contains("wrote a.exr"), "{text}");
    let quiet = render(path, &cornell(), &["--progress", "openjd", "--spp", "16", "-o", "a.exr", "-q"]);
    assert!(quiet.lines().all(|line| line.starts_with("openjd_")), "{quiet}");
    assert_eq!(percents(&quiet).last(), Some(&100.0));
    // A part of a task has a part of its percents.
    let part = render(path, &cornell(), &["--progress", "openjd:40-60", "-o", "a.exr", "--spp", "16"]);
    let told = percents(&part);
    assert_eq!((told[0], told[told.len() - 1]), (40.0, 60.0));
}

#[test]
fn people_see_what_they_saw() {
    let directory = TempDir::new().unwrap();
    let words = |kind: &[&str]| {
        let common = ["render", &cornell(), "--size", "8x6", "--cpu", "-o", "a.exr"];
        let output = succeed(directory.path(), &[&common[..], kind].concat());
        (stdout(&output), stderr(&output))
    };
    for kind in [&[][..], &["--progress", "auto"]] {
        let (report, progress) = words(kind);
        assert!(report.contains("wrote a.exr") && !report.contains("openjd_"), "{report}");
        assert!(progress.contains("kdray: rendering 8x6"), "{progress}");
    }
    let (report, progress) = words(&["--progress", "none"]);
    assert!(report.contains("wrote a.exr") && !report.contains("openjd_"), "{report}");
    assert_eq!(progress, "");
    let (_, progress) = words(&["--progress", "openjd"]);
    assert_eq!(progress, "", "an engine reads both streams as one log");
}

#[test]
fn a_film_that_is_there_is_done() {
    let directory = TempDir::new().unwrap();
    let done = ["--progress", "openjd", "--skip-existing", "-o", "a.exr", "--spp", "1"];
    for _ in 0..2 {
        assert_eq!(percents(&render(directory.path(), &cornell(), &done)).last(), Some(&100.0));
    }
}

#[test]
fn a_report_is_no_line_of_the_protocol() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    let scene = "openjd_fail: all is lost.toml";
    fs::copy(cornell(), path.join(scene)).unwrap();
    let text = render(path, scene, &["--progress", "openjd", "-o", "a.exr", "--spp", "1"]);
    assert!(text.contains("\n openjd_fail: all is lost"), "{text}");
    assert_eq!(messages(&text, "fail"), [""; 0]);
}

#[test]
fn parts_are_joined_with_progress() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    for tile in ["1/2", "2/2"] {
        render(path, &cornell(), &["--tile", tile, "-q", "--spp", "1", "-o", &format!("{}.exr", &tile[..1])]);
    }
    let merge = ["merge", "1.exr", "2.exr", "-o", "a.exr", "--progress", "openjd"];
    let text = stdout(&succeed(path, &merge));
    assert_eq!(messages(&text, "status"), ["joining 2 parts", "writing a.exr"]);
    let told = percents(&text);
    assert_eq!((told[0], told[told.len() - 1]), (0.0, 100.0));
    assert!(text.contains("wrote a.exr"), "{text}");
}

/// Whatever goes wrong, an engine gets a line that says the same as the error on standard error.
#[test]
fn an_engine_learns_why_a_command_fails() {
    let directory = TempDir::new().unwrap();
    let scene = cornell();
    for (words, code) in [
        (&["render", &scene, "--size", "none", "--progress", "openjd"][..], 2),
        (&["render", "none.toml", "--progress=openjd", "-q"], 3),
        (&["render", &scene, "--size", "8x6", "--cpu", "--progress", "openjd", "-o", "none/a.exr"], 5),
        (&["merge", "none.exr", "-o", "a.exr", "--progress", "openjd"], 3),
        (&["merge", "--progress", "openjd"], 2),
    ] {
        let output = kdray(directory.path(), words).output().unwrap();
        assert_eq!(output.status.code(), Some(code), "{words:?}");
        let (text, errors) = (stdout(&output), stderr(&output));
        let error = errors.lines().last().unwrap().strip_prefix("error: ").unwrap();
        assert_eq!(messages(&text, "fail"), [error]);
        assert!(percents(&text).iter().all(|percent| *percent < 100.0), "{text}");
    }
    // Without the option, there is no such line.
    let output = kdray(directory.path(), &["render", "none.toml"]).output().unwrap();
    assert_eq!(stdout(&output), "");
}
