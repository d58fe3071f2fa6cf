//! Bins that collect rays of one class of directions until they fill a packet. A class holds the rays whose directions
//! have the same signs and the same longest axis. Rays of the same signs visit the two children of any node in the same
//! order, which packets need. A packet tests a triangle once for each longest axis among its rays, so that rays of one
//! axis need one test.

use arrayvec::ArrayVec;

use super::{lanes::LANES, soa::RaysSoa};
use crate::reference::{search_ray::SearchRay, traversal_ray::signs_of, triangle::longest_axis};

/// Number of classes: eight combinations of signs, and three axes.
const N_CLASSES: usize = 8 * 3;

/// Rays of one class, at most one packet. Each ray has a key, by which the caller identifies its hit.
pub struct Bin<Key> {
    pub rays: RaysSoa,
    pub keys: ArrayVec<Key, LANES>,
}

impl<Key> Default for Bin<Key> {
    fn default() -> Self {
        Self { rays: RaysSoa::default(), keys: ArrayVec::new() }
    }
}

/// One bin for each class.
pub struct DirectionBins<Key> {
    bins: [Bin<Key>; N_CLASSES],
}

impl<Key> Default for DirectionBins<Key> {
    fn default() -> Self {
        Self { bins: std::array::from_fn(|_| Bin::default()) }
    }
}

impl<Key> DirectionBins<Key> {
    /// Adds a ray to the bin of its class. Returns the bin if it is now full; the caller has to empty it.
    #[inline(always)]
    pub fn push(&mut self, key: Key, search_ray: &SearchRay) -> Option<&mut Bin<Key>> {
        let direction = search_ray.direction;
        let class = 8 * longest_axis(direction.to_array()) + signs_of(direction) as usize;
        let bin = &mut self.bins[class];
        bin.rays.set(bin.keys.len(), search_ray);
        bin.keys.push(key);
        bin.keys.is_full().then_some(bin)
    }

    /// Returns the bins that hold rays.
    pub fn non_empty(&mut self) -> impl Iterator<Item = &mut Bin<Key>> {
        self.bins.iter_mut().filter(|bin| !bin.keys.is_empty())
    }
}
