//! Pending subtrees by the paper's bit mask: one bit a level. Twin of `pending_mask.glsl`.

use super::{
    bindings::Bindings,
    kdtree::{Cell, Pending, TraversalRay},
    table::Reads,
};
use crate::layout::KD_MAX_DEPTH;

/// Which siblings on the way to the root are still to be visited. Bit d - 1: depth d; one word for the kernel's two.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Mask(pub u64);

#[inline(always)]
pub fn bit_of(depth: u32) -> u64 {
    1 << ((depth - 1) & 63)
}

impl Mask {
    #[inline(always)]
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    #[inline(always)]
    pub fn has(self, depth: u32) -> bool {
        self.0 & bit_of(depth) != 0
    }

    /// Depth of the highest bit; the mask is not empty.
    #[inline(always)]
    pub fn deepest(self) -> u32 {
        64 - self.0.leading_zeros()
    }

    /// Takes the highest bit away, and returns its depth.
    #[inline(always)]
    pub fn take_deepest(&mut self) -> u32 {
        let depth = self.deepest();
        self.0 &= !bit_of(depth);
        depth
    }
}

/// The mask, and a cell's place for each level.
pub struct PendingMask {
    mask: Mask,
    /// Of each depth: node, and where the ray leaves it. What the mask does not name is left over.
    cells: [(u32, f32); KD_MAX_DEPTH as usize],
}

impl Pending for PendingMask {
    fn new() -> Self {
        Self { mask: Mask(0), cells: [(0, 0.0); KD_MAX_DEPTH as usize] }
    }

    #[inline(always)]
    fn clear(&mut self) {
        self.mask = Mask(0);
    }

    #[inline(always)]
    fn push(&mut self, second_ix: u32, cell: &Cell) {
        self.mask.0 |= bit_of(cell.depth);
        self.cells[cell.depth as usize - 1] = (second_ix, cell.t_exit);
    }

    #[inline(always)]
    fn pop(&mut self, _: &Bindings<impl Reads>, _: &TraversalRay, t_best: f32, cell: &mut Cell) -> bool {
        cell.t_enter = cell.t_exit;
        if self.mask.is_empty() || t_best < cell.t_enter {
            return false;
        }
        cell.depth = self.mask.take_deepest();
        (cell.node_ix, cell.t_exit) = self.cells[cell.depth as usize - 1];
        true
    }
}
