//! How large a picture may be to be drawn in time.

/// Sides of the picture as shares of the window's: k of so many parts.
const N_STEPS: u32 = 16;
/// The smallest share, in parts: 1/8 of a side is 1/64 of the pixels.
const LEAST_STEP: u32 = 2;
/// A larger picture is drawn where it is expected to take no more than this share of the budget.
const ROOM: f64 = 0.85;
/// Milliseconds that input waits for while a picture at rest is drawn, if all parts of it take as long.
pub const PART_MS: f64 = 100.0;
/// Weight of the newest frame in the mean cost.
const NEWEST: f64 = 0.4;

/// Chooses the size of pictures that are drawn while the camera moves.
#[derive(Clone, Debug)]
pub struct Budget {
    /// Milliseconds a frame.
    budget_ms: f64,
    /// Of [`N_STEPS`].
    step: u32,
    /// Expected milliseconds of a frame of the window's full size.
    full_ms: Option<f64>,
    /// Whether there was a frame: the first one takes long, since drivers finish their kernels then.
    is_warm: bool,
}

impl Budget {
    pub fn new(budget_ms: f64) -> Self {
        Self { budget_ms, step: LEAST_STEP, full_ms: None, is_warm: false }
    }

    /// Milliseconds a frame.
    pub fn set_budget(&mut self, budget_ms: f64) {
        self.budget_ms = budget_ms;
    }

    /// The picture's share of the window's sides, 0 to 1.
    pub fn share(&self) -> f64 {
        f64::from(self.step) / f64::from(N_STEPS)
    }

    /// The picture's size for a window's, pixels.
    pub fn size(&self, window: (u32, u32)) -> (u32, u32) {
        let part = |side: u32| (f64::from(side) * self.share()).round().max(1.0) as u32;
        (part(window.0), part(window.1))
    }

    /// Expected milliseconds of a frame of the window's full size; none before there were two frames.
    pub fn full_ms(&self) -> Option<f64> {
        self.full_ms
    }

    /// Pixels of a picture of a window's size that are drawn in about [`PART_MS`]; none where all of them are.
    pub fn part_pixels(&self, (width, height): (u32, u32)) -> Option<u32> {
        let n_parts = (self.full_ms? / PART_MS).ceil();
        // Powers of two, so that estimates that waver do not change them.
        let n_parts = (n_parts as u32).clamp(1, 1 << 12).next_power_of_two();
        (n_parts > 1).then(|| (width * height).div_ceil(n_parts))
    }

    /// The window has `ratio` times as many pixels as before. What small windows cost says nothing of large ones: beyond
    /// a factor of two it is learned anew.
    pub fn resize(&mut self, ratio: f64) {
        self.full_ms = self.full_ms.filter(|_| (0.5..=2.0).contains(&ratio)).map(|full_ms| full_ms * ratio);
        if self.full_ms.is_none() {
            self.step = LEAST_STEP;
        }
    }

    /// Learns from a frame of a share of the sides that took so long, all of it counted.
    pub fn learn(&mut self, share: f64, ms: f64) {
        if !std::mem::replace(&mut self.is_warm, true) {
            return;
        }
        let full_ms = ms / (share * share);
        let mean = self.full_ms.map_or(full_ms, |mean| mean + NEWEST * (full_ms - mean));
        self.full_ms = Some(mean);
        let expected = |step: u32| mean * (f64::from(step) / f64::from(N_STEPS)).powi(2);
        // Down at once to what fits; up one step at a time, since what does not shrink with the picture is counted as
        // if it did.
        if expected(self.step) > self.budget_ms {
            self.step =
                (LEAST_STEP..self.step).rev().find(|&step| expected(step) <= self.budget_ms).unwrap_or(LEAST_STEP);
        } else if self.step < N_STEPS && expected(self.step + 1) <= ROOM * self.budget_ms {
            self.step += 1;
        }
    }
}

/// Whether parts of so many pixels would take half or twice as long as before.
pub fn is_other_pace(a: Option<u32>, b: Option<u32>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => a >= 2 * b || b >= 2 * a,
        (a, b) => a != b,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The budget after frames that cost `fixed_ms` and `full_ms` times their share of the pixels, and the shares of the
    /// last ones.
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
            // The least step up, from 2 to 3 parts, is more than twice the pixels.
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
