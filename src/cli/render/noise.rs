//! What `--noise` has led to.

use kdray::engine::{NoiseGoal, NoisePicture};

use crate::cli::report::NoiseReport;

/// How many samples pictures needed, and how many of their tiles have the most samples but more noise than the goal.
#[derive(Clone, Copy)]
pub struct NoiseReached {
    n_pictures: u32,
    /// The sum over all pictures.
    mean_samples: f64,
    n_tiles: usize,
    n_noisy: usize,
}

impl NoiseReached {
    pub fn of(picture: &NoisePicture) -> Self {
        let &NoisePicture { mean_samples, n_tiles, n_noisy, .. } = picture;
        Self { n_pictures: 1, mean_samples, n_tiles, n_noisy }
    }

    /// Returns what holds of all pictures together, or none if there are none.
    pub fn of_all(pictures: impl Iterator<Item = Self>) -> Option<Self> {
        pictures.reduce(|a, b| Self {
            n_pictures: a.n_pictures + b.n_pictures,
            mean_samples: a.mean_samples + b.mean_samples,
            n_tiles: a.n_tiles + b.n_tiles,
            n_noisy: a.n_noisy + b.n_noisy,
        })
    }

    pub fn report(self, goal: NoiseGoal) -> NoiseReport {
        NoiseReport {
            goal: goal.noise,
            mean_samples: self.mean_samples / f64::from(self.n_pictures),
            n_tiles: self.n_tiles,
            n_noisy_tiles: self.n_noisy,
        }
    }
}
