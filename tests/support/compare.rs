//! Comparers. Each says where two results first differ, and how often.

use std::fmt::Debug;

use glam::Vec3;
use kdray::layout::{Hit, PathRay};

/// Succeeds if all pairs agree, but for at most `n_outliers`.
fn all_agree<T: Debug>(
    expected: &[T],
    found: &[T],
    n_outliers: usize,
    agree: impl Fn(&T, &T) -> bool,
) -> Result<(), String> {
    if expected.len() != found.len() {
        return Err(format!("{} elements, not {}", found.len(), expected.len()));
    }
    let differing: Vec<_> = (0..expected.len()).filter(|&i| !agree(&expected[i], &found[i])).collect();
    match differing.first() {
        Some(&i) if differing.len() > n_outliers => Err(format!(
            "{} of {} differ, first [{i}]: {:?}, not {:?}",
            differing.len(),
            expected.len(),
            found[i],
            expected[i]
        )),
        _ => Ok(()),
    }
}

pub fn exact<T: PartialEq + Debug>(expected: &[T], found: &[T]) -> Result<(), String> {
    all_agree(expected, found, 0, |a, b| a == b)
}

/// Succeeds if all elements are equal, but for at most `n_outliers`.
pub fn exact_but_for<T: PartialEq + Debug>(n_outliers: usize, expected: &[T], found: &[T]) -> Result<(), String> {
    all_agree(expected, found, n_outliers, |a, b| a == b)
}

/// Tells whether numbers have equal bits, or are finite and differ by at most `relative` of the larger magnitude. A
/// magnitude below 1 counts as 1.
pub fn near(a: f32, b: f32, relative: f32) -> bool {
    let magnitude = a.abs().max(b.abs()).max(1.0);
    a.to_bits() == b.to_bits() || (magnitude.is_finite() && (a - b).abs() <= relative * magnitude)
}

fn near_vec(a: Vec3, b: Vec3, relative: f32) -> bool {
    near(a.x, b.x, relative) && near(a.y, b.y, relative) && near(a.z, b.z, relative)
}

/// Succeeds if all four components of each pixel are near.
pub fn pixels(relative: f32, n_outliers: usize, expected: &[[f32; 4]], found: &[[f32; 4]]) -> Result<(), String> {
    all_agree(expected, found, n_outliers, |a, b| (0..4).all(|i| near(a[i], b[i], relative)))
}

/// Succeeds if both hits are of the same triangle at the same place, or of different triangles at the same t, where
/// edges meet or surfaces coincide. Divisions may be 2.5 units in the last place off (Vulkan's precision of OpFDiv),
/// so t and the weights may be off too, and far more where a needle is seen edge-on: hence the outliers.
pub fn hits(n_outliers: usize, expected: &[Hit], found: &[Hit]) -> Result<(), String> {
    all_agree(expected, found, n_outliers, |a, b| {
        let same = a.triangle_ix == b.triangle_ix && near(a.u, b.u, 1e-3) && near(a.v, b.v, 1e-3);
        let both = (a.triangle_ix == u32::MAX) == (b.triangle_ix == u32::MAX);
        near(a.t, b.t, 1e-5) && (same || (both && a.triangle_ix != b.triangle_ix))
    })
}

/// Succeeds if all hits are equal, or where some may not be, as [`hits`] does.
pub fn exact_or_hits(n_outliers: usize, expected: &[Hit], found: &[Hit]) -> Result<(), String> {
    if n_outliers == 0 { exact(expected, found) } else { hits(n_outliers, expected, found) }
}

/// Describes the first ray whose two hits differ in any bit, and says how many rays differ. Returns none if all hits
/// are equal.
pub fn first_difference(rays: &[PathRay], expected: &[Hit], found: &[Hit]) -> Option<String> {
    assert_eq!([expected.len(), found.len()], [rays.len(); 2]);
    let bits = |hit: &Hit| (hit.t.to_bits(), hit.triangle_ix, hit.u.to_bits(), hit.v.to_bits());
    let differ = |i: &usize| bits(&expected[*i]) != bits(&found[*i]);
    let n = (0..rays.len()).filter(differ).count();
    let i = (0..rays.len()).find(differ)?;
    Some(format!("{n} rays; ray {i}: {:?}: {:?}, not {:?}", rays[i], found[i], expected[i]))
}

/// Succeeds if the integers of each ray are equal and the floats near.
pub fn rays(relative: f32, n_outliers: usize, expected: &[PathRay], found: &[PathRay]) -> Result<(), String> {
    all_agree(expected, found, n_outliers, |a, b| {
        a.pixel_ix == b.pixel_ix
            && a.source_triangle == b.source_triangle
            && near_vec(a.origin, b.origin, relative)
            && near_vec(a.direction, b.direction, relative)
            && near_vec(a.throughput, b.throughput, relative)
            && near(a.t_max, b.t_max, relative)
    })
}

/// Succeeds if every channel is within `most_off`.
pub fn bytes(most_off: u8, expected: &[[u8; 4]], found: &[[u8; 4]]) -> Result<(), String> {
    all_agree(expected, found, 0, |a, b| (0..4).all(|i| a[i].abs_diff(b[i]) <= most_off))
}
