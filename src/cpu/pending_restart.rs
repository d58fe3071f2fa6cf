//! Pending subtrees found again from the root, along the mask's trail. Twin of `pending_restart.glsl`.

use super::{
    bindings::Bindings,
    kdtree::{Cell, TraversalRay, min},
    pending_mask::Mask,
    table::Reads,
};

/// Down from the root to the deepest pending node, which is pending no more.
#[inline(always)]
pub fn retrace(mask: &mut Mask, bindings: &Bindings<impl Reads>, ray: &TraversalRay, cell: &mut Cell) {
    let depth = mask.take_deepest();
    *cell = Cell { node_ix: 0, depth, t_exit: ray.t_exit, ..*cell };
    for depth in 1..=depth {
        let node = bindings.kd_nodes[cell.node_ix as usize];
        let t_cross = ray.crossing(node);
        let in_second = t_cross <= cell.t_exit;
        cell.node_ix = ray.first_child(node) ^ u32::from(in_second && !mask.has(depth));
        if mask.has(depth) {
            cell.t_exit = min(cell.t_exit, t_cross);
        }
    }
}
