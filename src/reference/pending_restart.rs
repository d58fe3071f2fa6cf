//! Pending subtrees found again from the root, along the mask's trail. Twin of `pending_restart.glsl`.

use super::{
    counting::table::ReadCounter,
    inputs::KernelInputs,
    kdtree::Cell,
    pending_mask::Mask,
    traversal_ray::{TraversalRay, min},
};

/// The way down to the cell's node.
#[derive(Clone, Copy, Default)]
pub struct Trail {
    pub mask: Mask,
    /// Levels.
    length: u32,
}

impl Trail {
    #[inline(always)]
    pub fn go_down(&mut self) {
        self.mask.go_down();
        self.length += 1;
    }

    /// Up to the lowest sibling that is pending, and is no more.
    #[inline(always)]
    pub fn go_up(&mut self) {
        self.length -= self.mask.go_up();
    }

    /// The same, and the cell from the root down to there.
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
