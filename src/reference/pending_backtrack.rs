//! Pending subtrees without any memory, found by the ancestors' boxes. Twin of `kdtree/pending_backtrack.glsl`.

use super::{
    counting::table::ReadCounter,
    inputs::KernelInputs,
    kdtree::{Cell, Pending},
    traversal_ray::{TraversalRay, max, min},
};

/// Pending subtrees that are found on the way back up; nothing is stored.
pub struct PendingBacktrack;

impl Pending for PendingBacktrack {
    fn new() -> Self {
        Self
    }

    fn clear(&mut self) {}

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
            let parent_ix = inputs.kd_parents[cell.node_ix as usize >> 1];
            let parent = inputs.kd_nodes[parent_ix as usize];
            if cell.node_ix == ray.first_child(parent) {
                let t_enter = ray.crossing(parent);
                let [_, t_exit] = ray.interval_in(inputs, parent_ix);
                if t_enter <= min(t_exit, t_best) {
                    cell.node_ix ^= 1;
                    cell.t_enter = max(t_enter, ray.t_enter);
                    cell.t_exit = t_exit;
                    return true;
                }
            }
            cell.node_ix = parent_ix;
        }
        false
    }
}
