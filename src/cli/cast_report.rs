//! What rays hit, and how long it took: lines for the reader, the same as JSON.

use std::path::PathBuf;

use kdray::{
    accel::{Statistics, grid::DeviceBuild},
    engine::choices::Choices,
};
use serde::Serialize;

use super::{report::built_in, table::decimal};

/// What was cast, on what, and how long it took.
#[derive(Serialize)]
pub struct CastReport {
    pub scene: String,
    pub rays: PathBuf,
    pub hits: PathBuf,
    pub query: &'static str,
    /// None for grids.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub traversal: Option<String>,
    /// What the user left open, and why it is so.
    pub choices: Choices,
    pub device: String,
    pub triangles: usize,
    /// As `tree` or `grid`.
    #[serde(flatten)]
    pub accel: Statistics,
    /// Times of the grid's build; none where no device has built one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub grid_build: Option<DeviceBuild>,
    pub n_rays: u64,
    pub n_hits: u64,
    /// Rays that can only miss: with a NaN, an infinite origin or direction, or a direction of zero or so short that
    /// all its components are denormal (less than 2^-126).
    pub n_invalid: u64,
    /// None where the device has no timestamps.
    pub times: Option<Times>,
    pub load_ms: f64,
    pub build_ms: f64,
    /// All of it: reading, copying, casting as often as it was repeated, writing.
    pub cast_ms: f64,
}

/// Casting alone, all rays each time: by the GPU's clock, on the CPU by its own.
#[derive(Serialize)]
pub struct Times {
    n_times: usize,
    min_ms: f64,
    median_ms: f64,
    max_ms: f64,
    /// Million rays a second in the median time; none without rays.
    mrays_per_s: Option<f64>,
}

impl Times {
    /// `ms`: one entry a repetition; none for none.
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
        let Self { scene, choices, triangles, load_ms, build_ms, device, n_rays, n_hits, n_invalid, .. } = self;
        let times = self.times.as_ref().map_or_else(|| "no timestamps".to_owned(), Times::text);
        let invalid = if *n_invalid > 0 { format!(", {n_invalid} invalid") } else { String::new() };
        format!(
            "{scene}: {triangles} triangles, loaded in {load_ms:.0} ms, {} {}\n\
             {choices}\n\
             {device}: {times}\n\
             {n_rays} rays, {n_hits} hits{invalid}\n\
             wrote {}\n",
            self.accel.kind().name(),
            built_in(*build_ms, self.grid_build.as_ref()),
            self.hits.display()
        )
    }

    pub fn json(&self) -> Vec<u8> {
        let mut json = serde_json::to_vec_pretty(self).expect("plain structs of numbers and words");
        json.push(b'\n');
        json
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
