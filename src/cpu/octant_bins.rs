//! Bins that collect rays of one octant until they fill a packet. An octant holds the rays whose directions have the
//! same signs. They visit the two children of any node in the same order.

use arrayvec::ArrayVec;

use super::{lanes::LANES, soa::RaysSoa};
use crate::reference::{search_ray::SearchRay, traversal_ray::signs_of};

/// Rays of one octant, at most one packet. Each ray has a key, by which the caller identifies its hit.
pub struct Bin<Key> {
    pub rays: RaysSoa,
    pub keys: ArrayVec<Key, LANES>,
}

impl<Key> Default for Bin<Key> {
    fn default() -> Self {
        Self { rays: RaysSoa::default(), keys: ArrayVec::new() }
    }
}

/// One bin for each octant.
pub struct OctantBins<Key> {
    octants: [Bin<Key>; 8],
}

impl<Key> Default for OctantBins<Key> {
    fn default() -> Self {
        Self { octants: Default::default() }
    }
}

impl<Key> OctantBins<Key> {
    /// Adds a ray to the bin of its octant. Returns the bin if it is now full; the caller has to empty it.
    #[inline(always)]
    pub fn push(&mut self, key: Key, search_ray: &SearchRay) -> Option<&mut Bin<Key>> {
        let octant = &mut self.octants[signs_of(search_ray.direction) as usize & 7];
        octant.rays.set(octant.keys.len(), search_ray);
        octant.keys.push(key);
        octant.keys.is_full().then_some(octant)
    }

    /// Returns the bins that hold rays.
    pub fn non_empty(&mut self) -> impl Iterator<Item = &mut Bin<Key>> {
        self.octants.iter_mut().filter(|octant| !octant.keys.is_empty())
    }
}
