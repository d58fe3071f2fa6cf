//! Pending subtrees by the paper's mask, and by tests of the siblings' boxes. Twin of `kdtree/pending_mask_boxes.glsl`.

use super::{
    counting::table::ReadCounter,
    inputs::KernelInputs,
    kdtree::{Cell, Pending},
    traversal_ray::{TraversalRay, min},
};

/// Pending subtrees that are found on the way back up: the mask of the siblings that have been visited.
pub struct PendingMaskBoxes {
    /// Bit i is set if the sibling of the node i levels above the cell's node has been visited.
    siblings_done: u64,
}

impl Pending for PendingMaskBoxes {
    fn new() -> Self {
        Self { siblings_done: 0 }
    }

    #[inline(always)]
    fn clear(&mut self) {
        self.siblings_done = 0;
    }

    #[inline(always)]
    fn go_down(&mut self) {
        self.siblings_done <<= 1;
    }

    #[inline(always)]
    fn push(&mut self, _: u32, _: &Cell) {}

    #[inline(always)]
    fn pop(
        &mut self,
        inputs: &KernelInputs<impl ReadCounter>,
        ray: &TraversalRay,
        t_best: f32,
        cell: &mut Cell,
    ) -> bool {
        // Every cell that has not been visited begins where the leaf ends, or later.
        if t_best < cell.t_exit {
            return false;
        }
        while cell.node_ix != 0 {
            if self.siblings_done & 1 == 0 {
                let [t_enter, t_exit] = ray.interval_in(inputs, cell.node_ix ^ 1);
                if t_enter <= min(t_exit, t_best) {
                    self.siblings_done |= 1;
                    *cell = Cell { node_ix: cell.node_ix ^ 1, t_enter, t_exit };
                    return true;
                }
            }
            self.siblings_done >>= 1;
            cell.node_ix = inputs.kd_parents[cell.node_ix as usize >> 1];
        }
        false
    }
}
