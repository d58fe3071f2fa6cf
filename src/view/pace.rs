//! Tells whether the camera moves or rests, and measures frame times and latencies.

use std::time::{Duration, Instant};

/// The camera counts as resting this long after its last motion.
const REST_AFTER: Duration = Duration::from_millis(150);

/// Times of the last motion of the camera, the last frame, and the oldest input that no frame has shown yet.
#[derive(Debug, Default)]
pub struct Pace {
    /// When the camera moved last; none if it has not moved yet, or if [`Pace::rest`] was called since.
    moved_at: Option<Instant>,
    /// When the last frame was shown; none after a pause.
    shown_at: Option<Instant>,
    /// When the current frame, or the last one, was begun.
    begun_at: Option<Instant>,
    /// When the oldest input that no frame has shown yet arrived.
    oldest_input: Option<Instant>,
}

/// Times of a frame that was shown, milliseconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameTimes {
    /// Time since the previous frame was shown or, after a pause, since this frame was begun.
    pub frame_ms: f64,
    /// Time since the oldest input that this frame is the first to show; none without input.
    pub latency_ms: Option<f64>,
}

impl Pace {
    /// Notes an input that the next frame will show.
    pub fn note_input(&mut self, now: Instant) {
        self.oldest_input.get_or_insert(now);
    }

    /// Notes that the camera has moved.
    pub fn moved(&mut self, now: Instant) {
        self.moved_at = Some(now);
    }

    /// Notes that the camera rests, without waiting for [`REST_AFTER`].
    pub fn rest(&mut self) {
        self.moved_at = None;
    }

    /// Returns whether the camera has moved within [`REST_AFTER`].
    pub fn is_moving(&self, now: Instant) -> bool {
        self.moved_at.is_some_and(|at| now.duration_since(at) < REST_AFTER)
    }

    /// Notes that a frame begins. Returns the seconds since the previous frame was begun, or 0 after a pause.
    pub fn begin(&mut self, now: Instant) -> f32 {
        let last = self.begun_at.replace(now).filter(|_| self.shown_at.is_some());
        last.map_or(0.0, |last| now.duration_since(last).as_secs_f32())
    }

    /// Notes that the frame was shown, and returns its times.
    pub fn shown(&mut self, now: Instant) -> FrameTimes {
        let since = |then: Instant| now.duration_since(then).as_secs_f64() * 1e3;
        let before = self.shown_at.replace(now).or(self.begun_at);
        FrameTimes { frame_ms: before.map_or(0.0, since), latency_ms: self.oldest_input.take().map(since) }
    }

    /// Notes that nothing is drawn until the next event.
    pub fn pause(&mut self) {
        self.shown_at = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_run_from_frame_to_frame_and_from_input_to_screen() {
        let start = Instant::now();
        let at = |ms: u64| start + Duration::from_millis(ms);
        let mut pace = Pace::default();
        assert_eq!(pace.begin(at(0)), 0.0);
        assert_eq!(pace.shown(at(10)), FrameTimes { frame_ms: 10.0, latency_ms: None });
        pace.note_input(at(12));
        pace.note_input(at(15));
        assert_eq!(pace.begin(at(20)), 0.02);
        assert_eq!(pace.shown(at(30)), FrameTimes { frame_ms: 20.0, latency_ms: Some(18.0) });
        pace.pause();
        assert_eq!(pace.begin(at(1000)), 0.0, "a pause is no time to fly");
        assert_eq!(pace.shown(at(1007)), FrameTimes { frame_ms: 7.0, latency_ms: None });
    }

    #[test]
    fn a_camera_rests_a_moment_after_it_moved() {
        let start = Instant::now();
        let mut pace = Pace::default();
        assert!(!pace.is_moving(start));
        pace.moved(start);
        assert!(pace.is_moving(start + REST_AFTER / 2) && !pace.is_moving(start + REST_AFTER));
        pace.rest();
        assert!(!pace.is_moving(start));
    }
}
