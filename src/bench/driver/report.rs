//! The report of the `driver` suite.

use serde::Serialize;

use super::{builds::Builds, changing::ChangingFrames, contest::ContenderResult};
use crate::{
    accel::kdtree::Statistics,
    bench::{
        Spread,
        chart::{BarChart, Scale, Series},
        difference::{DriverDifference, is_hit},
        rays::RaySetKind,
    },
};

/// Times of one tracer on one set of rays.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Timing {
    /// Time of the whole set; none where the device has no timestamps.
    pub ms: Option<Spread>,
    /// Million rays per second.
    pub mrays_per_s: Option<Spread>,
}

impl Timing {
    fn new(ms: Option<Spread>, n_rays: usize) -> Self {
        Self { ms, mrays_per_s: ms.and_then(|ms| ms.mrays_per_s(n_rays as u64)) }
    }

    /// Returns the ratio of this tracer's speed to that of another one with the same number of rays, by medians.
    fn ratio_to(&self, other: &Self) -> Option<f64> {
        let ratio = self.mrays_per_s.zip(other.mrays_per_s).map(|(own, other)| own.median / other.median);
        ratio.filter(|ratio| ratio.is_finite()) // not finite if there are no rays
    }
}

/// The results on one set of rays.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SetResult {
    pub rays: RaySetKind,
    pub n_rays: usize,
    /// Number of hits that the driver finds.
    pub n_hits: usize,
    pub driver: Timing,
    pub kdray: Vec<SearchResult>,
}

/// The result of one of kdray's searches on one set of rays, beside the driver's.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SearchResult {
    pub traversal: String,
    #[serde(flatten)]
    pub timing: Timing,
    /// Its speed divided by the driver's.
    pub ratio: Option<f64>,
    /// Difference of its hits from the driver's.
    #[serde(flatten)]
    pub apart: DriverDifference,
}

impl SetResult {
    /// Makes the result from all contenders' results on the same rays. The first one is the driver's.
    pub fn new(rays: RaySetKind, trials: &[ContenderResult]) -> Self {
        let (driver, rivals) = trials.split_first().expect("the driver's trial");
        let n_rays = driver.hits.len();
        let driver_timing = Timing::new(driver.ms, n_rays);
        let rival = |trial: &ContenderResult| {
            let timing = Timing::new(trial.ms, n_rays);
            SearchResult {
                traversal: trial.name.clone(),
                timing,
                ratio: timing.ratio_to(&driver_timing),
                apart: DriverDifference::of(rays, &driver.hits, &trial.hits),
            }
        };
        Self {
            rays,
            n_rays,
            n_hits: driver.hits.iter().filter(|hit| is_hit(hit)).count(),
            driver: driver_timing,
            kdray: rivals.iter().map(rival).collect(),
        }
    }
}

/// The result of rasterization in place of primary rays, in the view of the set of primary rays.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RasterResult {
    /// Value of the option `--primary`.
    pub primary: String,
    /// Passes in the order of execution; empty where the device has no timestamps.
    pub passes: Vec<PassSpread>,
    /// Times of all passes together.
    #[serde(flatten)]
    pub timing: Timing,
    /// Its speed divided by that of the driver's primary rays.
    pub ratio: Option<f64>,
}

/// The time of one pass of a rasterization.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PassSpread {
    pub name: &'static str,
    pub ms: Spread,
}

impl RasterResult {
    /// Makes the result. `ms` is the time of all passes together; `primary_rays` holds the driver's result.
    pub fn new(primary: String, passes: Vec<PassSpread>, ms: Option<Spread>, primary_rays: &SetResult) -> Self {
        let timing = Timing::new(ms, primary_rays.n_rays);
        Self { primary, passes, timing, ratio: timing.ratio_to(&primary_rays.driver) }
    }
}

/// The suite's report.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Name of the suite: `driver`.
    pub suite: &'static str,
    /// The device's own name.
    pub device: String,
    /// The driver's name and version.
    pub driver: String,
    pub scene: String,
    /// Whether the scene was put into a closed room.
    pub room: bool,
    /// Width of the picture in pixels, with one primary ray each.
    pub width: u32,
    /// Height of the picture in pixels.
    pub height: u32,
    pub n_triangles: usize,
    pub tree: Statistics,
    /// Number of timed casts of each set by each tracer, and of timed frames.
    pub n_times: u16,
    /// Largest relative difference of the distances of the same hit.
    pub t_tolerance: f32,
    pub builds: Builds,
    pub sets: Vec<SetResult>,
    /// One entry per method of rasterization.
    pub raster: Vec<RasterResult>,
    /// Frames of a scene that changes, for each set and each structure that the GPU builds.
    pub changing: Vec<ChangingFrames>,
}

impl Report {
    /// Returns a chart of the speeds, with one group per set and one bar per tracer.
    pub fn chart(&self) -> BarChart {
        let rate = |timing: &Timing| timing.mrays_per_s.map(|rate| rate.median);
        let mut series =
            vec![Series { name: "driver".to_owned(), values: self.sets.iter().map(|set| rate(&set.driver)).collect() }];
        let rivals = self.sets.first().map_or(&[][..], |set| &set.kdray);
        series.extend(rivals.iter().enumerate().map(|(rival_ix, rival)| Series {
            name: format!("kdray, {}", rival.traversal),
            values: self.sets.iter().map(|set| rate(&set.kdray[rival_ix].timing)).collect(),
        }));
        series.extend(
            self.raster.iter().map(|raster| Series {
                name: format!("kdray, {}", raster.primary),
                values: (self.sets.iter())
                    .map(|set| rate(&raster.timing).filter(|_| set.rays == RaySetKind::Primary))
                    .collect(),
            }),
        );
        BarChart {
            title: format!("{}, {} triangles, on {}", self.scene, self.n_triangles, self.device),
            unit: "Mrays/s".to_owned(),
            scale: Scale::Linear,
            groups: self.sets.iter().map(|set| set.rays.name().to_owned()).collect(),
            series,
        }
    }

    /// Returns the first set and search for which more hits differ from the driver's than rounding explains.
    pub fn first_wrong(&self) -> Option<(&SetResult, &SearchResult)> {
        let mut pairs = self.sets.iter().flat_map(|set| set.kdray.iter().map(move |rival| (set, rival)));
        pairs.find(|(set, rival)| !rival.apart.is_rounding(set.n_rays))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::{Hit, NO_TRIANGLE};

    const MISS: Hit = Hit { t: f32::INFINITY, triangle_ix: NO_TRIANGLE, u: 0.0, v: 0.0 };

    fn hit(t: f32) -> Hit {
        Hit { t, triangle_ix: 3, u: 0.0, v: 0.0 }
    }

    fn trial(name: &str, ms: f64, hits: [Hit; 4]) -> ContenderResult {
        ContenderResult { name: name.to_owned(), ms: Spread::of([ms, 2.0 * ms, 3.0 * ms]), hits: hits.to_vec() }
    }

    fn set(rays: RaySetKind) -> SetResult {
        let right = [hit(1.0), hit(2.0), MISS, hit(3.0)];
        let wrong = [hit(1.0), MISS, hit(9.0), hit(3.1)];
        SetResult::new(rays, &[trial("driver", 3.0, right), trial("mask", 2.0, right), trial("stack", 6.0, wrong)])
    }

    #[test]
    fn speeds_are_ratios_of_medians_and_hits_are_held_against_the_drivers() {
        let result = set(RaySetKind::Mirror);
        assert_eq!((result.n_rays, result.n_hits, result.driver.ms.unwrap().median), (4, 3, 6.0));
        let [mask, stack] = &result.kdray[..] else { panic!("two rivals") };
        assert!((mask.ratio.unwrap() - 1.5).abs() < 1e-12 && (stack.ratio.unwrap() - 0.5).abs() < 1e-12);
        assert_eq!(mask.apart, DriverDifference::default());
        assert_eq!(stack.apart, DriverDifference { n_hit_or_miss: 2, n_distance: 1 });
        assert_eq!(set(RaySetKind::Shadow).kdray[1].apart, DriverDifference { n_hit_or_miss: 2, n_distance: 0 });
    }

    #[test]
    fn rasterized_rays_are_as_many_as_the_drivers() {
        let raster = RasterResult::new("raster".into(), Vec::new(), Spread::of([0.75]), &set(RaySetKind::Primary));
        assert!((raster.ratio.unwrap() - 8.0).abs() < 1e-12);
        let unknown = RasterResult::new("raster".into(), Vec::new(), None, &set(RaySetKind::Primary));
        assert_eq!((unknown.ratio, unknown.timing.mrays_per_s), (None, None));
    }

    #[test]
    fn no_rays_have_no_speed() {
        let nobody = |name: &str| ContenderResult { hits: Vec::new(), ..trial(name, 1.0, [hit(1.0); 4]) };
        let result = SetResult::new(RaySetKind::Shadow, &[nobody("driver"), nobody("mask")]);
        assert_eq!(
            (result.n_rays, result.kdray[0].ratio, result.kdray[0].apart),
            (0, None, DriverDifference::default())
        );
    }

    #[test]
    fn without_timestamps_only_hits_are_compared() {
        let untimed = |name| ContenderResult { ms: None, ..trial(name, 1.0, [hit(1.0); 4]) };
        let result = SetResult::new(RaySetKind::Primary, &[untimed("driver"), untimed("mask")]);
        assert_eq!((result.kdray[0].ratio, result.kdray[0].apart), (None, DriverDifference::default()));
    }
}
