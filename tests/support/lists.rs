//! Lists of all hits of rays, and a comparer for them.

use kdray::{cast::AllHits, layout::Hit};

use super::compare;

/// The number of hits of each ray.
pub fn counts_of(all: &AllHits) -> Vec<u32> {
    all.ray_splits.windows(2).map(|ends| (ends[1] - ends[0]) as u32).collect()
}

/// The hits of a ray.
pub fn list(all: &AllHits, ray_ix: usize) -> &[Hit] {
    &all.hits[all.ray_splits[ray_ix] as usize..all.ray_splits[ray_ix + 1] as usize]
}

/// Succeeds if no more than `n_outliers` rays have other lists. On GPUs hits are compared but for rounding.
pub fn agree(is_software: bool, n_outliers: usize, expected: &AllHits, found: &AllHits) -> Result<(), String> {
    assert_eq!(expected.ray_splits.len(), found.ray_splits.len());
    let differs = |ray_ix: &usize| match (list(expected, *ray_ix), list(found, *ray_ix)) {
        (expected, found) if is_software => expected != found,
        (expected, found) => compare::hits(0, expected, found).is_err(),
    };
    let differing: Vec<_> = (0..expected.ray_splits.len() - 1).filter(differs).collect();
    match differing.first() {
        Some(&first) if differing.len() > n_outliers => {
            Err(format!("{} rays, as {first}: {:?} {:?}", differing.len(), list(expected, first), list(found, first)))
        }
        _ => Ok(()),
    }
}
