//! What the command is doing: a bar on a terminal, a line a stage elsewhere.

use std::{
    io::{self, IsTerminal},
    time::{Duration, Instant},
};

use indicatif::{ProgressBar, ProgressStyle};

use super::{complain, log, spans::Spans};

/// Stages of a command, told on standard error.
pub enum Progress {
    Silent,
    Lines,
    Bar(ProgressBar),
}

impl Progress {
    /// For a command of `n_stages`. The library's own remarks appear beside it.
    pub fn new(quiet: bool, n_stages: u64) -> Self {
        Self::with_spans(quiet, n_stages, None)
    }

    /// As [`Progress::new`]; the library's spans go to `spans`.
    pub fn with_spans(quiet: bool, n_stages: u64, spans: Option<&Spans>) -> Self {
        let progress = match (quiet, io::stderr().is_terminal()) {
            (true, _) => Self::Silent,
            (false, false) => Self::Lines,
            (false, true) => Self::bar(n_stages),
        };
        match &progress {
            Self::Bar(bar) => log::start(quiet, Some(bar), spans),
            Self::Silent | Self::Lines => log::start(quiet, None, spans),
        }
        progress
    }

    fn bar(n_stages: u64) -> Self {
        let style = ProgressStyle::with_template("{bar:20} {msg} {elapsed}").expect("a valid template");
        let bar = ProgressBar::new(n_stages).with_style(style);
        bar.enable_steady_tick(Duration::from_millis(100));
        Self::Bar(bar)
    }

    /// Does the work of a stage. Gives what it made and the milliseconds it took.
    pub fn stage<T>(&self, message: &str, work: impl FnOnce() -> T) -> (T, f64) {
        match self {
            Self::Silent => {}
            Self::Lines => complain("kdray", message),
            Self::Bar(bar) => bar.set_message(message.to_owned()),
        }
        let start = Instant::now();
        let made = work();
        if let Self::Bar(bar) = self {
            bar.inc(1);
        }
        (made, start.elapsed().as_secs_f64() * 1e3)
    }

    /// Tells what the user should know but need not act on.
    pub fn note(&self, message: &str) {
        match self {
            Self::Silent => {}
            Self::Lines => complain("note", message),
            Self::Bar(bar) => bar.suspend(|| complain("note", message)),
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Self::Bar(bar) = self {
            bar.finish_and_clear();
        }
    }
}
