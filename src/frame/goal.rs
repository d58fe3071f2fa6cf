//! The end of a picture: a number of samples, or a time.

use std::time::{Duration, Instant};

use super::{Integrator, SampleRange, sampling::samples_log2};
use crate::layout::SAMPLE_BLOCK_LOG2;

/// How many samples of each pixel a picture gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Goal {
    /// A number of samples, at least one.
    Samples(u32),
    /// As many samples as are drawn in a time, but at least one and at most [`SampleRange::MOST`].
    Time(Duration),
}

/// Decides how many samples each frame of a picture draws.
pub struct Pacer {
    goal: Goal,
    integrator: Integrator,
    /// Base-2 logarithm of the most samples of a frame of paths, if the goal is a number of samples.
    most_log2: u32,
    begun_at: Instant,
    /// Number of samples before the last frame, and the time at which it began.
    last: Option<(u32, Duration)>,
}

impl Pacer {
    /// Begins a picture. `most_log2`: base-2 logarithm of the most samples that a frame of paths draws if the goal is a
    /// number of samples.
    pub fn new(goal: Goal, integrator: Integrator, most_log2: u32) -> Self {
        Self { goal, integrator, most_log2, begun_at: Instant::now(), last: None }
    }

    /// Returns the base-2 logarithm of the number of samples that the next frame draws, or none if the picture is
    /// complete. `n_drawn`: number of samples so far.
    pub fn next(&mut self, n_drawn: u32) -> Option<u32> {
        self.next_at(n_drawn, self.begun_at.elapsed())
    }

    /// Does what [`Pacer::next`] does when the time `now` has passed.
    fn next_at(&mut self, n_drawn: u32, now: Duration) -> Option<u32> {
        let log2 = match (self.goal, self.integrator) {
            (Goal::Samples(n_samples), _) if n_drawn >= n_samples.max(1) => return None,
            (Goal::Samples(n_samples), Integrator::Path) => samples_log2(n_drawn, n_samples, self.most_log2),
            (Goal::Time(_), _) if n_drawn >= SampleRange::MOST => return None,
            // The first frame is one sample, since its time is unknown. Later frames are short, to end near the time.
            (Goal::Time(_), Integrator::Path) if n_drawn > 0 => n_drawn.trailing_zeros().min(SAMPLE_BLOCK_LOG2),
            _ => 0,
        };
        if let (Goal::Time(time), Some((n_before, began))) = (self.goal, self.last) {
            // The next frame's samples are expected to take as long as those of the last one.
            let per_sample = (now - began).as_secs_f64() / f64::from(n_drawn - n_before);
            if now.as_secs_f64() + per_sample * f64::from(1_u32 << log2) > time.as_secs_f64() {
                return None;
            }
        }
        self.last = Some((n_drawn, now));
        Some(log2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the numbers of samples of a picture's frames if a sample takes `sample_ms`.
    fn frames(goal: Goal, integrator: Integrator, sample_ms: u64) -> Vec<u32> {
        let (mut pacer, mut n_drawn, mut frames) = (Pacer::new(goal, integrator, SAMPLE_BLOCK_LOG2), 0, Vec::new());
        while let Some(log2) = pacer.next_at(n_drawn, Duration::from_millis(u64::from(n_drawn) * sample_ms)) {
            frames.push(1 << log2);
            n_drawn += 1 << log2;
        }
        frames
    }

    #[test]
    fn a_number_of_samples_is_met() {
        assert_eq!(frames(Goal::Samples(41), Integrator::Path, 9), [16, 16, 8, 1]);
        assert_eq!(frames(Goal::Samples(3), Integrator::Whitted, 9), [1, 1, 1]);
        assert_eq!(frames(Goal::Samples(0), Integrator::Whitted, 9), [1]);
    }

    #[test]
    fn a_time_is_filled_and_not_exceeded() {
        let time = |ms| Goal::Time(Duration::from_millis(ms));
        assert_eq!(frames(time(1000), Integrator::Path, 10), [1, 1, 2, 4, 8, 16, 16, 16, 16, 16]);
        assert_eq!(frames(time(95), Integrator::Path, 10), [1, 1, 2, 4]);
        assert_eq!(frames(time(95), Integrator::Whitted, 10), [1; 9]);
        assert_eq!(frames(time(95), Integrator::Whitted, 100), [1], "there is at least one sample");
        assert_eq!(frames(time(95), Integrator::Path, 0).iter().sum::<u32>(), SampleRange::MOST);
    }
}
