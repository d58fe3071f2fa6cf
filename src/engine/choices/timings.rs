//! The candidate methods, their measured times, and the choice among them. A method is a traversal or a kind of
//! primary visibility.

use std::{
    collections::BTreeMap,
    fmt::{self, Display},
    str::FromStr,
};

use serde::{Deserialize, Serialize};

use super::{Cache, Chosen, Key, Reason};
use crate::{accel::kdtree::Traversal, frame::Primary};

/// Least number of triangles of a scene in which methods are measured. In smaller scenes every traversal is fast
/// enough, because a frame spends more time elsewhere.
const FEWEST_TRIANGLES: usize = 1000;
/// Least number of rays of a run in which a measurement pays off, in a scene of no triangles. Each triangle adds
/// `RAYS_PER_MEASURED_TRIANGLE`. A measurement takes some 0.1 s, and 0.3 us more for each triangle. It saves a tenth
/// of the 1 to 10 ns that a ray takes, in this run and in a few later runs that find the result in the cache.
const RAYS_PER_MEASUREMENT: u64 = 1 << 28;
/// See `RAYS_PER_MEASUREMENT`.
const RAYS_PER_MEASURED_TRIANGLE: u64 = 500;
/// Number of rays per triangle from which ropes pay off. Making them takes the CPU some 200 ns per triangle in each
/// run. Where they are faster, they save about 0.2 ns per ray.
const RAYS_PER_ROPED_TRIANGLE: u64 = 1000;
/// A method replaces the rule's method only if it saves more than this share of that method's time. Smaller savings
/// are noise.
const LEAST_GAIN: f64 = 0.03;

/// Measured times on a device, by method: nanoseconds per ray or per pixel.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Timings {
    ns: BTreeMap<String, f64>,
}

impl<T: Display> FromIterator<(T, f64)> for Timings {
    fn from_iter<I: IntoIterator<Item = (T, f64)>>(times: I) -> Self {
        Self { ns: times.into_iter().map(|(method, ns)| (method.to_string(), ns)).collect() }
    }
}

impl Timings {
    /// Returns the time of a method.
    pub fn of(&self, method: impl Display) -> Option<f64> {
        self.ns.get(&method.to_string()).copied()
    }

    /// Tells whether the contents are valid for methods of type `T`: names are known, and times are finite and above
    /// zero.
    pub fn is_sound<T: FromStr>(&self) -> bool {
        let is_sound = |(word, ns): (&String, &f64)| T::from_str(word).is_ok() && ns.is_finite() && *ns > 0.0;
        !self.ns.is_empty() && self.ns.iter().all(is_sound)
    }

    /// Returns the fastest of `methods` if it saves more than `LEAST_GAIN` of the time of `rule`, or else `rule`.
    fn quickest<T: Copy + Display>(&self, methods: &[T], rule: T) -> T {
        let times = methods.iter().filter_map(|&method| Some((method, self.of(method)?)));
        let best = times.min_by(|(_, a), (_, b)| a.total_cmp(b));
        match (best, self.of(rule)) {
            (Some((best, ns)), Some(of_rule)) if ns < (1.0 - LEAST_GAIN) * of_rule => best,
            _ => rule,
        }
    }
}

impl Display for Timings {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let times: Vec<_> = self.ns.iter().map(|(method, ns)| format!("{method} {ns:.3}")).collect();
        f.write_str(&times.join(", "))
    }
}

/// The candidate methods on a GPU, and whether measuring them pays off.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Candidates<T> {
    /// The methods to measure.
    pub methods: Vec<T>,
    /// Whether a measurement pays off in this run. If not, only the result of an earlier one can be used.
    pub may_measure: bool,
}

impl Candidates<Traversal> {
    /// Returns the candidate traversals for `n_rays` rays in a scene of `n_triangles` triangles, or none if the scene
    /// is too small for a measurement.
    pub fn of_traversals(n_triangles: usize, n_rays: u64) -> Option<Self> {
        let pay_for_ropes = n_rays >= RAYS_PER_ROPED_TRIANGLE.saturating_mul(n_triangles as u64);
        let ropes = pay_for_ropes.then_some(Traversal::Ropes);
        Self::new([Traversal::Mask, Traversal::Stack].into_iter().chain(ropes).collect(), n_triangles, n_rays)
    }
}

impl Candidates<Primary> {
    /// Returns the kinds of primary visibility whose hits are the same, or none if the scene is too small for a
    /// measurement. `n_rays` and `n_triangles` decide whether a measurement pays off.
    pub fn of_primaries(n_triangles: usize, n_rays: u64) -> Option<Self> {
        Self::new(vec![Primary::SoftwareRaster, Primary::Trace], n_triangles, n_rays)
    }
}

impl<T: Copy + Display + FromStr> Candidates<T> {
    fn new(methods: Vec<T>, n_triangles: usize, n_rays: u64) -> Option<Self> {
        let for_triangles = RAYS_PER_MEASURED_TRIANGLE.saturating_mul(n_triangles as u64);
        let may_measure = n_rays >= RAYS_PER_MEASUREMENT.saturating_add(for_triangles);
        (n_triangles >= FEWEST_TRIANGLES).then_some(Self { methods, may_measure })
    }

    /// Chooses the fastest method by the times in the cache. If the cache lacks the time of a method and a
    /// measurement pays off, `measure` is called, the choice is made by its times alone, and they are stored in the
    /// cache. If neither gives valid times, the choice is `rule`. `measure` returns the time of each method, or none
    /// where there is no measurement, as on a device without timestamps.
    ///
    /// # Errors
    /// Fails as `measure` does.
    pub fn choose<E>(
        &self,
        cache: &Cache,
        key: &Key,
        rule: T,
        measure: impl FnOnce(&[T]) -> Result<Option<Timings>, E>,
    ) -> Result<(Chosen<T>, Option<Timings>), E> {
        let by = |timings: Timings, by| (Chosen { value: timings.quickest(&self.methods, rule), by }, Some(timings));
        let is_complete = |timings: &Timings| self.methods.iter().all(|&method| timings.of(method).is_some());
        let known = cache.get(key).filter(Timings::is_sound::<T>);
        if let Some(timings) = known.filter(|timings| !self.may_measure || is_complete(timings)) {
            return Ok(by(timings, Reason::Cached));
        }
        let measured = if self.may_measure { measure(&self.methods)? } else { None };
        match measured.filter(Timings::is_sound::<T>) {
            Some(timings) => {
                cache.put(key, &timings);
                Ok(by(timings, Reason::Measured))
            }
            None => Ok((Chosen { value: rule, by: Reason::Rule }, None)),
        }
    }
}
