//! Pending subtrees by restarts from the root, along the trail that the mask stores. Twin of
//! `kdtree/pending_restart.glsl`.

use super::{
    counting::table::ReadCounter,
    inputs::KernelInputs,
    kdtree::Cell,
    pending_mask::Mask,
    traversal_ray::{TraversalRay, min},
};

/// The trail of the path down from the root to the cell's node.
#[derive(Clone, Copy, Default)]
pub struct Trail {
    /// At a set bit, the path went to the first child.
    pub mask: Mask,
    /// Levels from the root to the cell's node.
    length: u32,
}

impl Trail {
    /// Extends the trail by one level.
    #[inline(always)]
    pub fn go_down(&mut self) {
        self.mask.go_down();
        self.length += 1;
    }

    /// Goes up to the lowest pending sibling and clears its bit.
    #[inline(always)]
    pub fn go_up(&mut self) {
        self.length -= self.mask.go_up();
    }

    /// Does what [`Trail::go_up`] does, and walks from the root to that sibling, which becomes the cell.
    #[inline(always)]
    pub fn retrace(&mut self, inputs: &KernelInputs<impl ReadCounter>, ray: &TraversalRay, cell: &mut Cell) {
        self.go_up();
        *cell = Cell { node_ix: 0, t_exit: ray.t_exit, ..*cell };
        for n_left in (0..self.length).rev() {
            let node = inputs.kd_nodes[cell.node_ix as usize];
            let t_cross = ray.crossing(node);
            let to_first = self.mask.has(n_left);
            let in_second = t_cross <= cell.t_exit;
            cell.node_ix = ray.first_child(node) ^ u32::from(in_second && !to_first);
            if to_first {
                cell.t_exit = min(cell.t_exit, t_cross);
            }
        }
    }
}
