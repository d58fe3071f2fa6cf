//! Writes a frame as Chrome trace events, which Perfetto and chrome://tracing show. One track has the CPU's work,
//! another the passes. <https://docs.google.com/document/d/1CvAClvFfyA5R-PhYUmn5OOQtYMH4h6I0nSsKchNAySU>

use std::time::Instant;

use kdray::frame::{PassTime, Profile};
use serde::Serialize;
use serde_json::{Map, Value, json};

use super::spans::Span;

/// Thread numbers. A viewer shows each thread as a track.
const CPU: u32 = 1;
const PASSES: u32 = 2;

/// The file's top-level object.
#[derive(Serialize)]
struct Trace {
    #[serde(rename = "traceEvents")]
    events: Vec<Event>,
    #[serde(rename = "displayTimeUnit")]
    unit: &'static str,
}

/// A slice (`X`) or a track's name (`M`).
#[derive(Serialize)]
struct Event {
    name: String,
    #[serde(rename = "cat")]
    category: &'static str,
    #[serde(rename = "ph")]
    phase: &'static str,
    /// Microseconds since the command began.
    #[serde(rename = "ts")]
    start: f64,
    /// Microseconds; none for a track's name.
    #[serde(rename = "dur", skip_serializing_if = "Option::is_none")]
    duration: Option<f64>,
    #[serde(rename = "pid")]
    process: u32,
    #[serde(rename = "tid")]
    track: u32,
    args: Map<String, Value>,
}

/// Interval of time in whole nanoseconds. Both ends are rounded, so that an interval that encloses another still does
/// so after rounding.
#[derive(Clone, Copy)]
struct TraceInterval {
    begin: u64,
    end: u64,
}

impl TraceInterval {
    /// Returns the interval of a pass, or none if the pass has no timestamps.
    fn of(pass: &PassTime) -> Option<Self> {
        let nanoseconds = |ms: f64| (ms * 1e6).round() as u64;
        let (start, ms) = pass.start_ms.zip(pass.ms)?;
        Some(Self { begin: nanoseconds(start), end: nanoseconds(start + ms) })
    }

    /// Returns the interval from the earliest start to the latest end, or none if no pass has timestamps.
    fn around(passes: &[&PassTime]) -> Option<Self> {
        let intervals = passes.iter().filter_map(|pass| Self::of(pass));
        intervals.reduce(|a, b| Self { begin: a.begin.min(b.begin), end: a.end.max(b.end) })
    }

    /// Returns the interval `begin` nanoseconds later.
    fn after(self, begin: u64) -> Self {
        Self { begin: self.begin + begin, end: self.end + begin }
    }
}

/// Returns the trace as JSON that ends with a line break. `origin` is the moment when the command began, which is
/// time 0.
///
/// The device's clock differs from the CPU's, so the two cannot be compared. In the trace, the device's first pass
/// begins at the moment when the CPU submitted the frame.
pub fn trace_json(origin: Instant, spans: &[Span], frame: &Profile) -> Vec<u8> {
    let mut events = vec![
        named("process_name", CPU, "kdray"),
        named("thread_name", CPU, "CPU"),
        named("thread_name", PASSES, &format!("passes on {}", frame.device)),
    ];
    let since = |moment: Instant| moment.saturating_duration_since(origin).as_nanos() as u64;
    events.extend(spans.iter().map(|span| {
        let interval = TraceInterval { begin: since(span.begin), end: since(span.end) };
        slice(span.name.to_owned(), CPU, interval, Map::new())
    }));
    events.extend(frame_slices(frame, frame.begun_at.map_or(0, since)));
    let mut json = serde_json::to_vec(&Trace { events, unit: "ms" }).expect("plain structs of numbers and words");
    json.push(b'\n');
    json
}

/// Returns nested slices: the frame, its batches if there are several, and in each batch its bounces and a slice
/// `light`, which holds the shadow and shading passes of all bounces. The innermost slices are the single passes.
/// `begun_at` is in nanoseconds since time 0.
fn frame_slices(frame: &Profile, begun_at: u64) -> Vec<Event> {
    let mut slices = Vec::new();
    let mut add = |name: String, passes: &[&PassTime], args| {
        if let Some(interval) = TraceInterval::around(passes) {
            slices.push(slice(name, PASSES, interval.after(begun_at), args));
        }
    };
    add("frame".to_owned(), &frame.passes.iter().collect::<Vec<_>>(), object(json!({ "n_batches": frame.n_batches })));
    let batches = frame.passes.chunk_by(|a, b| a.batch == b.batch);
    for batch in batches {
        let of_batch: Vec<_> = batch.iter().collect();
        if let Some(batch_ix) = batch[0].batch.filter(|_| frame.n_batches > 1) {
            add(format!("batch {batch_ix}"), &of_batch, Map::new());
        }
        for bounce in batch.chunk_by(|a, b| a.bounce == b.bounce) {
            let name = match (bounce[0].bounce, bounce[0].batch) {
                (Some(bounce_ix), _) => Some(format!("bounce {bounce_ix}")),
                (None, Some(_)) => Some("light".to_owned()),
                (None, None) => None,
            };
            if let Some(name) = name {
                let args = object(json!({ "n_rays": bounce[0].n_rays_in }));
                add(name, &bounce.iter().collect::<Vec<_>>(), args);
            }
            for pass in bounce {
                add(pass.name.to_owned(), &[pass], rays(pass));
            }
        }
    }
    slices
}

fn rays(pass: &PassTime) -> Map<String, Value> {
    let counts = [("n_rays_in", pass.n_rays_in), ("n_rays_out", pass.n_rays_out)];
    counts.into_iter().filter_map(|(name, n)| Some((name.to_owned(), n?.into()))).collect()
}

fn object(value: Value) -> Map<String, Value> {
    match value {
        Value::Object(map) => map,
        _ => Map::new(),
    }
}

fn slice(name: String, track: u32, interval: TraceInterval, args: Map<String, Value>) -> Event {
    let microseconds = |nanoseconds: u64| nanoseconds as f64 / 1e3;
    Event {
        name,
        category: if track == CPU { "cpu" } else { "pass" },
        phase: "X",
        start: microseconds(interval.begin),
        duration: Some(microseconds(interval.end.saturating_sub(interval.begin))),
        process: 1,
        track,
        args,
    }
}

/// Returns the event that names the process or a track. `kind` is `process_name` or `thread_name`.
fn named(kind: &str, track: u32, name: &str) -> Event {
    let args = object(json!({ "name": name }));
    Event {
        name: kind.to_owned(),
        category: "__metadata",
        phase: "M",
        start: 0.0,
        duration: None,
        process: 1,
        track,
        args,
    }
}
