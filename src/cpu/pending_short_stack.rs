//! The newest pending subtrees on a ring, older ones by a restart. Twin of `pending_short_stack.glsl`.

use super::{
    bindings::Bindings,
    kdtree::{Cell, Pending, TraversalRay},
    pending_mask::bit_of,
    pending_restart::PendingRestart,
    table::Reads,
};

/// The `N` newest entries, and the trail to all.
pub struct PendingShortStack<const N: usize> {
    restart: PendingRestart,
    /// Node, and where the ray leaves it.
    entries: [(u32, f32); N],
    /// Where the next entry goes, and how many are kept.
    top: usize,
    size: usize,
}

impl<const N: usize> Pending for PendingShortStack<N> {
    fn new() -> Self {
        Self { restart: PendingRestart::new(), entries: [(0, 0.0); N], top: 0, size: 0 }
    }

    #[inline(always)]
    fn clear(&mut self) {
        self.restart.clear();
        self.top = 0;
        self.size = 0;
    }

    #[inline(always)]
    fn push(&mut self, second_ix: u32, cell: &Cell, t_cross: [f32; 2]) {
        self.restart.push(second_ix, cell, t_cross);
        self.entries[self.top] = (second_ix, cell.t_exit);
        self.top = (self.top + 1) % N;
        self.size = (self.size + 1).min(N);
    }

    #[inline(always)]
    fn pop(&mut self, bindings: &Bindings<impl Reads>, ray: &TraversalRay, t_best: f32, cell: &mut Cell) -> bool {
        if self.size == 0 {
            return self.restart.pop(bindings, ray, t_best, cell);
        }
        cell.t_enter = cell.t_exit - ray.overlap;
        if t_best < cell.t_enter {
            return false;
        }
        self.size -= 1;
        self.top = (self.top + N - 1) % N;
        (cell.node_ix, cell.t_exit) = self.entries[self.top];
        let trail = &mut self.restart.trail;
        cell.depth = trail.deepest();
        trail.mask &= !bit_of(cell.depth);
        true
    }
}
