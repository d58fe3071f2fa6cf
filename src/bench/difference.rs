//! Comparison of the hits of two tracers on the same rays.

use serde::Serialize;

use super::rays::RaySetKind;
use crate::layout::{Hit, NO_TRIANGLE};

/// Relative difference of two distances to the same triangle that still counts as the same hit. It is large because
/// the ray may meet the triangle's plane at any angle.
const SAME_TRIANGLE: f32 = 1.0 / 1024.0;
/// Relative difference of the distances to two triangles that still counts as the same point. The triangles then
/// touch there or share the edge that the ray meets.
const TWO_TRIANGLES: f32 = 1.0 / 65536.0;

/// Numbers of hits in a set of rays that differ from the hits that the CPU finds with the same arithmetic.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Difference {
    /// Hits at another distance, misses in place of hits, and hits in place of misses.
    pub n_differing: u64,
    /// Hits of another triangle at the same distance, which occur where rays meet an edge.
    pub n_grazing: u64,
}

impl Difference {
    /// Compares `found` with `expected`, each with one hit per ray. For any-hit rays, only hit or miss counts.
    ///
    /// # Panics
    /// The numbers of hits differ.
    pub fn of(kind: RaySetKind, expected: &[Hit], found: &[Hit]) -> Self {
        assert_eq!(expected.len(), found.len(), "one hit a ray");
        let mut difference = Self::default();
        for (expected, found) in expected.iter().zip(found) {
            match compare(kind, expected, found) {
                Agreement::Same => {}
                Agreement::Grazing => difference.n_grazing += 1,
                Agreement::Different => difference.n_differing += 1,
            }
        }
        difference
    }

    /// Returns the maximum of both in each number.
    pub fn max(self, other: Self) -> Self {
        Self { n_differing: self.n_differing.max(other.n_differing), n_grazing: self.n_grazing.max(other.n_grazing) }
    }

    /// Returns whether rounding explains the difference. Near an outline, rounding decides whether a ray hits or
    /// misses; up to one in 100,000 rays may differ for that reason.
    pub fn is_rounding(&self, n_rays: usize) -> bool {
        self.n_differing <= n_rays as u64 / 100_000
    }
}

/// Largest relative difference, 2^-13, between the distances that two tracers of different arithmetic may find for
/// the same hit. Corners and products are rounded by 2^-24 each. If a ray meets a plane at a grazing angle, its hit
/// moves by a multiple of that.
pub const T_TOLERANCE: f32 = 1.0 / 8192.0;

/// Numbers of hits in a set of rays that differ from those of a tracer with another arithmetic. The triangle that was
/// hit is not compared, since many triangles share edges and corners.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct DriverDifference {
    /// Rays that hit with one tracer and miss with the other, or whose distance is NaN.
    pub n_hit_or_miss: u64,
    /// Distances whose relative difference exceeds [`T_TOLERANCE`].
    pub n_distance: u64,
}

impl DriverDifference {
    /// Compares `found` with `reference`, each with one hit per ray. For any-hit rays, only hit or miss counts.
    ///
    /// # Panics
    /// The numbers of hits differ.
    pub fn of(kind: RaySetKind, reference: &[Hit], found: &[Hit]) -> Self {
        assert_eq!(reference.len(), found.len(), "one hit a ray");
        let mut apart = Self::default();
        for (reference, found) in reference.iter().zip(found) {
            let is_near = (reference.t - found.t).abs() <= T_TOLERANCE * reference.t.abs();
            let is_neither = reference.t.is_nan() || found.t.is_nan();
            match (is_hit(reference), is_hit(found)) {
                (a, b) if a != b || is_neither => apart.n_hit_or_miss += 1,
                (true, true) if !is_near && !kind.is_any_hit() => apart.n_distance += 1,
                _ => {}
            }
        }
        apart
    }

    /// Returns the number of differences of both kinds.
    pub fn n_differing(&self) -> u64 {
        self.n_hit_or_miss + self.n_distance
    }

    /// Returns whether rounding explains the difference, which it does for up to one in 10,000 rays. This bound also
    /// covers tracers that do not know a ray's source triangle and may hit it again.
    pub fn is_rounding(&self, n_rays: usize) -> bool {
        self.n_differing() <= n_rays as u64 / 10_000
    }
}

/// Returns whether `hit` is neither a miss nor at a distance of NaN.
pub fn is_hit(hit: &Hit) -> bool {
    hit.triangle_ix != NO_TRIANGLE && !hit.t.is_nan()
}

enum Agreement {
    Same,
    Grazing,
    Different,
}

fn compare(kind: RaySetKind, expected: &Hit, found: &Hit) -> Agreement {
    let is_hit = |hit: &Hit| hit.triangle_ix != NO_TRIANGLE;
    let is_same_triangle = expected.triangle_ix == found.triangle_ix;
    let within = |share: f32| (expected.t - found.t).abs() <= share * expected.t.abs();
    match (is_hit(expected), is_hit(found)) {
        (false, false) => Agreement::Same,
        (true, true) if kind.is_any_hit() || is_same_triangle && within(SAME_TRIANGLE) => Agreement::Same,
        (true, true) if !is_same_triangle && within(TWO_TRIANGLES) => Agreement::Grazing,
        _ => Agreement::Different,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MISS: Hit = Hit { t: f32::INFINITY, triangle_ix: NO_TRIANGLE, u: 0.0, v: 0.0 };

    fn hit(t: f32, triangle_ix: u32) -> Hit {
        Hit { t, triangle_ix, u: 0.25, v: 0.5 }
    }

    /// Returns the numbers of differing and of grazing hits for one wrong hit among right ones.
    fn counts(kind: RaySetKind, expected: Hit, found: Hit) -> (u64, u64) {
        let right = [hit(1.0, 3), MISS];
        let difference = Difference::of(kind, &[right[0], expected, right[1]], &[right[0], found, right[1]]);
        (difference.n_differing, difference.n_grazing)
    }

    #[test]
    fn a_wrong_hit_is_counted() {
        for kind in [RaySetKind::Primary, RaySetKind::Mirror, RaySetKind::Diffuse] {
            assert_eq!(counts(kind, hit(2.0, 7), hit(2.0, 7)), (0, 0));
            assert_eq!(counts(kind, hit(2.0, 7), hit(2.0 + 1e-6, 7)), (0, 0));
            assert_eq!(counts(kind, hit(2.0, 7), hit(2.1, 7)), (1, 0));
            assert_eq!(counts(kind, hit(2.0, 7), hit(2.0 + 1e-6, 8)), (0, 1));
            assert_eq!(counts(kind, hit(2.0, 7), hit(2.001, 8)), (1, 0));
            assert_eq!(counts(kind, hit(2.0, 7), hit(f32::NAN, 7)), (1, 0));
        }
    }

    #[test]
    fn a_lost_or_invented_hit_is_counted() {
        for kind in RaySetKind::ALL {
            assert_eq!(counts(kind, hit(2.0, 7), MISS), (1, 0));
            assert_eq!(counts(kind, MISS, hit(2.0, 7)), (1, 0));
        }
    }

    #[test]
    fn any_hit_is_as_good_as_another() {
        assert_eq!(counts(RaySetKind::Shadow, hit(2.0, 7), hit(9.0, 1)), (0, 0));
    }

    /// Returns the numbers of hit-or-miss and of distance differences for one wrong hit among right ones.
    fn apart(kind: RaySetKind, reference: Hit, found: Hit) -> (u64, u64) {
        let right = [hit(1.0, 3), MISS];
        let apart = DriverDifference::of(kind, &[right[0], reference, right[1]], &[right[0], found, right[1]]);
        assert_eq!(apart.n_differing(), apart.n_hit_or_miss + apart.n_distance);
        (apart.n_hit_or_miss, apart.n_distance)
    }

    #[test]
    fn another_arithmetic_may_find_another_triangle_but_not_another_distance() {
        for kind in RaySetKind::ALL {
            let beyond = if kind.is_any_hit() { (0, 0) } else { (0, 1) };
            assert_eq!(apart(kind, hit(2.0, 7), hit(2.0002, 8)), (0, 0));
            assert_eq!(apart(kind, hit(2.0, 7), hit(2.0003, 7)), beyond);
            assert_eq!(apart(kind, hit(2.0, 7), hit(1.9997, 7)), beyond);
            assert_eq!(apart(kind, hit(2.0, 7), MISS), (1, 0));
            assert_eq!(apart(kind, MISS, hit(2.0, 7)), (1, 0));
            assert_eq!(apart(kind, hit(2.0, 7), hit(f32::NAN, 7)), (1, 0));
            assert_eq!(apart(kind, hit(f32::NAN, 7), hit(f32::NAN, 7)), (1, 0));
        }
        assert!(DriverDifference { n_hit_or_miss: 1, n_distance: 1 }.is_rounding(20_000));
        assert!(!DriverDifference { n_hit_or_miss: 1, n_distance: 1 }.is_rounding(19_999));
    }

    #[test]
    fn only_few_differences_are_rounding() {
        let difference = Difference { n_differing: 2, n_grazing: 1000 };
        assert!(difference.is_rounding(200_000) && !difference.is_rounding(199_999));
        assert!(Difference::default().is_rounding(0));
    }
}
