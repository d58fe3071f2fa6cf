//! Pending subtrees by the paper's bit mask: one bit a level. Twin of `pending_mask.glsl`.

use super::{
    bindings::Bindings,
    kdtree::{Cell, Pending, TraversalRay, max, min},
    table::Reads,
};

/// Which siblings on the way to the root are still to be visited.
pub struct PendingMask {
    /// Bit d - 1: depth d. One word here for the kernel's two.
    pub(super) mask: u64,
    /// The deepest pending node and where the ray enters it.
    deepest_ix: u32,
    t_deepest: f32,
}

#[inline(always)]
pub(super) fn bit_of(depth: u32) -> u64 {
    1 << ((depth - 1) & 63)
}

impl PendingMask {
    /// Depth of the highest bit; the mask is not empty.
    #[inline(always)]
    pub(super) fn deepest(&self) -> u32 {
        64 - self.mask.leading_zeros()
    }

    /// Finds the pending node above `cell`, and with it where the cell ends; none: at the root cell's exit.
    #[inline(always)]
    fn climb(&mut self, bindings: &Bindings<impl Reads>, ray: &TraversalRay, cell: &mut Cell) {
        cell.t_exit = ray.t_exit;
        if self.mask == 0 {
            return;
        }
        let parent_of = |node_ix: u32| bindings.kd_parents[(node_ix >> 1) as usize];
        let mut path_ix = cell.node_ix;
        for _ in self.deepest()..cell.depth {
            path_ix = parent_of(path_ix);
        }
        self.deepest_ix = path_ix ^ 1;
        let t_cross = ray.crossing(bindings.kd_nodes[parent_of(path_ix) as usize]);
        self.t_deepest = t_cross[0];
        cell.t_exit = min(cell.t_exit, t_cross[1]);
    }
}

impl Pending for PendingMask {
    fn new() -> Self {
        Self { mask: 0, deepest_ix: 0, t_deepest: 0.0 }
    }

    #[inline(always)]
    fn clear(&mut self) {
        self.mask = 0;
    }

    #[inline(always)]
    fn push(&mut self, second_ix: u32, cell: &Cell, t_cross: [f32; 2]) {
        self.mask |= bit_of(cell.depth);
        self.deepest_ix = second_ix;
        self.t_deepest = t_cross[0];
    }

    #[inline(always)]
    fn pop(&mut self, bindings: &Bindings<impl Reads>, ray: &TraversalRay, t_best: f32, cell: &mut Cell) -> bool {
        while self.mask != 0 {
            if t_best < self.t_deepest - ray.overlap {
                return false;
            }
            cell.node_ix = self.deepest_ix;
            cell.depth = self.deepest();
            cell.t_enter = max(self.t_deepest, ray.t_enter);
            self.mask &= !bit_of(cell.depth);
            self.climb(bindings, ray, cell);
            cell.t_exit = min(cell.t_exit, t_best);
            if cell.t_enter <= t_best {
                return true;
            }
        }
        false
    }
}
