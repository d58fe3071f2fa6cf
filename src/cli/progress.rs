//! Progress of a command: on standard error a bar on a terminal, elsewhere one line per stage; or on standard output
//! lines for a scheduler.

use std::{
    io::{self, IsTerminal},
    path::Path,
    sync::{Arc, Mutex, PoisonError},
    time::{Duration, Instant},
};

use indicatif::{ProgressBar, ProgressStyle};

use kdray::{
    engine::{LoadRequest, Opened},
    scene::SceneError,
    util::{
        progress::{self, Observer, Work},
        text::one_line,
    },
};

use super::{
    log,
    openjd::{OpenJd, ProgressKind},
    print_line,
    spans::Spans,
};

/// Number of the bar's positions per stage.
const BAR_POSITIONS: u64 = 1000;

/// Shows the stages of a command.
pub struct Progress {
    shown: Shown,
    /// Number of progress stages per scene.
    n_stages: u64,
    /// Number of scenes. If there are several, a line for each stage of each would be too much.
    n_scenes: u64,
    /// Whether notes are left out.
    quiet: bool,
}

/// Where the progress is shown.
enum Shown {
    Nowhere,
    /// One line per stage.
    Lines,
    Meter(Meter),
}

/// Shows how much of the present stage is done.
#[derive(Clone)]
enum Meter {
    Bar(ProgressBar),
    OpenJd(Arc<OpenJd>),
}

impl Meter {
    /// Returns the position of the bar, in units of [`BAR_POSITIONS`] a stage.
    fn position(&self) -> u64 {
        match self {
            Self::Bar(bar) => bar.position(),
            Self::OpenJd(openjd) => (openjd.stages() * BAR_POSITIONS as f64).round() as u64,
        }
    }

    fn set_position(&self, position: u64) {
        match self {
            Self::Bar(bar) => bar.set_position(position),
            Self::OpenJd(openjd) => openjd.set_stages(position as f64 / BAR_POSITIONS as f64),
        }
    }

    /// Shows what the command does now, at the beginning of a stage.
    fn begin_stage(&self, message: &str) {
        match self {
            Self::Bar(bar) => bar.set_message(one_line(message)),
            Self::OpenJd(openjd) => openjd.status(message),
        }
    }

    /// Shows the message of a stage with what is left of it. A scheduler computes the time that is left by itself.
    fn set_message(&self, message: String) {
        if let Self::Bar(bar) = self {
            bar.set_message(message);
        }
    }
}

impl Progress {
    /// Shows the progress of a command that has `n_stages` stages. The library's warnings and errors appear above the
    /// bar, or as lines of their own.
    pub fn new(quiet: bool, n_stages: u64) -> Self {
        Self { shown: Self::for_people(quiet, n_stages), n_stages, n_scenes: 1, quiet }.logging(None)
    }

    /// Shows the progress of a command as the user wants it. `shares`: the share of a scene's work that each stage is;
    /// all of the `n_scenes` scenes have the same share. Also collects the library's tracing spans in `spans`.
    pub fn of_kind(
        kind: ProgressKind,
        quiet: bool,
        (shares, n_scenes): (&'static [f64], u64),
        spans: Option<&Spans>,
    ) -> Self {
        let n_stages = shares.len() as u64;
        let shown = match kind {
            ProgressKind::Auto => Self::for_people(quiet, n_stages * n_scenes),
            ProgressKind::OpenJd(percents) => {
                Shown::Meter(Meter::OpenJd(Arc::new(OpenJd::new(percents, shares, n_scenes))))
            }
            ProgressKind::None => Shown::Nowhere,
        };
        Self { shown, n_stages, n_scenes, quiet }.logging(spans)
    }

    /// Notes that the scene of this index begins, whichever stages of the last one were left out.
    pub fn begin_scene(&self, scene_ix: usize) {
        if let Some(meter) = self.meter() {
            meter.set_position(scene_ix as u64 * self.n_stages * BAR_POSITIONS);
        }
    }

    fn for_people(quiet: bool, n_stages: u64) -> Shown {
        match (quiet, io::stderr().is_terminal()) {
            (true, _) => Shown::Nowhere,
            (false, false) => Shown::Lines,
            (false, true) => Shown::Meter(Meter::Bar(Self::bar(n_stages))),
        }
    }

    /// Starts to print the library's events.
    fn logging(self, spans: Option<&Spans>) -> Self {
        let bar = if let Shown::Meter(Meter::Bar(bar)) = &self.shown { Some(bar) } else { None };
        log::start(self.quiet, bar, spans);
        self
    }

    fn bar(n_stages: u64) -> ProgressBar {
        let style = ProgressStyle::with_template("{bar:20} {msg} {elapsed}").expect("a valid template");
        let bar = ProgressBar::new(n_stages * BAR_POSITIONS).with_style(style);
        bar.enable_steady_tick(Duration::from_millis(100));
        bar
    }

    /// Returns what shows the progress within a stage, if anything does.
    fn meter(&self) -> Option<&Meter> {
        if let Shown::Meter(meter) = &self.shown { Some(meter) } else { None }
    }

    /// Runs the work of a stage. Returns its result and its duration in milliseconds.
    pub fn stage<T>(&self, message: &str, work: impl FnOnce() -> T) -> (T, f64) {
        match &self.shown {
            Shown::Nowhere => {}
            Shown::Lines if self.n_scenes > 1 => {}
            Shown::Lines => print_line("kdray", message),
            Shown::Meter(meter) => meter.begin_stage(message),
        }
        let start = Instant::now();
        let begin = self.position();
        let made = work();
        if let Some(meter) = self.meter() {
            meter.set_position(begin + BAR_POSITIONS);
        }
        (made, start.elapsed().as_secs_f64() * 1e3)
    }

    /// Reads a scene as a stage of its own.
    pub fn read(&self, scene: &Path, request: &LoadRequest) -> Result<Opened, SceneError> {
        self.stage(&format!("loading {}", scene.display()), || Opened::read(scene, request)).0
    }

    /// Returns the observer of a stage that consists of pieces of `work`, which share its part of the bar. It is none
    /// if nothing shows the progress within a stage.
    pub fn observer(&self, message: &str, work: &'static [Work]) -> progress::Progress {
        let Some(meter) = self.meter() else { return progress::Progress::default() };
        progress::Progress::to(Arc::new(StageObserver {
            meter: meter.clone(),
            message: one_line(message),
            begin: meter.position(),
            work,
            state: Mutex::new(StageState { present: None, shares: vec![0.0; work.len()] }),
        }))
    }

    /// Returns the bar's position, or 0 without a bar.
    fn position(&self) -> u64 {
        self.meter().map_or(0, Meter::position)
    }

    /// Prints a note: something that the user should know but need not act on.
    pub fn note(&self, message: &str) {
        if !self.quiet {
            self.beside(|| print_line("note", &log::of_scene(message)));
        }
    }

    /// Prints why the current scene of a list failed.
    pub fn error(&self, message: &str) {
        self.beside(|| print_line("error", &log::of_scene(message)));
    }

    /// Hides the bar while something is printed.
    pub fn beside<T>(&self, print: impl FnOnce() -> T) -> T {
        match &self.shown {
            Shown::Meter(Meter::Bar(bar)) => bar.suspend(print),
            _ => print(),
        }
    }
}

/// Moves the bar while the library works on a stage.
struct StageObserver {
    meter: Meter,
    message: String,
    /// Position of the bar when the stage began.
    begin: u64,
    /// What the stage consists of.
    work: &'static [Work],
    state: Mutex<StageState>,
}

struct StageState {
    /// The piece of work that was reported last, when it began, and the share of it that was done.
    present: Option<(usize, Instant, f32)>,
    /// The largest share that was reported of each piece of work.
    shares: Vec<f32>,
}

impl Observer for StageObserver {
    fn progress(&self, work: Work, share: f32) {
        let Some(ix) = self.work.iter().position(|other| *other == work) else { return };
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let begin = match state.present {
            // Threads report in any order.
            Some((same, _, last)) if same == ix && share < last && last < 1.0 => return,
            Some((same, begin, last)) if same == ix && share >= last => begin,
            _ => Instant::now(),
        };
        state.present = Some((ix, begin, share));
        state.shares[ix] = state.shares[ix].max(share);
        let done = state.shares.iter().sum::<f32>() / self.work.len() as f32;
        self.meter.set_position(self.begin + (done * BAR_POSITIONS as f32) as u64);
        let name = match work {
            Work::Reading | Work::Building => "",
            Work::Images => " images",
        };
        let left = left_text(time_left(begin.elapsed(), share.into()));
        self.meter.set_message(format!("{}:{name} {:.0} %, {left} left", self.message, 100.0 * share));
    }
}

/// A stage of many equal items.
pub struct CountedProgress<'a> {
    progress: &'a Progress,
    message: String,
    n_done: u32,
    n_items: u32,
    /// Time after which the stage ends, if it has no number of items.
    ends_after: Option<Duration>,
    /// Finished share of the current item, 0 to 1.
    item_share: f32,
    /// Whether the user sees progress within an item.
    pub shows_item_progress: bool,
    /// Position of the bar when the stage began.
    begin: u64,
    start: Instant,
    last_line: Instant,
}

impl Progress {
    /// Returns a counter of items that shows the stage's progress and the time left. `message` names the stage.
    pub fn counted(&self, message: &str, n_items: u32) -> CountedProgress<'_> {
        let (message, start) = (message.to_owned(), Instant::now());
        let (begin, shows_item_progress) = (self.position(), matches!(self.shown, Shown::Meter(Meter::Bar(_))));
        CountedProgress {
            progress: self,
            message,
            n_done: 0,
            n_items,
            ends_after: None,
            item_share: 0.0,
            shows_item_progress,
            begin,
            start,
            last_line: start,
        }
    }

    /// Returns a counter of items for a stage that ends after a time.
    pub fn counted_until(&self, message: &str, time: Duration) -> CountedProgress<'_> {
        CountedProgress { ends_after: Some(time), ..self.counted(message, u32::MAX) }
    }
}

impl CountedProgress<'_> {
    /// Notes that one more item is done.
    pub fn finish_item(&mut self) {
        /// Least time between two lines if there is no terminal.
        const PAUSE: Duration = Duration::from_secs(5);
        self.n_done += 1;
        self.item_share = 0.0;
        if self.n_done >= self.n_items {
            return;
        }
        match &self.progress.shown {
            Shown::Nowhere => {}
            Shown::Lines if self.last_line.elapsed() >= PAUSE => {
                self.last_line = Instant::now();
                print_line("kdray", &log::of_scene(&self.text()));
            }
            Shown::Lines => {}
            Shown::Meter(meter) => self.move_meter(meter),
        }
    }

    /// Notes that a share of the current item is done, 0 to 1.
    pub fn item_progress(&mut self, share: f32) {
        self.item_share = share.clamp(0.0, 1.0);
        if let Some(meter) = self.progress.meter() {
            self.move_meter(meter);
        }
    }

    fn move_meter(&self, meter: &Meter) {
        meter.set_position(self.begin + (self.share() * BAR_POSITIONS as f64) as u64);
        meter.set_message(self.text());
    }

    /// Returns the finished share of the stage, 0 to 1.
    fn share(&self) -> f64 {
        if let Some(time) = self.ends_after {
            return (self.start.elapsed().as_secs_f64() / time.as_secs_f64()).min(1.0);
        }
        (f64::from(self.n_done) + f64::from(self.item_share)) / f64::from(self.n_items)
    }

    fn text(&self) -> String {
        let elapsed = self.start.elapsed();
        let left = match self.ends_after {
            Some(time) => time.saturating_sub(elapsed),
            None => time_left(elapsed, self.share()),
        };
        let left = left_text(left);
        let done = match self.n_items {
            _ if self.ends_after.is_some() => format!("{} samples", self.n_done),
            1 => format!("{:.0} %", 100.0 * self.share()),
            n_items => format!("{} of {n_items}", self.n_done),
        };
        format!("{}: {done}, {left} left", self.message)
    }
}

/// Returns the time that the rest takes at the present speed. At the start the speed is unknown and the result
/// is zero.
fn time_left(elapsed: Duration, share_done: f64) -> Duration {
    if share_done > 0.0 { elapsed.mul_f64((1.0 - share_done) / share_done) } else { Duration::ZERO }
}

fn left_text(left: Duration) -> String {
    let left_s = left.as_secs_f64().ceil();
    if left_s < 120.0 { format!("{left_s} s") } else { format!("{} min", (left_s / 60.0).ceil()) }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Shown::Meter(Meter::Bar(bar)) = &self.shown {
            bar.finish_and_clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(shown: Shown) -> Progress {
        Progress { shown, n_stages: 3, n_scenes: 1, quiet: false }
    }

    #[test]
    fn what_is_left_takes_as_long_as_what_is_done() {
        assert_eq!(time_left(Duration::from_secs(3), 0.25), Duration::from_secs(9));
        assert_eq!(time_left(Duration::from_secs(3), 1.0), Duration::ZERO);
        assert_eq!(time_left(Duration::from_secs(3), 0.0), Duration::ZERO);
        let progress = shown(Shown::Nowhere);
        let mut items = progress.counted("rendering", 3);
        items.finish_item();
        assert!(items.text().starts_with("rendering: 1 of 3, ") && items.text().ends_with(" left"), "{}", items.text());
        let mut items = progress.counted_until("rendering", Duration::from_secs(1000));
        items.finish_item();
        assert_eq!(items.text(), "rendering: 1 samples, 17 min left");
    }

    #[test]
    fn the_bar_moves_while_the_library_works() {
        let bar = ProgressBar::hidden();
        bar.set_length(3 * BAR_POSITIONS);
        let progress = shown(Shown::Meter(Meter::Bar(bar.clone())));
        progress.stage("first", || ());
        progress.stage("loading x", || {
            let observer = progress.observer("loading x", &[Work::Reading, Work::Images]);
            let report = |work, share| observer.report(work, share);
            report(Work::Reading, 0.5);
            assert_eq!(bar.position(), BAR_POSITIONS + BAR_POSITIONS / 4);
            assert!(bar.message().starts_with("loading x: 50 %, "), "{}", bar.message());
            // These reports come from a late thread, another file, the next work, and work of other stages.
            report(Work::Reading, 0.25);
            assert!(bar.message().starts_with("loading x: 50 %, "), "{}", bar.message());
            report(Work::Reading, 1.0);
            report(Work::Reading, 0.1);
            assert_eq!(bar.position(), BAR_POSITIONS + BAR_POSITIONS / 2);
            assert!(bar.message().starts_with("loading x: 10 %, "), "{}", bar.message());
            report(Work::Images, 0.5);
            assert_eq!(bar.position(), BAR_POSITIONS + BAR_POSITIONS * 3 / 4);
            assert!(bar.message().starts_with("loading x: images 50 %, "), "{}", bar.message());
            report(Work::Building, 1.0);
            assert_eq!(bar.position(), BAR_POSITIONS + BAR_POSITIONS * 3 / 4);
        });
        assert_eq!(bar.position(), 2 * BAR_POSITIONS);
        assert_eq!(shown(Shown::Lines).observer("x", &[Work::Reading]), progress::Progress::default());
    }

    #[test]
    fn the_bar_moves_within_an_item() {
        let bar = ProgressBar::hidden();
        bar.set_length(3 * BAR_POSITIONS);
        let progress = shown(Shown::Meter(Meter::Bar(bar.clone())));
        progress.stage("loading", || ());
        progress.stage("rendering", || {
            let mut items = progress.counted("rendering", 2);
            items.item_progress(0.5);
            assert_eq!(bar.position(), BAR_POSITIONS + BAR_POSITIONS / 4);
            items.finish_item();
            items.item_progress(0.5);
            assert_eq!(bar.position(), BAR_POSITIONS + BAR_POSITIONS * 3 / 4);
            assert!(bar.message().starts_with("rendering: 1 of 2, "), "{}", bar.message());
        });
        assert_eq!(bar.position(), 2 * BAR_POSITIONS);
        let mut alone = progress.counted("rendering", 1);
        alone.item_progress(0.25);
        assert!(bar.message().starts_with("rendering: 25 %, "), "{}", bar.message());
    }
}
