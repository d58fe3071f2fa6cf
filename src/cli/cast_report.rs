//! The report of `kdray cast`: hits and times, as text and as JSON.

use std::path::PathBuf;

use kdray::{
    accel::{DeviceBuild, Statistics},
    engine::choices::Choices,
};
use serde::Serialize;

use super::{report::built_in, table::decimal};

/// The report: the scene, the files of rays and hits, the device, the numbers of rays and hits, and the times.
#[derive(Serialize)]
pub struct CastReport {
    pub scene: String,
    pub rays: PathBuf,
    pub hits: PathBuf,
    pub query: &'static str,
    /// What was cast: rays or points.
    #[serde(skip)]
    pub noun: &'static str,
    /// The traversal of the kd-tree; none for grids.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub traversal: Option<String>,
    /// The choices of structure, build and traversal, each with its reason.
    pub choices: Choices,
    pub device: String,
    pub triangles: usize,
    /// Statistics of the acceleration structure, serialized under the key `tree` or `grid`.
    #[serde(flatten)]
    pub accel: Statistics,
    /// Times of the structure's build on the device; none if no device has built one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub device_build: Option<DeviceBuild>,
    pub n_rays: u64,
    pub n_hits: u64,
    /// Number of rays or points that can only miss. Those are points that are not finite or have a `t_max` that is NaN
    /// or negative, and rays with a NaN, with an infinite origin or direction, or with a direction
    /// whose components are all zero or denormal (less than 2^-126).
    pub n_invalid: u64,
    /// None if the device has no timestamps.
    pub times: Option<Times>,
    pub load_ms: f64,
    pub build_ms: f64,
    /// Total time of reading, copying, casting (all repetitions) and writing.
    pub cast_ms: f64,
}

/// Times of casting all rays once, without reading, copying and writing. A GPU measures its times with its own
/// timestamps.
#[derive(Serialize)]
pub struct Times {
    n_times: usize,
    min_ms: f64,
    median_ms: f64,
    max_ms: f64,
    /// Million rays per second at the median time; none if that time is 0.
    mrays_per_s: Option<f64>,
}

impl Times {
    /// Returns the times' minimum, median and maximum. `ms` has one entry per repetition; none if it is empty.
    pub fn of(mut ms: Vec<f64>, n_rays: u64) -> Option<Self> {
        ms.sort_by(f64::total_cmp);
        let (min_ms, median_ms, max_ms) = (*ms.first()?, ms[ms.len() / 2], *ms.last()?);
        let mrays_per_s = (median_ms > 0.0).then(|| n_rays as f64 / median_ms / 1e3);
        Some(Self { n_times: ms.len(), min_ms, median_ms, max_ms, mrays_per_s })
    }

    fn text(&self) -> String {
        let [min, median, max] = [self.min_ms, self.median_ms, self.max_ms].map(|ms| decimal(Some(ms), 3));
        let rate = decimal(self.mrays_per_s, 2);
        match self.n_times {
            1 => format!("{median} ms, {rate} Mrays/s"),
            n => format!("{median} ms in the median of {n} times, {min} to {max}, {rate} Mrays/s"),
        }
    }
}

impl CastReport {
    /// The report as text that ends with a line break.
    pub fn text(&self) -> String {
        let Self { scene, choices, triangles, load_ms, build_ms, device, noun, n_rays, n_hits, n_invalid, .. } = self;
        let times = self.times.as_ref().map_or_else(|| "no timestamps".to_owned(), Times::text);
        let invalid = if *n_invalid > 0 { format!(", {n_invalid} invalid") } else { String::new() };
        format!(
            "{scene}: {triangles} triangles, loaded in {load_ms:.0} ms, {} {}\n\
             {choices}\n\
             {device}: {times}\n\
             {n_rays} {noun}, {n_hits} hits{invalid}\n\
             wrote {}\n",
            self.accel.kind().name(),
            built_in(*build_ms, self.device_build.as_ref()),
            self.hits.display()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_ordered() {
        let times = Times::of(vec![3.0, 1.0, 2.0], 4000).unwrap();
        assert_eq!((times.min_ms, times.median_ms, times.max_ms), (1.0, 2.0, 3.0));
        assert_eq!(times.text(), "2.000 ms in the median of 3 times, 1.000 to 3.000, 2.00 Mrays/s");
        assert_eq!(Times::of(vec![0.5], 1000).unwrap().text(), "0.500 ms, 2.00 Mrays/s");
        assert_eq!(Times::of(vec![0.0], 0).unwrap().mrays_per_s, None);
        assert!(Times::of(Vec::new(), 9).is_none());
    }
}
