//! Eight rays through the tree together (Wald et al., "Interactive rendering with coherent ray tracing", 2001): a node is
//! read and a plane is tried once for all that are there. A ray is tested where it would be alone, and finds the same, bit
//! for bit.

use wide::f32x8;

use super::{
    bindings::Bindings,
    kdtree::{Cell, Pending, axis_of, search_cell},
    packet::{Interval, LANES, Packet},
    pending_stack::PendingStack,
    table::Reads,
    traverser::Probe,
};
use crate::layout::{Hit, KD_CHILD_SHIFT, KD_LEAF, KD_MAX_DEPTH, KdNode};

/// The working memory of a thread.
pub struct PacketTraverser {
    pub single: PendingStack,
    entries: [(u32, Interval); KD_MAX_DEPTH as usize],
    size: usize,
}

impl Default for PacketTraverser {
    fn default() -> Self {
        Self { single: Pending::new(), entries: [(0, Interval::empty()); KD_MAX_DEPTH as usize], size: 0 }
    }
}

impl PacketTraverser {
    /// Down to the leaf where the rays of `cell` enter. One that is not in it goes nowhere.
    #[inline(always)]
    fn descend(
        &mut self,
        bindings: &Bindings<impl Reads>,
        packet: &Packet,
        first_is_above: [u32; 4],
        node_ix: &mut u32,
        cell: &mut Interval,
    ) -> KdNode {
        let mut node = bindings.kd_nodes[*node_ix as usize];
        while axis_of(node) != KD_LEAF {
            let axis = axis_of(node) as usize;
            let t_cross =
                f32x8::splat(f32::from_bits(node.split_or_first)) * packet.inv_direction[axis] + packet.bias[axis];
            let first_ix = (node.axis_and_child >> KD_CHILD_SHIFT) + first_is_above[axis];
            // Those in neither have met a NaN, or are not in the cell.
            let first = Interval { enter: cell.enter, exit: t_cross.fast_min(cell.exit) };
            let second = Interval { enter: t_cross.fast_max(cell.enter), exit: cell.exit };
            (*node_ix, *cell) = match (first.lanes() != 0, second.lanes() != 0) {
                (_, false) => (first_ix, first),
                (false, true) => (first_ix ^ 1, second),
                (true, true) => {
                    self.entries[self.size] = (first_ix ^ 1, second);
                    self.size += 1;
                    (first_ix, first)
                }
            };
            node = bindings.kd_nodes[*node_ix as usize];
        }
        node
    }

    /// The next pending cell in which a ray may hit something nearer than it has, or none.
    #[inline(always)]
    fn pop(&mut self, t_best: f32x8) -> Option<(u32, Interval)> {
        while self.size > 0 {
            self.size -= 1;
            let (node_ix, cell) = self.entries[self.size];
            let cell = Interval { exit: cell.exit.fast_min(t_best), ..cell };
            if cell.lanes() != 0 {
                return Some((node_ix, cell));
            }
        }
        None
    }

    /// All leaves that the rays meet in `whole`, which go the same way on all axes. One that is left alone in a cell goes
    /// on alone there.
    #[inline(always)]
    fn search<const ANY_HIT: bool>(
        &mut self,
        bindings: &Bindings<impl Reads>,
        packet: &mut Packet,
        first_is_above: [u32; 4],
        whole: Interval,
    ) {
        let (mut node_ix, mut cell) = (0, whole);
        self.size = 0;
        loop {
            let lanes = cell.lanes();
            if lanes.is_power_of_two() {
                let lane = lanes.trailing_zeros() as usize;
                let [t_enter, t_exit] = [cell.enter, cell.exit].map(|t| t.as_array()[lane]);
                let (ray, alone) = (packet.ray(lane), Cell { node_ix, depth: 0, t_enter, t_exit });
                search_cell::<_, ANY_HIT>(bindings, &ray, &mut self.single, alone, &mut packet.best[lane]);
                packet.note_best::<ANY_HIT>();
            } else {
                let leaf = self.descend(bindings, packet, first_is_above, &mut node_ix, &mut cell);
                packet.intersect_leaf::<ANY_HIT>(bindings, leaf, &cell);
            }
            match self.pop(packet.t_best) {
                Some(next) => (node_ix, cell) = next,
                None => return,
            }
        }
    }

    /// The hits of up to `LANES` rays, at least one, that start within reach; void beyond them.
    pub fn traverse<const ANY_HIT: bool>(&mut self, bindings: &Bindings<impl Reads>, probes: &[Probe]) -> [Hit; LANES] {
        let (mut packet, whole) = Packet::new(bindings, probes);
        let mut remaining = whole.lanes();
        while remaining != 0 {
            let lane = remaining.trailing_zeros();
            let lanes = packet.like(lane) & remaining;
            remaining &= !lanes;
            let is_below = |axis: usize| packet.inv_direction[axis].as_array()[lane as usize] < 0.0;
            let first_is_above = [is_below(0), is_below(1), is_below(2), false].map(u32::from);
            self.search::<ANY_HIT>(bindings, &mut packet, first_is_above, whole.of(lanes));
        }
        packet.best
    }
}
