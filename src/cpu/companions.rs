//! Which rays go through the tree together: those whose directions have the same signs, since they come to the two children
//! of any node in the same order.

use arrayvec::ArrayVec;

use super::{columns::ProbeColumns, kdtree::signs_of, packet::LANES, probe::Probe};

/// Rays of one octant that wait until they are as many as a packet has, and what their hits are known by.
pub struct Waiting<Key> {
    pub probes: ProbeColumns,
    pub keys: ArrayVec<Key, LANES>,
}

impl<Key> Default for Waiting<Key> {
    fn default() -> Self {
        Self { probes: ProbeColumns::default(), keys: ArrayVec::new() }
    }
}

/// All rays that wait, by octant.
pub struct Companions<Key> {
    octants: [Waiting<Key>; 8],
}

impl<Key> Default for Companions<Key> {
    fn default() -> Self {
        Self { octants: Default::default() }
    }
}

impl<Key> Companions<Key> {
    /// The ray waits, too. Returns those of its octant if they are a packet now, which is to be taken away.
    #[inline(always)]
    pub fn join(&mut self, key: Key, probe: &Probe) -> Option<&mut Waiting<Key>> {
        let octant = &mut self.octants[signs_of(probe.direction) as usize & 7];
        octant.probes.set(octant.keys.len(), probe);
        octant.keys.push(key);
        octant.keys.is_full().then_some(octant)
    }

    /// Those that still wait.
    pub fn rest(&mut self) -> impl Iterator<Item = &mut Waiting<Key>> {
        self.octants.iter_mut().filter(|octant| !octant.keys.is_empty())
    }
}
