//! Pending subtrees by the paper's bit mask, which has one bit for each level. Twin of `kdtree/pending_mask.glsl`.

use super::{
    counting::table::ReadCounter,
    inputs::KernelInputs,
    kdtree::{Cell, Pending},
    traversal_ray::TraversalRay,
};
use crate::layout::KD_MAX_DEPTH;

/// The siblings that are still to be visited on the way to the root. Bit i is set if the sibling of the node i levels
/// above the cell's node is pending. This one word replaces the kernel's two.
#[derive(Clone, Copy, Default)]
pub struct Mask(u64);

impl Mask {
    /// Returns whether nothing is pending.
    #[inline(always)]
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Returns the slot of the deepest pending cell, which is the next to be visited.
    #[inline(always)]
    fn last_slot(self) -> usize {
        self.0.count_ones() as usize - 1
    }

    /// Returns whether the sibling of the node `n_levels_up` above the cell's node is pending.
    #[inline(always)]
    pub fn has(self, n_levels_up: u32) -> bool {
        self.0 >> n_levels_up & 1 != 0
    }

    /// Shifts the mask as the ray goes one level down.
    #[inline(always)]
    pub fn go_down(&mut self) {
        self.0 <<= 1;
    }

    /// Marks the sibling of the cell's node as pending.
    #[inline(always)]
    pub fn mark(&mut self) {
        self.0 |= 1;
    }

    /// Goes up to the lowest pending sibling and clears its bit. Returns the number of levels. The mask must not be
    /// empty.
    #[inline(always)]
    pub fn go_up(&mut self) -> u32 {
        let n = self.0.trailing_zeros();
        self.0 = self.0 >> (n & 63) ^ 1;
        n
    }
}

/// Pending subtrees: the mask, and the cells in the order of its bits.
pub struct PendingMask {
    mask: Mask,
    /// Each entry: the pending node, and the t at which the ray leaves it.
    cells: [(u32, f32); KD_MAX_DEPTH as usize],
}

impl Pending for PendingMask {
    fn new() -> Self {
        Self { mask: Mask::default(), cells: [(0, 0.0); KD_MAX_DEPTH as usize] }
    }

    #[inline(always)]
    fn clear(&mut self) {
        self.mask = Mask::default();
    }

    #[inline(always)]
    fn go_down(&mut self) {
        self.mask.go_down();
    }

    #[inline(always)]
    fn push(&mut self, second_ix: u32, cell: &Cell) {
        self.mask.mark();
        self.cells[self.mask.last_slot()] = (second_ix, cell.t_exit);
    }

    #[inline(always)]
    fn pop(&mut self, _: &KernelInputs<impl ReadCounter>, _: &TraversalRay, t_best: f32, cell: &mut Cell) -> bool {
        cell.t_enter = cell.t_exit;
        if self.mask.is_empty() || t_best < cell.t_enter {
            return false;
        }
        (cell.node_ix, cell.t_exit) = self.cells[self.mask.last_slot()];
        self.mask.go_up();
        true
    }
}
