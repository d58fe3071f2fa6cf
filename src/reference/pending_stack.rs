//! Pending subtrees on a stack, without bits and without climbing. Twin of `kdtree/pending_stack.glsl`.

use super::{
    counting::table::ReadCounter,
    inputs::KernelInputs,
    kdtree::{Cell, Pending},
    traversal_ray::TraversalRay,
};
use crate::layout::KD_MAX_DEPTH;

/// Pending subtrees on a stack.
pub struct PendingStack {
    /// Each entry: the pending node, and the t at which the ray leaves it. The t at which the ray enters is not
    /// stored: it is the t at which the ray has just left the cell before.
    entries: [(u32, f32); KD_MAX_DEPTH as usize],
    size: usize,
}

impl Pending for PendingStack {
    fn new() -> Self {
        Self { entries: [(0, 0.0); KD_MAX_DEPTH as usize], size: 0 }
    }

    #[inline(always)]
    fn clear(&mut self) {
        self.size = 0;
    }

    #[inline(always)]
    fn push(&mut self, second_ix: u32, cell: &Cell) {
        self.entries[self.size] = (second_ix, cell.t_exit);
        self.size += 1;
    }

    #[inline(always)]
    fn pop(&mut self, _: &KernelInputs<impl ReadCounter>, _: &TraversalRay, t_best: f32, cell: &mut Cell) -> bool {
        cell.t_enter = cell.t_exit;
        if self.size == 0 || t_best < cell.t_enter {
            return false;
        }
        self.size -= 1;
        (cell.node_ix, cell.t_exit) = self.entries[self.size];
        true
    }
}
