//! Pending subtrees found again from the root, along the mask's trail. Twin of `pending_restart.glsl`.

use super::{
    bindings::Bindings,
    kdtree::{Cell, Pending, TraversalRay, max, min},
    pending_mask::{PendingMask, bit_of},
    table::Reads,
};

/// The trail of the way down.
pub struct PendingRestart {
    pub(super) trail: PendingMask,
}

impl PendingRestart {
    /// From the root to the deepest pending node, which is pending no more, and with it where the next one is entered.
    #[inline(always)]
    fn retrace(&mut self, bindings: &Bindings<impl Reads>, ray: &TraversalRay, cell: &mut Cell) {
        let trail = &mut self.trail;
        let depth = trail.deepest();
        trail.mask &= !bit_of(depth);
        *cell = Cell { node_ix: 0, depth: 0, t_enter: ray.t_enter, t_exit: ray.t_exit };
        while cell.depth < depth {
            let node = bindings.kd_nodes[cell.node_ix as usize];
            let t_cross = ray.crossing(node);
            cell.node_ix = ray.first_child(node);
            cell.depth += 1;
            if trail.mask & bit_of(cell.depth) != 0 {
                cell.t_exit = min(cell.t_exit, t_cross[1]);
                trail.t_deepest = t_cross[0];
            } else if t_cross[0] <= cell.t_exit {
                cell.node_ix ^= 1;
                cell.t_enter = max(cell.t_enter, t_cross[0]);
            }
        }
    }
}

impl Pending for PendingRestart {
    fn new() -> Self {
        Self { trail: PendingMask::new() }
    }

    #[inline(always)]
    fn clear(&mut self) {
        self.trail.clear();
    }

    #[inline(always)]
    fn push(&mut self, second_ix: u32, cell: &Cell, t_cross: [f32; 2]) {
        self.trail.push(second_ix, cell, t_cross);
    }

    /// `t_exit` is not cut off at `t_best`: the trail depends on it.
    #[inline(always)]
    fn pop(&mut self, bindings: &Bindings<impl Reads>, ray: &TraversalRay, t_best: f32, cell: &mut Cell) -> bool {
        while self.trail.mask != 0 {
            if t_best < self.trail.t_deepest - ray.overlap {
                return false;
            }
            self.retrace(bindings, ray, cell);
            if cell.t_enter <= t_best {
                return true;
            }
        }
        false
    }
}
