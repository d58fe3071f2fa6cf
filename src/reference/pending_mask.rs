//! Pending subtrees by the paper's bit mask: one bit a level. Twin of `pending_mask.glsl`.

use super::{
    counting::table::ReadCounter,
    inputs::KernelInputs,
    kdtree::{Cell, Pending},
    traversal_ray::TraversalRay,
};
use crate::layout::KD_MAX_DEPTH;

/// Which siblings on the way to the root are still to be visited. Bit i: the one i levels above the cell's node; one word for
/// the kernel's two.
#[derive(Clone, Copy, Default)]
pub struct Mask(u64);

impl Mask {
    #[inline(always)]
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Where the last of what is pending is kept.
    #[inline(always)]
    fn last_place(self) -> usize {
        self.0.count_ones() as usize - 1
    }

    #[inline(always)]
    pub fn has(self, n_levels_up: u32) -> bool {
        self.0 >> n_levels_up & 1 != 0
    }

    #[inline(always)]
    pub fn go_down(&mut self) {
        self.0 <<= 1;
    }

    /// The sibling of the cell's node is pending.
    #[inline(always)]
    pub fn mark(&mut self) {
        self.0 |= 1;
    }

    /// Up to the lowest sibling that is pending, and is no more. By how many levels. The mask is not empty.
    #[inline(always)]
    pub fn go_up(&mut self) -> u32 {
        let n = self.0.trailing_zeros();
        self.0 = self.0 >> (n & 63) ^ 1;
        n
    }
}

/// The mask, and the pending cells in its bits' order.
pub struct PendingMask {
    mask: Mask,
    /// Node, and where the ray leaves it.
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
        self.cells[self.mask.last_place()] = (second_ix, cell.t_exit);
    }

    #[inline(always)]
    fn pop(&mut self, _: &KernelInputs<impl ReadCounter>, _: &TraversalRay, t_best: f32, cell: &mut Cell) -> bool {
        cell.t_enter = cell.t_exit;
        if self.mask.is_empty() || t_best < cell.t_enter {
            return false;
        }
        (cell.node_ix, cell.t_exit) = self.cells[self.mask.last_place()];
        self.mask.go_up();
        true
    }
}
