//! Which rays go through the tree together: neighbours that point the same way; of the others, such as do.

use glam::Vec3;

use super::probe::Probe;
use crate::layout::Hit;

/// Rays among which companions are looked for: of more, those that point the same way start too far apart.
const WINDOW: usize = 512;

/// Above all indices in a window.
const CLASS_SHIFT: u32 = 16;

/// Neighbours that point into more octants than this share too little of their way to go together.
const MOST_OCTANTS: u32 = 2;

/// Rays among which companions are looked for, what their hits are known by, and room for both: filled and emptied again and
/// again, without an allocation.
pub struct Window<Key> {
    keys: Vec<Key>,
    pub probes: Vec<Probe>,
    /// In the rays' order.
    pub hits: Vec<Hit>,
    /// Indices of the rays that do not go with their neighbours.
    pub others: Vec<u32>,
}

impl<Key> Default for Window<Key> {
    fn default() -> Self {
        let (keys, probes) = (Vec::with_capacity(WINDOW), Vec::with_capacity(WINDOW));
        let (hits, others) = (Vec::with_capacity(WINDOW), Vec::with_capacity(WINDOW));
        Self { keys, probes, hits, others }
    }
}

impl<Key> Window<Key> {
    /// With the next rays; false where there are none.
    #[inline(always)]
    pub fn fill(&mut self, rays: &mut impl Iterator<Item = (Key, Probe)>) -> bool {
        self.probes.clear();
        while self.probes.len() < WINDOW {
            let Some((key, probe)) = rays.next() else { break };
            self.keys.push(key);
            self.probes.push(probe);
        }
        !self.probes.is_empty()
    }

    /// Tells `found` all hits.
    #[inline(always)]
    pub fn tell(&mut self, mut found: impl FnMut(Key, Hit)) {
        self.keys.drain(..).zip(&self.hits).for_each(|(key, hit)| found(key, *hit));
    }
}

/// Whether neighbours are companions.
pub fn point_the_same_way(neighbours: &[Probe]) -> bool {
    let octant_of = |probe: &Probe| probe.direction.is_negative_bitmask();
    let octants = neighbours.iter().fold(0_u32, |octants, probe| octants | 1 << octant_of(probe));
    octants.count_ones() <= MOST_OCTANTS
}

/// Octant, and the order of the components by magnitude: 48 classes of equal solid angle, numbered below 64.
fn class_of(direction: Vec3) -> u32 {
    let Vec3 { x, y, z } = direction.abs();
    let order = u32::from(x > y) | u32::from(y > z) << 1 | u32::from(x > z) << 2;
    direction.is_negative_bitmask() << 3 | order
}

/// Puts some of a window's rays, by their indices, into an order in which neighbours are companions.
pub fn sort_by_direction(probes: &[Probe], ray_ixs: &mut [u32]) {
    // Class and index as one number: diffuse rays take a tenth less than by a sort with a cached key (benches/EXPERIMENTS.md).
    for ix in ray_ixs.iter_mut() {
        *ix |= class_of(probes[*ix as usize].direction) << CLASS_SHIFT;
    }
    ray_ixs.sort_unstable();
    ray_ixs.iter_mut().for_each(|ix| *ix &= (1 << CLASS_SHIFT) - 1);
}
