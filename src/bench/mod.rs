//! Benchmarks. `kdray bench` runs them and prints their reports. Each benchmark with a report is called a suite.
//!
//! ```text
//! paper      suite: whole frames of the four shipped scenes, beside the paper's own times
//! traversal  suite: all traversals of the kd-tree and the searches through grids, on four sets of rays
//!   variant    an acceleration structure with a search through it
//!   stage      scene -> room, camera, light, acceleration structures
//!   rays       stage -> camera rays, and the rays that leave their hits
//!   difference hits -> the number that differ from the CPU's
//! driver     suite: the searches against the driver's own ray tracing
//! size       suite: one shape of more and more triangles
//! motion     suite: the frames of an animation, from the pose to the picture
//! chart      numbers -> SVG
//! ```
//!
//! Times are medians of repeated runs after a warm-up; only the CPU's frames in `paper` have no warm-up. Searches
//! that are compared take turns, so that a drifting clock affects all of them alike.

pub mod chart;
pub mod difference;
pub mod driver;
pub mod motion;
pub mod paper;
pub mod rays;
pub mod size;
pub mod stage;
pub mod traversal;

use std::time::{Duration, Instant};

use serde::Serialize;

/// Time that a device works before its times count. A device that has been idle for some seconds runs at a low clock
/// (an H200 at 345 MHz instead of 1980 MHz) until it has been busy for a while; short bursts do not raise the clock.
const WARM_UP: Duration = Duration::from_millis(200);
/// The most rounds of a warm-up.
const MAX_ROUNDS: usize = 15;

/// Repeats the work in rounds of [`WARM_UP`], until two successive rounds are no faster than the fastest before them.
/// Work that takes longer than a round is done once.
fn warm_up<E>(mut work: impl FnMut() -> Result<(), E>) -> Result<(), E> {
    let (mut most, mut n_steady) = (0, 0);
    for _ in 0..MAX_ROUNDS {
        let (begin, mut n) = (Instant::now(), 0);
        while n == 0 || begin.elapsed() < WARM_UP {
            work()?;
            n += 1;
        }
        n_steady = if n * 50 <= most * 51 { n_steady + 1 } else { 0 };
        if n == 1 || n_steady == 2 {
            break;
        }
        most = most.max(n);
    }
    Ok(())
}

/// Median, minimum and maximum of numbers from repeated runs, in any unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Median. If there is an even number of numbers, the larger of the two in the middle.
    pub median: f64,
    pub min: f64,
    pub max: f64,
}

impl Spread {
    /// Returns the spread of some numbers, or `None` if there are none.
    ///
    /// # Panics
    /// A number is NaN.
    pub fn of(numbers: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut sorted: Vec<f64> = numbers.into_iter().collect();
        sorted.sort_by(|a, b| a.partial_cmp(b).expect("a measured number"));
        let (&min, &max) = (sorted.first()?, sorted.last()?);
        Some(Self { median: sorted[sorted.len() / 2], min, max })
    }

    /// Converts times in milliseconds, each for `n_rays` rays, to million rays per second. Returns `None` if a time
    /// is 0.
    pub fn mrays_per_s(&self, n_rays: u64) -> Option<Self> {
        let rate = |ms: f64| n_rays as f64 / ms / 1e3;
        (self.min > 0.0).then(|| Self { median: rate(self.median), min: rate(self.max), max: rate(self.min) })
    }
}

#[cfg(test)]
mod tests {
    use std::thread;

    use super::*;

    /// A device whose clock rises after 300 ms works at the higher clock before its warm-up ends.
    #[test]
    fn a_warm_up_ends_when_the_work_gets_no_faster() {
        let (begin, mut n_fast) = (Instant::now(), 0);
        let work = || {
            let is_fast = begin.elapsed() >= Duration::from_millis(300);
            thread::sleep(Duration::from_millis(if is_fast { 2 } else { 20 }));
            n_fast += u32::from(is_fast);
            Ok::<_, ()>(())
        };
        warm_up(work).unwrap();
        assert!(n_fast > 0);
    }

    #[test]
    fn work_that_takes_long_is_its_own_warm_up() {
        let mut n = 0;
        let work = || {
            n += 1;
            thread::sleep(WARM_UP);
            Ok::<_, ()>(())
        };
        warm_up(work).unwrap();
        assert_eq!(n, 1);
    }

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
