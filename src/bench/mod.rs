//! Measurements: what is timed, how often, and what it is compared with. `kdray bench` prints what they find.
//!
//! ```text
//! paper      the four shipped scenes, frame by frame, beside the paper's own times
//! traversal  every way through the kd-tree on four sets of rays
//!   stage      scene -> room, camera, light, tree
//!   rays       stage -> camera rays, and the rays that leave their hits
//!   difference hits -> how many are not what the CPU finds
//! driver     the traversal against the driver's own ray tracing
//! size       one shape of ever more triangles
//! chart      numbers -> SVG
//! ```
//!
//! Times are medians of many runs after a warm-up, and what is compared runs in turns, so that a clock that drifts
//! favours nobody.

pub mod chart;
pub mod difference;
pub mod driver;
pub mod paper;
pub mod rays;
pub mod size;
pub mod stage;
pub mod traversal;
pub mod variant;

use std::time::{Duration, Instant};

use serde::Serialize;

/// How long a device works before its times count. One that has been idle for some seconds runs at a low clock (an H200
/// at 345 MHz instead of 1980) until it has been busy for a while, and short bursts don't do.
const WARM_UP: Duration = Duration::from_millis(200);

/// Does the work again and again until the device is warm; at least once.
fn warm_up<E>(mut work: impl FnMut() -> Result<(), E>) -> Result<(), E> {
    let begin = Instant::now();
    while {
        work()?;
        begin.elapsed() < WARM_UP
    } {}
    Ok(())
}

/// Numbers from repeated runs, in whatever unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Of an even number, the upper of the two in the middle.
    pub median: f64,
    pub min: f64,
    pub max: f64,
}

impl Spread {
    /// None for no numbers. They must not be NaN.
    pub fn of(numbers: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut sorted: Vec<f64> = numbers.into_iter().collect();
        sorted.sort_by(|a, b| a.partial_cmp(b).expect("a measured number"));
        let (&min, &max) = (sorted.first()?, sorted.last()?);
        Some(Self { median: sorted[sorted.len() / 2], min, max })
    }

    /// Million rays a second, of times in milliseconds that each took `n_rays`; none where a time is 0.
    pub fn mrays_per_s(&self, n_rays: u64) -> Option<Self> {
        let rate = |ms: f64| n_rays as f64 / ms / 1e3;
        (self.min > 0.0).then(|| Self { median: rate(self.median), min: rate(self.max), max: rate(self.min) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_in_the_middle_whatever_the_order() {
        assert_eq!(Spread::of([3.0, 9.0, 1.0]), Some(Spread { median: 3.0, min: 1.0, max: 9.0 }));
        assert_eq!(Spread::of([2.0, 1.0]), Some(Spread { median: 2.0, min: 1.0, max: 2.0 }));
        assert_eq!(Spread::of([]), None);
    }

    #[test]
    fn the_longest_time_is_the_lowest_rate() {
        let times = Spread { median: 2.0, min: 1.0, max: 4.0 };
        assert_eq!(times.mrays_per_s(8000), Some(Spread { median: 4.0, min: 2.0, max: 8.0 }));
        assert_eq!(Spread { min: 0.0, ..times }.mrays_per_s(8000), None);
    }
}
