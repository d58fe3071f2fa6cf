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

/// A stage of many equal steps.
pub struct Steps<'a> {
    progress: &'a Progress,
    message: String,
    n_done: u32,
    n_steps: u32,
    start: Instant,
    last_line: Instant,
}

impl Progress {
    /// Tells how far the stage is that `message` names, and how much time is left.
    pub fn steps(&self, message: &str, n_steps: u32) -> Steps<'_> {
        let (message, start) = (message.to_owned(), Instant::now());
        Steps { progress: self, message, n_done: 0, n_steps, start, last_line: start }
    }
}

impl Steps<'_> {
    /// One more is done.
    pub fn step(&mut self) {
        /// Between lines where there is no terminal.
        const PAUSE: Duration = Duration::from_secs(5);
        self.n_done += 1;
        if self.n_done >= self.n_steps {
            return;
        }
        match self.progress {
            Progress::Silent => {}
            Progress::Lines if self.last_line.elapsed() >= PAUSE => {
                self.last_line = Instant::now();
                complain("kdray", &self.text());
            }
            Progress::Lines => {}
            Progress::Bar(bar) => bar.set_message(self.text()),
        }
    }

    fn text(&self) -> String {
        let left_s = time_left(self.start.elapsed(), self.n_done, self.n_steps).as_secs_f64().ceil();
        let left = if left_s < 120.0 { format!("{left_s} s") } else { format!("{} min", (left_s / 60.0).ceil()) };
        format!("{}: {} of {}, {left} left", self.message, self.n_done, self.n_steps)
    }
}

/// If all steps take as long as those that are done, at least one.
fn time_left(elapsed: Duration, n_done: u32, n_steps: u32) -> Duration {
    elapsed.mul_f64(f64::from(n_steps - n_done) / f64::from(n_done))
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Self::Bar(bar) = self {
            bar.finish_and_clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_takes_as_long_as_what_is_done() {
        assert_eq!(time_left(Duration::from_secs(3), 1, 4), Duration::from_secs(9));
        assert_eq!(time_left(Duration::from_secs(3), 4, 4), Duration::ZERO);
        let progress = Progress::Silent;
        let mut steps = progress.steps("rendering", 3);
        steps.step();
        assert!(steps.text().starts_with("rendering: 1 of 3, ") && steps.text().ends_with(" left"), "{}", steps.text());
    }
}
