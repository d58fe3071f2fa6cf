//! The newest pending subtrees on a ring, older ones by a restart. Twin of `pending_short_stack.glsl`.

use super::{
    bindings::Bindings,
    kdtree::{Cell, Pending, TraversalRay, max},
    pending_mask::bit_of,
    pending_restart::PendingRestart,
    table::Reads,
};

/// The `N` newest entries, and the trail to all.
pub struct PendingShortStack<const N: usize> {
    restart: PendingRestart,
    /// Node, entry and exit.
    entries: [(u32, f32, f32); N],
    /// Where the next entry goes, and how many are kept.
    top: usize,
    size: usize,
}

impl<const N: usize> Pending for PendingShortStack<N> {
    fn new() -> Self {
        Self { restart: PendingRestart::new(), entries: [(0, 0.0, 0.0); N], top: 0, size: 0 }
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
        self.entries[self.top] = (second_ix, max(cell.t_enter, t_cross[0]), cell.t_exit);
        self.top = (self.top + 1) % N;
        self.size = (self.size + 1).min(N);
    }

    #[inline(always)]
    fn pop(&mut self, bindings: &Bindings<impl Reads>, ray: &TraversalRay, t_best: f32, cell: &mut Cell) -> bool {
        let trail = &mut self.restart.trail;
        while self.size > 0 {
            self.size -= 1;
            self.top = (self.top + N - 1) % N;
            let (node_ix, t_enter, t_exit) = self.entries[self.top];
            let depth = trail.deepest();
            trail.mask &= !bit_of(depth);
            *cell = Cell { node_ix, depth, t_enter, t_exit };
            if t_enter <= t_best {
                return true;
            }
            // Older ones begin at most `ray.overlap` before it.
            trail.t_deepest = t_enter;
        }
        self.restart.pop(bindings, ray, t_best, cell)
    }
}
