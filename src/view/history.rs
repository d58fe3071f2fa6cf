//! Records of the last frames: their times, latencies and passes.

use std::collections::VecDeque;

use serde::Serialize;

/// Record of a frame that was shown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameRecord {
    /// Time when the frame was handed to the screen, seconds since the viewer started.
    pub shown_s: f64,
    /// Time since the previous frame was shown or, after a pause, since the drawing of this frame began.
    pub frame_ms: f64,
    /// Input latency: the time from an input's arrival until this frame was handed to the screen, if this frame is
    /// the first that shows the input. Of several inputs, the oldest counts. None without input.
    pub latency_ms: Option<f64>,
    /// Width and height of the picture in pixels, if the frame was drawn while the camera moved; none otherwise.
    pub moving: Option<(u32, u32)>,
    /// GPU time of each pass of the sample that the frame has completed, in the order of execution. Empty if it has
    /// completed none, or if the device has no timestamps.
    pub pass_ms: Vec<(&'static str, f64)>,
}

/// The history reaches back to the beginning of this number of the newest samples, even if that is longer ago than
/// its least length. It is never longer than [`TOO_LONG_S`]. A sample is a frame with times of passes.
const N_SLOW_SAMPLES: usize = 3;
/// Longest history in seconds, unless its least length is longer.
const TOO_LONG_S: f64 = 60.0;

/// Frames of the last seconds. If a sample takes seconds, the history reaches further back.
pub struct History {
    frames: VecDeque<FrameRecord>,
    /// Least length of the history, seconds.
    shortest_s: f64,
}

impl FrameRecord {
    /// Returns the GPU time of all passes.
    pub fn busy_ms(&self) -> f64 {
        self.pass_ms.iter().map(|(_, ms)| ms).sum()
    }
}

impl History {
    /// Creates an empty history that keeps the frames of the last `shortest_s` seconds, and more if the newest
    /// samples take longer.
    pub fn new(shortest_s: f64) -> Self {
        Self { frames: VecDeque::new(), shortest_s }
    }

    /// Adds the newest frame and drops frames that are too old.
    pub fn push(&mut self, frame: FrameRecord) {
        let newest = frame.shown_s;
        self.frames.push_back(frame);
        let oldest = newest - self.length_s();
        while self.frames.front().is_some_and(|frame| frame.shown_s < oldest) {
            self.frames.pop_front();
        }
    }

    /// Returns the frames, the oldest first.
    pub fn frames(&self) -> impl DoubleEndedIterator<Item = &FrameRecord> {
        self.frames.iter()
    }

    /// Returns the length in seconds of the time span whose frames are kept. It ends when the newest frame was shown.
    pub fn length_s(&self) -> f64 {
        let Some(newest) = self.frames.back() else { return self.shortest_s };
        let samples = self.frames.iter().rev().filter(|frame| !frame.pass_ms.is_empty()).take(N_SLOW_SAMPLES);
        let ago = |sample: &FrameRecord| newest.shown_s - sample.shown_s + sample.busy_ms() * 1e-3;
        samples.map(ago).fold(self.shortest_s, f64::max).min(TOO_LONG_S.max(self.shortest_s))
    }

    /// Returns the percentiles of the frame times.
    pub fn pace(&self) -> Option<Percentiles> {
        Percentiles::of(self.frames().map(|frame| frame.frame_ms).collect())
    }

    /// Returns size and times of the frames that were drawn while the camera moved, or none without such frames.
    pub fn moving(&self) -> Option<Moving> {
        let moving = || self.frames().filter_map(|frame| Some((frame.moving?, frame.frame_ms)));
        let frame_ms = Percentiles::of(moving().map(|(_, ms)| ms).collect())?;
        let mut sizes: Vec<_> = moving().map(|(size, _)| size).collect();
        sizes.sort_by_key(|(width, height)| u64::from(*width) * u64::from(*height));
        let (width, height) = sizes[sizes.len() / 2];
        Some(Moving { width, height, frame_ms })
    }

    /// Returns the percentiles of the latency of frames that showed an input.
    pub fn latency(&self) -> Option<Percentiles> {
        Percentiles::of(self.frames().filter_map(|frame| frame.latency_ms).collect())
    }
}

/// Size and times of the frames that were drawn while the camera moved.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Moving {
    /// Width of the picture of median size, pixels.
    pub width: u32,
    /// Height of the picture of median size, pixels.
    pub height: u32,
    /// Time from one frame to the next, milliseconds.
    pub frame_ms: Percentiles,
}

/// Percentiles of times, in milliseconds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Percentiles {
    /// Number of times.
    pub n: usize,
    /// The median.
    pub p50: f64,
    /// The time that 95 % of the times do not exceed.
    pub p95: f64,
    /// The time that 99 % of the times do not exceed.
    pub p99: f64,
}

impl Percentiles {
    /// Returns the percentiles by nearest rank: p is the least time that p percent of the times do not exceed.
    /// Returns none if there are no times.
    pub fn of(mut times: Vec<f64>) -> Option<Self> {
        times.sort_by(f64::total_cmp);
        let n = times.len();
        let at = |percent: usize| times[(n * percent).div_ceil(100).max(1) - 1];
        (n > 0).then(|| Self { n, p50: at(50), p95: at(95), p99: at(99) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_nearest_ranks() {
        let hundred = Percentiles::of((1..=100).rev().map(f64::from).collect()).unwrap();
        assert_eq!(hundred, Percentiles { n: 100, p50: 50.0, p95: 95.0, p99: 99.0 });
        let three = Percentiles::of(vec![3.0, 1.0, 2.0]).unwrap();
        assert_eq!(three, Percentiles { n: 3, p50: 2.0, p95: 3.0, p99: 3.0 });
        assert_eq!(Percentiles::of(vec![7.0]).unwrap().p50, 7.0);
        assert_eq!(Percentiles::of(Vec::new()), None);
    }

    #[test]
    fn slow_samples_are_kept() {
        let mut history = History::new(2.0);
        for i in 0..60 {
            // Every tenth frame ends a sample of 8 s.
            let pass_ms = if i % 10 == 9 { vec![("trace", 8000.0)] } else { Vec::new() };
            history.push(FrameRecord { shown_s: f64::from(i), pass_ms, ..Default::default() });
        }
        assert_eq!(history.length_s(), 28.0);
        assert_eq!(history.frames().next().unwrap().shown_s, 31.0);
        assert_eq!(history.frames().filter(|frame| frame.busy_ms() > 0.0).count(), 3);
        let pass_ms = vec![("trace", 1e6)];
        history.push(FrameRecord { shown_s: 60.0, pass_ms, ..Default::default() });
        assert_eq!(history.length_s(), TOO_LONG_S);
    }

    #[test]
    fn only_the_last_seconds_are_kept() {
        let mut history = History::new(2.0);
        for i in 0..10 {
            let latency_ms = (i % 2 == 0).then_some(1.0);
            let moving = (i % 2 == 1).then_some((10 * i, 10));
            let frame_ms = f64::from(i);
            history.push(FrameRecord { shown_s: f64::from(i), frame_ms, latency_ms, moving, ..Default::default() });
        }
        let kept: Vec<_> = history.frames().map(|frame| frame.shown_s).collect();
        assert_eq!(kept, [7.0, 8.0, 9.0]);
        assert_eq!((history.pace().unwrap().n, history.latency().unwrap().n), (3, 1));
        let frame_ms = Percentiles { n: 2, p50: 7.0, p95: 9.0, p99: 9.0 };
        assert_eq!(history.moving(), Some(Moving { width: 90, height: 10, frame_ms }));
    }
}
