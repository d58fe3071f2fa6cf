//! Pending subtrees on a short stack: a ring keeps the newest ones, and the mask leads to older ones. Twin of
//! `kdtree/pending_short_stack.glsl`.

use super::{
    counting::table::ReadCounter,
    inputs::KernelInputs,
    kdtree::{Cell, Pending},
    pending_restart::Trail,
    traversal_ray::TraversalRay,
};

/// Pending subtrees: the `N` newest ones, and the trail of all. `N` is a power of two, or 0 for the traversal by
/// restarts.
pub struct PendingTrail<const N: usize> {
    trail: Trail,
    /// Each entry: the pending node, and the t at which the ray leaves it.
    entries: [(u32, f32); N],
    /// Number of the next entry. An entry's slot is its number modulo `N`.
    top: usize,
    /// Number of entries that the ring holds.
    size: usize,
}

impl<const N: usize> Pending for PendingTrail<N> {
    fn new() -> Self {
        Self { trail: Trail::default(), entries: [(0, 0.0); N], top: 0, size: 0 }
    }

    #[inline(always)]
    fn clear(&mut self) {
        self.trail = Trail::default();
        self.top = 0;
        self.size = 0;
    }

    #[inline(always)]
    fn go_down(&mut self) {
        self.trail.go_down();
    }

    #[inline(always)]
    fn push(&mut self, second_ix: u32, cell: &Cell) {
        self.trail.mask.mark();
        if N > 0 {
            self.entries[self.top & N.wrapping_sub(1)] = (second_ix, cell.t_exit);
            self.top += 1;
            self.size = (self.size + 1).min(N);
        }
    }

    #[inline(always)]
    fn pop(
        &mut self,
        inputs: &KernelInputs<impl ReadCounter>,
        ray: &TraversalRay,
        t_best: f32,
        cell: &mut Cell,
    ) -> bool {
        cell.t_enter = cell.t_exit;
        if self.trail.mask.is_empty() || t_best < cell.t_enter {
            return false;
        }
        if self.size > 0 {
            self.size -= 1;
            self.top -= 1;
            (cell.node_ix, cell.t_exit) = self.entries[self.top & N.wrapping_sub(1)];
            self.trail.go_up();
        } else {
            self.trail.retrace(inputs, ray, cell);
        }
        true
    }
}
