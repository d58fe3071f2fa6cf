//! The progress of a command as lines on standard output, by which Open Job Description's schedulers follow a task.
//!
//! A scheduler reads lines that begin with `openjd_progress: `, `openjd_status: ` and `openjd_fail: `. All other lines
//! are the task's log.

use std::{
    borrow::Cow,
    ffi::OsString,
    io::{self, Write},
    str::FromStr,
    sync::{Mutex, PoisonError},
    time::{Duration, Instant},
};

use kdray::util::text::one_line;

/// The beginning of all lines that schedulers obey.
const PREFIX: &str = "openjd_";
/// Least time between two lines of progress.
const PAUSE: Duration = Duration::from_millis(300);
/// Least change between two lines of progress, percent.
const LEAST_CHANGE: f64 = 0.1;
/// Progress of a stage that is done, if no other stage follows. The last line follows when all files are written.
const ALMOST: f64 = 0.999;

/// How a command shows its progress: the value of `--progress`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum ProgressKind {
    /// On standard error, for people.
    #[default]
    Auto,
    /// On standard output, for a scheduler.
    OpenJd(Percents),
    /// Not at all.
    None,
}

/// The part of its task that a command does, in percent of the task.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Percents {
    first: f64,
    last: f64,
}

impl FromStr for ProgressKind {
    type Err = &'static str;

    fn from_str(word: &str) -> Result<Self, Self::Err> {
        const EXPECTED: &str = "expected auto, openjd, openjd:A-B with percents 0 <= A <= B <= 100, or none";
        let percents = |range: &str| {
            let (first, last) = range.split_once('-')?;
            let percents = Percents { first: first.parse().ok()?, last: last.parse().ok()? };
            (0.0 <= percents.first && percents.first <= percents.last && percents.last <= 100.0).then_some(percents)
        };
        match word {
            "auto" => Ok(Self::Auto),
            "none" => Ok(Self::None),
            "openjd" => Ok(Self::OpenJd(Percents { first: 0.0, last: 100.0 })),
            _ => word.strip_prefix("openjd:").and_then(percents).map(Self::OpenJd).ok_or(EXPECTED),
        }
    }
}

impl ProgressKind {
    /// Returns the value of `--progress` among the words of a command. The words need not be valid otherwise, so that
    /// a scheduler learns of them, too.
    pub fn of_words(words: &[OsString]) -> Self {
        let value_of = |(word, next): (&OsString, Option<&OsString>)| {
            let value = match word.to_str()? {
                "--progress" => next?.to_str()?,
                word => word.strip_prefix("--progress=")?,
            };
            value.parse().ok()
        };
        let nexts = words.iter().skip(1).map(Some).chain([None]);
        words.iter().zip(nexts).find_map(value_of).unwrap_or_default()
    }

    /// Tells a scheduler that the command has ended, and whether it failed.
    pub fn end(self, failure: Option<&str>) {
        match (self, failure) {
            (Self::OpenJd(_), Some(message)) => say("fail", message),
            (Self::OpenJd(Percents { last, .. }), None) => say("progress", &format!("{last:.1}")),
            _ => (),
        }
    }

    /// Returns a report whose lines a scheduler does not take for the protocol's.
    pub fn report(self, text: &str) -> Cow<'_, str> {
        match self {
            Self::OpenJd(_) if text.contains(PREFIX) => {
                let lines = text.split('\n').map(|line| {
                    let mark = if line.starts_with(PREFIX) { " " } else { "" };
                    format!("{mark}{line}")
                });
                lines.collect::<Vec<_>>().join("\n").into()
            }
            _ => text.into(),
        }
    }
}

/// Writes a line of the protocol. If standard output fails, the command goes on: its files matter more.
fn say(what: &str, message: &str) {
    let line = format!("{PREFIX}{what}: {}\n", one_line(message));
    let mut stdout = io::stdout().lock();
    let _ = stdout.write_all(line.as_bytes()).and_then(|()| stdout.flush());
}

/// Tells a scheduler the progress of a command that consists of stages.
pub struct OpenJd {
    percents: Percents,
    /// The share of a scene's work that each stage is. The sum is 1.
    shares: &'static [f64],
    /// Number of scenes, each of which has all stages.
    n_scenes: u64,
    state: Mutex<State>,
}

struct State {
    /// Number of stages that are done, with the finished share of the present one.
    stages: f64,
    /// The progress that was told last, percent, and when.
    told: Option<(f64, Instant)>,
}

impl OpenJd {
    pub fn new(percents: Percents, shares: &'static [f64], n_scenes: u64) -> Self {
        let begun = Self { percents, shares, n_scenes, state: Mutex::new(State { stages: 0.0, told: None }) };
        begun.set_stages(0.0);
        begun
    }

    /// Returns the number of stages that are done, with the finished share of the present one.
    pub fn stages(&self) -> f64 {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).stages
    }

    /// Notes how many stages are done, and says so unless a line was written just before. Progress never goes back.
    pub fn set_stages(&self, stages: f64) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.stages = state.stages.max(stages);
        let percent = self.percent(state.stages);
        if state.told.is_none_or(|(told, when)| percent >= told + LEAST_CHANGE && when.elapsed() >= PAUSE) {
            state.told = Some((percent, Instant::now()));
            say("progress", &format!("{percent:.1}"));
        }
    }

    /// Says what the command does now.
    pub fn status(&self, message: &str) {
        say("status", message);
    }

    /// Returns the percents of the task that are done.
    fn percent(&self, stages: f64) -> f64 {
        let n_stages = self.shares.len() as f64;
        let n_drawn = (stages / n_stages).floor();
        let present = stages - n_drawn * n_stages;
        let shares = self.shares.iter().enumerate();
        let of_present: f64 = shares.map(|(stage_ix, share)| share * (present - stage_ix as f64).clamp(0.0, 1.0)).sum();
        let done = (n_drawn + of_present) / self.n_scenes as f64;
        let Percents { first, last } = self.percents;
        // Rounding up would tell the end before it comes.
        ((first + (last - first) * done.min(ALMOST)) * 10.0).floor() / 10.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_of_progress() {
        let kind = |word: &str| word.parse::<ProgressKind>();
        assert_eq!(kind("auto"), Ok(ProgressKind::Auto));
        assert_eq!(kind("none"), Ok(ProgressKind::None));
        assert_eq!(kind("openjd"), kind("openjd:0-100"));
        assert_eq!(kind("openjd:12.5-25"), Ok(ProgressKind::OpenJd(Percents { first: 12.5, last: 25.0 })));
        for word in ["", "openjd:", "openjd:1", "openjd:2-1", "openjd:0-101", "openjd:NaN-1", "openjd:-1-2", "bar"] {
            assert!(kind(word).is_err(), "{word}");
        }
    }

    #[test]
    fn the_kind_is_found_among_words_that_are_wrong() {
        let of = |words: &str| ProgressKind::of_words(&words.split(' ').map(OsString::from).collect::<Vec<_>>());
        let openjd = "openjd".parse().unwrap();
        assert_eq!(of("kdray render --size none --progress openjd"), openjd);
        assert_eq!(of("kdray render --progress=openjd --nonsense"), openjd);
        assert_eq!(of("kdray render --progress=none"), ProgressKind::None);
        for words in ["kdray", "kdray --progress", "kdray --progress what", "kdray openjd"] {
            assert_eq!(of(words), ProgressKind::Auto, "{words}");
        }
    }

    #[test]
    fn stages_have_their_shares_of_the_percents() {
        let openjd = OpenJd::new(Percents { first: 0.0, last: 100.0 }, &[0.25, 0.75], 1);
        let percents = [0.0, 0.5, 1.0, 1.5, 2.0].map(|stages| openjd.percent(stages));
        assert_eq!(percents, [0.0, 12.5, 25.0, 62.5, 99.9]);
        let second_half = OpenJd::new(Percents { first: 50.0, last: 100.0 }, &[1.0], 1);
        assert_eq!([0.0, 0.5, 1.0].map(|stages| second_half.percent(stages)), [50.0, 75.0, 99.9]);
        let two_scenes = OpenJd::new(Percents { first: 0.0, last: 100.0 }, &[0.25, 0.75], 2);
        let percents = [0.0, 1.0, 2.0, 2.5, 4.0].map(|stages| two_scenes.percent(stages));
        assert_eq!(percents, [0.0, 12.5, 50.0, 56.2, 99.9]);
        // Late reports of other threads do not move it back.
        openjd.set_stages(1.5);
        openjd.set_stages(0.5);
        assert_eq!(openjd.stages(), 1.5);
    }

    #[test]
    fn reports_are_no_lines_of_the_protocol() {
        let openjd: ProgressKind = "openjd".parse().unwrap();
        let text = "openjd_fail: 1 part\nof openjd_x\n";
        assert_eq!(openjd.report(text), " openjd_fail: 1 part\nof openjd_x\n");
        assert_eq!(ProgressKind::Auto.report(text), text);
    }
}
