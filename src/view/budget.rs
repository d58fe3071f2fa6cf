//! Chooses how large a picture may be, so that it is drawn within a time budget.

use super::in_motion::PictureKind;

/// A picture's sides are k / `N_STEPS` of the window's, where the step k is at most `N_STEPS`.
const N_STEPS: u32 = 16;
/// The smallest step: 1/8 of a side, which is 1/64 of the pixels.
const LEAST_STEP: u32 = 2;
/// The picture grows by a step if it is then expected to take no more than this share of the budget.
const ROOM: f64 = 0.85;
/// Intended time, in milliseconds, of each of the batches in which a picture is drawn while the camera rests. Input
/// waits for the end of a batch.
pub const BATCH_MS: f64 = 100.0;
/// Weight of the newest frame in the mean cost.
const NEWEST: f64 = 0.4;

/// Number of budgets: for each kind of pictures, one of views that need all rays, and one of views that need primary
/// rays only.
pub const N_BUDGETS: usize = 2 * PictureKind::N;

/// Returns the index of a budget.
pub fn budget_ix(kind: PictureKind, needs_primary_rays_only: bool) -> usize {
    2 * kind as usize + usize::from(needs_primary_rays_only)
}

/// Chooses the size of pictures that are drawn while the camera moves.
#[derive(Clone, Debug)]
pub struct Budget {
    /// Milliseconds per frame.
    budget_ms: f64,
    /// The current step, [`LEAST_STEP`] to [`N_STEPS`].
    step: u32,
    /// Expected milliseconds of a frame of the window's full size; none if it is unknown.
    full_ms: Option<f64>,
    /// Whether a frame has been drawn. The first one is not counted: it takes long, because drivers finish compiling
    /// their kernels then.
    is_warm: bool,
}

impl Budget {
    /// Creates a budget of `budget_ms` milliseconds per frame, at the smallest step.
    pub fn new(budget_ms: f64) -> Self {
        Self { budget_ms, step: LEAST_STEP, full_ms: None, is_warm: false }
    }

    /// Sets the budget in milliseconds per frame.
    pub fn set_budget(&mut self, budget_ms: f64) {
        self.budget_ms = budget_ms;
    }

    /// Returns the picture's share of the window's sides, 0 to 1.
    pub fn share(&self) -> f64 {
        f64::from(self.step) / f64::from(N_STEPS)
    }

    /// Returns the picture's size for a window's size, both in pixels.
    pub fn size(&self, window: (u32, u32)) -> (u32, u32) {
        let part = |side: u32| (f64::from(side) * self.share()).round().max(1.0) as u32;
        (part(window.0), part(window.1))
    }

    /// Returns the expected milliseconds of a frame of the window's full size. Returns none while the time is
    /// unknown: before the second frame, and after the window's number of pixels has changed by more than a factor of
    /// two.
    pub fn full_ms(&self) -> Option<f64> {
        self.full_ms
    }

    /// Returns the number of pixels that are drawn in about [`BATCH_MS`], for a picture of a window's size. Returns
    /// none if the whole picture is drawn in that time, or if the time is unknown.
    pub fn batch_pixels(&self, (width, height): (u32, u32)) -> Option<u32> {
        let n_batches = (self.full_ms? / BATCH_MS).ceil();
        // The number of batches is a power of two, so that small changes of the estimate do not change it.
        let n_batches = (n_batches as u32).clamp(1, 1 << 12).next_power_of_two();
        (n_batches > 1).then(|| (width * height).div_ceil(n_batches))
    }

    /// Adapts to a window that has `ratio` times as many pixels as before. Beyond a factor of two the estimate is
    /// dropped and learned again, because the cost of a small window says nothing about that of a large one.
    pub fn resize(&mut self, ratio: f64) {
        self.full_ms = self.full_ms.filter(|_| (0.5..=2.0).contains(&ratio)).map(|full_ms| full_ms * ratio);
        if self.full_ms.is_none() {
            self.step = LEAST_STEP;
        }
    }

    /// Learns from a frame. `share` is its share of the window's sides, and `ms` is its whole time in milliseconds.
    pub fn learn(&mut self, share: f64, ms: f64) {
        if !std::mem::replace(&mut self.is_warm, true) {
            return;
        }
        let full_ms = ms / (share * share);
        let mean = self.full_ms.map_or(full_ms, |mean| mean + NEWEST * (full_ms - mean));
        self.full_ms = Some(mean);
        let expected = |step: u32| mean * (f64::from(step) / f64::from(N_STEPS)).powi(2);
        // The step goes down at once to what fits. It goes up by one at a time: costs that do not depend on the
        // picture's size are scaled with its pixels, so that the estimate for a larger picture is too high.
        if expected(self.step) > self.budget_ms {
            self.step =
                (LEAST_STEP..self.step).rev().find(|&step| expected(step) <= self.budget_ms).unwrap_or(LEAST_STEP);
        } else if self.step < N_STEPS && expected(self.step + 1) <= ROOM * self.budget_ms {
            self.step += 1;
        }
    }
}

/// Returns whether two numbers of pixels per batch differ by a factor of two or more. None stands for the whole
/// picture.
pub fn differs_by_two(a: Option<u32>, b: Option<u32>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => a >= 2 * b || b >= 2 * a,
        (a, b) => a != b,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the budget after 100 frames, and the shares of the last 50. A frame costs `fixed_ms`, and `full_ms`
    /// times its share of the pixels.
    fn settled(budget_ms: f64, fixed_ms: f64, full_ms: f64) -> (Budget, Vec<f64>) {
        let mut budget = Budget::new(budget_ms);
        let shares: Vec<_> = (0..100)
            .map(|_| {
                let share = budget.share();
                budget.learn(share, fixed_ms + full_ms * share * share);
                share
            })
            .collect();
        (budget, shares[50..].to_vec())
    }

    #[test]
    fn frames_come_to_fit_the_budget() {
        for full_ms in [1.0, 10.0, 18.0, 40.0, 100.0, 500.0] {
            let (budget, _) = settled(16.0, 0.5, full_ms);
            let share = budget.share();
            let ms = 0.5 + full_ms * share * share;
            assert!(ms <= 16.0, "{full_ms}: {ms}");
            // The step from 2 to 3 more than doubles the pixels, so at step 2 a frame may take little of the budget.
            assert!(share == 1.0 || ms > 16.0 * 0.35, "{full_ms}: {ms} at {share}");
        }
    }

    #[test]
    fn the_first_frame_teaches_nothing() {
        let mut budget = Budget::new(16.0);
        budget.learn(0.125, 5000.0);
        assert_eq!(budget.full_ms(), None);
        budget.learn(0.125, 1.0);
        assert_eq!(budget.full_ms(), Some(64.0));
    }

    #[test]
    fn another_window_costs_by_its_pixels_or_is_learned_anew() {
        let (mut budget, _) = settled(16.0, 0.0, 10.0);
        budget.resize(1.5);
        assert!((budget.full_ms().unwrap() - 15.0).abs() < 1e-6 && budget.share() == 1.0);
        budget.resize(1000.0);
        assert_eq!((budget.full_ms(), budget.size((640, 480))), (None, (80, 60)));
        budget.learn(0.125, 1.0);
        assert_eq!(budget.full_ms(), Some(64.0));
    }

    #[test]
    fn the_size_does_not_swing() {
        for (fixed_ms, full_ms) in [(0.0, 30.0), (4.0, 30.0), (8.0, 64.0), (12.0, 100.0)] {
            let (_, shares) = settled(16.0, fixed_ms, full_ms);
            assert!(shares.iter().all(|share| *share == shares[0]), "{fixed_ms} {full_ms}: {shares:?}");
        }
    }

    #[test]
    fn what_never_fits_is_drawn_small_and_what_always_fits_whole() {
        let (slow, _) = settled(16.0, 50.0, 1e5);
        assert_eq!(slow.size((640, 480)), (80, 60));
        assert_eq!(slow.size((1, 1)), (1, 1));
        let (fast, _) = settled(16.0, 0.1, 0.1);
        assert_eq!(fast.size((641, 479)), (641, 479));
    }
}
