//! Packet traversal: sixteen rays go through the kd-tree together (Wald et al., "Interactive rendering with coherent
//! ray tracing", 2001). A node is read and a plane is loaded once for all rays in the cell. Each ray is tested in the
//! same leaves as a ray that is traced alone, so it finds the same hit, bit for bit.

use fearless_simd::{Level, Simd, dispatch, f32x16, prelude::*};

use super::{
    lanes::LANES,
    packet::{Packet, PacketIntervals},
    soa::{HitsSoa, RaysSoa},
};
use crate::{
    accel::kdtree::EMPTY_LEAF,
    layout::{Hit, KD_MAX_DEPTH, KD_PAIR_SHIFT, KdNode, NO_TRIANGLE},
    reference::{
        counting::table::ReadCounter,
        inputs::KernelInputs,
        kdtree::{Cell, Pending, axis_of, is_leaf, search, search_cell},
        pending_stack::PendingStack,
        slab::slab_of,
        traversal_ray::{TraversalRay, near_scene, t_from_origin},
    },
};

/// Traverses packets on one thread, and owns the working memory for that.
pub struct PacketTraverser {
    simd_level: Level,
    /// The stack for rays that are traced outside a packet.
    single: PendingStack,
    /// The stack of pending subtrees. Its first `size` entries are in use.
    entries: [Entry; KD_MAX_DEPTH as usize],
    size: usize,
}

/// A pending subtree: the index of its root, and the rays' t intervals in its cell.
#[derive(Clone, Copy, Default)]
#[repr(C, align(64))]
struct Entry {
    enter: [f32; LANES],
    exit: [f32; LANES],
    node_ix: u32,
}

/// Rays that were moved near the scene ([`near_scene`]), and the t by which each was moved.
struct Moved {
    rays: RaysSoa,
    t_start: [f32; LANES],
}

impl Moved {
    /// Moves the first `n_rays` rays.
    #[cold]
    fn new(inputs: &KernelInputs<impl ReadCounter>, search_rays: &RaysSoa, n_rays: usize) -> Self {
        let mut moved = Self { rays: *search_rays, t_start: [0.0; LANES] };
        for lane in 0..n_rays {
            let (near, t_start) = near_scene(inputs, &search_rays.get(lane));
            moved.rays.set(lane, &near);
            moved.t_start[lane] = t_start;
        }
        moved
    }

    /// Returns the hits of the moved rays with t counted from the rays' own origins. A miss has t = t_max.
    #[cold]
    fn hits_from_origins(&self, search_rays: &RaysSoa, mut hits: HitsSoa) -> HitsSoa {
        for lane in 0..LANES {
            let (is_miss, t_max) = (hits.triangle_ix[lane] == NO_TRIANGLE, search_rays.t_max[lane]);
            hits.t[lane] = if is_miss { t_max } else { t_from_origin(hits.t[lane], self.t_start[lane], t_max) };
        }
        hits
    }
}

/// Tells whether a ray that is the only one in a cell is traced faster alone than in its packet. This is true if the
/// machine's vectors have fewer than 16 lanes, so that an operation on a packet takes several instructions
/// (docs/experiments.md).
const fn goes_on_alone<S: Simd>() -> bool {
    size_of::<S::f32s>() < size_of::<f32x16<S>>()
}

impl PacketTraverser {
    /// Creates a traverser that uses the instructions of `simd_level`, which the machine must have.
    pub fn new(simd_level: Level) -> Self {
        Self { simd_level, single: Pending::new(), entries: [Entry::default(); KD_MAX_DEPTH as usize], size: 0 }
    }

    /// Descends to the first leaf that rays of `cell` enter, and sets `cell` to the rays' t intervals in that leaf.
    /// The interval of a ray that stays outside a node's slab becomes empty. If all are empty, returns an empty leaf.
    /// Rays with empty intervals do not influence the descent.
    #[inline(always)]
    fn descend<S: Simd>(
        &mut self,
        inputs: &KernelInputs<impl ReadCounter>,
        packet: &Packet<S>,
        node_ix: &mut u32,
        cell: &mut PacketIntervals<S>,
    ) -> KdNode {
        let mut node = inputs.kd_nodes[*node_ix as usize];
        loop {
            if let Some(slab) = slab_of(inputs, node, *node_ix) {
                *cell = cell.of(packet.lanes_in_slab(slab, cell));
                if cell.lanes() == 0 {
                    return EMPTY_LEAF;
                }
            }
            if is_leaf(node) {
                return node;
            }
            let axis = axis_of(node) as usize;
            let t_cross = f32::from_bits(node.split_or_first) * packet.inv_direction[axis] + packet.bias[axis];
            let first_ix = 2 * (node.axis_and_child >> KD_PAIR_SHIFT) + packet.first_is_above[axis];
            // A ray that is in neither child has a NaN as `t_cross`, or is not in the cell.
            let first = PacketIntervals { enter: cell.enter, exit: t_cross.min(cell.exit) };
            let second = PacketIntervals { enter: t_cross.max(cell.enter), exit: cell.exit };
            (*node_ix, *cell) = match (first.lanes() != 0, second.lanes() != 0) {
                (_, false) => (first_ix, first),
                (false, true) => (first_ix ^ 1, second),
                (true, true) => {
                    let (enter, exit) = (second.enter.to_array(), second.exit.to_array());
                    self.entries[self.size] = Entry { enter, exit, node_ix: first_ix ^ 1 };
                    self.size += 1;
                    (first_ix, first)
                }
            };
            node = inputs.kd_nodes[*node_ix as usize];
        }
    }

    /// Returns the next pending subtree whose cell a ray enters no farther than its best hit, with the t intervals
    /// cut off at the best hits. Returns none if there is no such subtree.
    #[inline(always)]
    fn pop<S: Simd>(&mut self, t_best: f32x16<S>) -> Option<(u32, PacketIntervals<S>)> {
        while self.size > 0 {
            self.size -= 1;
            let entry = &self.entries[self.size];
            let enter = f32x16::load_array_ref(t_best.simd, &entry.enter);
            let exit = f32x16::load_array_ref(t_best.simd, &entry.exit);
            let cell = PacketIntervals { enter, exit: exit.min(t_best) };
            if cell.lanes() != 0 {
                return Some((entry.node_ix, cell));
            }
        }
        None
    }

    /// Visits all leaves that the rays enter, except leaves beyond the best hits. `whole` is the root's cell.
    #[inline(always)]
    fn search<S: Simd, const ANY_HIT: bool>(
        &mut self,
        inputs: &KernelInputs<impl ReadCounter>,
        packet: &mut Packet<S>,
        whole: PacketIntervals<S>,
    ) {
        let (mut node_ix, mut cell) = (0, whole);
        self.size = 0;
        loop {
            let lanes = cell.lanes();
            if lanes.is_power_of_two() && goes_on_alone::<S>() {
                let lane = lanes.trailing_zeros() as usize;
                let (t_enter, t_exit) = (cell.enter.as_array()[lane], cell.exit.as_array()[lane]);
                let (ray, alone) = (packet.ray(lane), Cell { node_ix, t_enter, t_exit });
                let mut best = packet.hit(lane);
                search_cell::<_, ANY_HIT>(inputs, &ray, &mut self.single, alone, &mut best);
                packet.set_hit::<ANY_HIT>(lane, &best);
            } else {
                let leaf = self.descend(inputs, packet, &mut node_ix, &mut cell);
                packet.intersect_leaf::<ANY_HIT>(inputs, leaf, &cell);
            }
            match self.pop(packet.t_best) {
                Some(next) => (node_ix, cell) = next,
                None => return,
            }
        }
    }

    /// Traces the first `n_rays` rays. If any of them starts far from the scene, which is rare, the rays are first
    /// moved near to it.
    #[inline(always)]
    fn traverse_at<S: Simd, const ANY_HIT: bool>(
        &mut self,
        simd: S,
        inputs: &KernelInputs<impl ReadCounter>,
        search_rays: &RaysSoa,
        n_rays: usize,
    ) -> HitsSoa {
        let (mut packet, mut whole) = Packet::new(simd, inputs, search_rays, n_rays);
        let moved = if packet.is_within_reach(inputs) { None } else { Some(Moved::new(inputs, search_rays, n_rays)) };
        if let Some(moved) = &moved {
            (packet, whole) = Packet::new(simd, inputs, &moved.rays, n_rays);
        }
        if whole.lanes() != 0 {
            self.search::<_, ANY_HIT>(inputs, &mut packet, whole);
        }
        match moved {
            None => packet.hits(),
            Some(moved) => moved.hits_from_origins(search_rays, packet.hits()),
        }
    }

    /// Returns the hits of the first `n_rays` rays, whose directions must have the same signs. All further lanes of the
    /// result are meaningless.
    pub fn traverse<const ANY_HIT: bool>(
        &mut self,
        inputs: &KernelInputs<impl ReadCounter>,
        search_rays: &RaysSoa,
        n_rays: usize,
    ) -> HitsSoa {
        dispatch!(self.simd_level, simd => self.traverse_at::<_, ANY_HIT>(simd, inputs, search_rays, n_rays))
    }

    /// Traces one ray, without a packet. `best` becomes its hit.
    pub fn traverse_alone<const ANY_HIT: bool>(
        &mut self,
        inputs: &KernelInputs<impl ReadCounter>,
        ray: &TraversalRay,
        best: &mut Hit,
    ) {
        dispatch!(self.simd_level, _simd => search::<_, ANY_HIT>(inputs, ray, &mut self.single, best));
    }
}
