//! Pending subtrees found again from the root, along the mask's trail. Twin of `pending_restart.glsl`.

use super::{
    bindings::Bindings,
    kdtree::{Cell, Pending, TraversalRay, min},
    pending_mask::{PendingMask, bit_of},
    table::Reads,
};

/// The trail of the way down.
pub struct PendingRestart {
    pub(super) trail: PendingMask,
}

impl PendingRestart {
    /// From the root to the deepest pending node, which is pending no more.
    #[inline(always)]
    fn retrace(&mut self, bindings: &Bindings<impl Reads>, ray: &TraversalRay, cell: &mut Cell) {
        let depth = self.trail.deepest();
        self.trail.mask &= !bit_of(depth);
        *cell = Cell { node_ix: 0, depth, t_exit: ray.t_exit, ..*cell };
        for depth in 1..=depth {
            let node = bindings.kd_nodes[cell.node_ix as usize];
            let t_cross = ray.crossing(node);
            let is_pending = self.trail.mask & bit_of(depth) != 0;
            let in_second = t_cross[0] <= cell.t_exit;
            cell.node_ix = ray.first_child(node) ^ u32::from(in_second && !is_pending);
            if is_pending {
                cell.t_exit = min(cell.t_exit, t_cross[1]);
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
        cell.t_enter = cell.t_exit - ray.overlap;
        if self.trail.mask == 0 || t_best < cell.t_enter {
            return false;
        }
        self.retrace(bindings, ray, cell);
        true
    }
}
