//! The last frames: when, how long, what for.

use std::collections::VecDeque;

use serde::Serialize;

/// One frame that was shown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameRecord {
    /// Seconds since the start, when it was handed to the screen.
    pub shown_s: f64,
    /// Since the frame before was shown, or its drawing began where the viewer had rested.
    pub frame_ms: f64,
    /// From the oldest input that it is the first to show to its hand-over to the screen; none without input.
    pub latency_ms: Option<f64>,
    /// Width and height of the picture, pixels, if the camera moved.
    pub moving: Option<(u32, u32)>,
    /// GPU time of each pass, in the order of execution; empty where the device has no timestamps.
    pub pass_ms: Vec<(&'static str, f64)>,
}

/// Frames of the last seconds.
pub struct History {
    frames: VecDeque<FrameRecord>,
    /// Seconds.
    length_s: f64,
}

impl History {
    /// Keeps what was shown within so many seconds before the newest.
    pub fn new(length_s: f64) -> Self {
        Self { frames: VecDeque::new(), length_s }
    }

    pub fn push(&mut self, frame: FrameRecord) {
        let oldest = frame.shown_s - self.length_s;
        self.frames.push_back(frame);
        while self.frames.front().is_some_and(|frame| frame.shown_s < oldest) {
            self.frames.pop_front();
        }
    }

    /// Oldest first.
    pub fn frames(&self) -> impl DoubleEndedIterator<Item = &FrameRecord> {
        self.frames.iter()
    }

    /// Seconds.
    pub fn length_s(&self) -> f64 {
        self.length_s
    }

    /// Of frame times.
    pub fn pace(&self) -> Option<Percentiles> {
        Percentiles::of(self.frames().map(|frame| frame.frame_ms).collect())
    }

    /// Of those that were drawn while the camera moved.
    pub fn moving(&self) -> Option<Moving> {
        let moving = || self.frames().filter_map(|frame| Some((frame.moving?, frame.frame_ms)));
        let frame_ms = Percentiles::of(moving().map(|(_, ms)| ms).collect())?;
        let mut sizes: Vec<_> = moving().map(|(size, _)| size).collect();
        sizes.sort_by_key(|(width, height)| u64::from(*width) * u64::from(*height));
        let (width, height) = sizes[sizes.len() / 2];
        Some(Moving { width, height, frame_ms })
    }

    /// Of the latency of those that answered input.
    pub fn latency(&self) -> Option<Percentiles> {
        Percentiles::of(self.frames().filter_map(|frame| frame.latency_ms).collect())
    }
}

/// What the budget made of frames while the camera moved.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Moving {
    /// Of the picture of median size, pixels.
    pub width: u32,
    pub height: u32,
    /// From a frame to the next, milliseconds.
    pub frame_ms: Percentiles,
}

/// Of times, in milliseconds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Percentiles {
    pub n: usize,
    pub p50: f64,
    pub p95: f64,
    pub p99: f64,
}

impl Percentiles {
    /// The least times that so many percent do not exceed (nearest rank); none of none.
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
