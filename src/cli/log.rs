//! Prints the library's log events as `note: …`, `warning: …` and `error: …` lines above the progress bar. Of several
//! scenes, each line begins with the present one.

use std::{
    fmt,
    io::{self, Write},
    path::Path,
    sync::{Mutex, PoisonError},
};

use indicatif::ProgressBar;
use kdray::util::text::one_line;
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::{
    Layer, Registry,
    filter::{LevelFilter, filter_fn},
    fmt::{
        FmtContext, FormatFields,
        format::{FormatEvent, Writer},
    },
    layer::{self, SubscriberExt},
    registry::LookupSpan,
    util::SubscriberInitExt,
};

use super::spans::Spans;

/// Sends the library's log events to standard error from now on: errors, and unless `quiet` warnings and notes. The
/// library's tracing spans go to `spans`; without it, spans are disabled and cost nothing.
pub fn start(quiet: bool, bar: Option<&ProgressBar>, spans: Option<&Spans>) {
    let bar = bar.cloned();
    let lines = tracing_subscriber::fmt::layer()
        // The layer would report a failed write to standard error, which is the stream that has failed.
        .log_internal_errors(false)
        .event_format(Line)
        .with_writer(move || Beside(bar.clone()))
        .with_filter(only_events(if quiet { Level::ERROR } else { Level::INFO }));
    let started = tracing_subscriber::registry().with(lines).with(spans.map(Spans::layer)).try_init();
    // A second command in the same process keeps the first one's subscriber.
    drop(started);
}

/// Lets events up to a level pass, and no spans: these would cost time although the lines do not show them.
fn only_events(level: Level) -> impl layer::Filter<Registry> {
    let filter = filter_fn(move |metadata| metadata.is_event() && *metadata.level() <= level);
    filter.with_max_level_hint(LevelFilter::from_level(level))
}

/// The scene that is drawn now, if it is one of several.
static SCENE: Mutex<Option<String>> = Mutex::new(None);

/// Sets the scene that is drawn now, one of several. `None` after the last one.
pub fn set_scene(scene: Option<&Path>) {
    *SCENE.lock().unwrap_or_else(PoisonError::into_inner) = scene.map(|scene| scene.display().to_string());
}

/// Returns the message with the present scene before it, unless it begins with it.
pub fn of_scene(message: &str) -> String {
    match &*SCENE.lock().unwrap_or_else(PoisonError::into_inner) {
        Some(scene) if !message.starts_with(scene) => format!("{scene}: {message}"),
        _ => message.to_owned(),
    }
}

/// Format of an event: `level: message` on one line, with control characters escaped.
struct Line;

impl<S, N> FormatEvent<S, N> for Line
where
    S: Subscriber + for<'a> LookupSpan<'a>,
    N: for<'a> FormatFields<'a> + 'static,
{
    fn format_event(&self, context: &FmtContext<S, N>, mut writer: Writer, event: &Event) -> fmt::Result {
        // Events of other libraries are for their developers.
        if !event.metadata().target().starts_with("kdray") {
            return Ok(());
        }
        let label = match *event.metadata().level() {
            Level::ERROR => "error",
            Level::WARN => "warning",
            _ => "note",
        };
        // A message may quote a name from a file.
        let mut remark = String::new();
        context.field_format().format_fields(Writer::new(&mut remark), event)?;
        writeln!(writer, "{label}: {}", one_line(&of_scene(&remark)))
    }
}

/// Standard error; the progress bar is hidden while a line is written.
struct Beside(Option<ProgressBar>);

impl Write for Beside {
    fn write(&mut self, text: &[u8]) -> io::Result<usize> {
        match &self.0 {
            Some(bar) => bar.suspend(|| io::stderr().write(text)),
            None => io::stderr().write(text),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
