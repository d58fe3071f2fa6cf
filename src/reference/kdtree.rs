//! Depth-first traversal of the kd-tree (the paper's section 2.3, Algorithm 2). Twin of `kdtree/kdtree.glsl`, which
//! defines cells, first and second children, and pending subtrees.

use super::{
    counting::table::ReadCounter,
    inputs::KernelInputs,
    leaf::intersect_leaf,
    slab::slab_of,
    traversal_ray::{TraversalRay, min},
};
use crate::{
    accel::kdtree::EMPTY_LEAF,
    layout::{Hit, KD_AXIS_MASK, KD_LEAF, KD_PAIR_SHIFT, KdNode, NO_TRIANGLE},
};

/// A node and the interval that the ray spends in it.
#[derive(Clone, Copy, Debug)]
pub struct Cell {
    pub node_ix: u32,
    pub t_enter: f32,
    pub t_exit: f32,
}

impl TraversalRay {
    /// Returns the t at which the ray meets the split plane.
    #[inline(always)]
    pub fn crossing(&self, node: KdNode) -> f32 {
        let axis = axis_of(node) as usize;
        f32::from_bits(node.split_or_first) * self.inv_direction[axis] + self.bias[axis]
    }

    /// Returns the index of the first child, on the side that the ray comes from. The second child's index is `^ 1`.
    #[inline(always)]
    pub fn first_child(&self, node: KdNode) -> u32 {
        let first_is_above = u32::from(self.inv_direction[axis_of(node) as usize] < 0.0);
        2 * (node.axis_and_child >> KD_PAIR_SHIFT) + first_is_above
    }
}

/// Returns the axis of a split, 0, 1 or 2.
#[inline(always)]
pub fn axis_of(node: KdNode) -> u32 {
    node.axis_and_child & KD_AXIS_MASK
}

/// Returns whether the node is a leaf.
#[inline(always)]
pub fn is_leaf(node: KdNode) -> bool {
    node.axis_and_child & KD_LEAF != 0
}

/// The pending subtrees, which the ray visits later. Implementations differ in how they keep them.
pub trait Pending {
    /// Working memory for any number of rays, one after the other.
    fn new() -> Self;
    /// Forgets all pending subtrees: a new ray begins.
    fn clear(&mut self);
    /// Notes that the ray goes one level down. Only implementations that keep a bit for each level do anything.
    fn go_down(&mut self) {}
    /// Makes the node `second_ix` pending, which is the sibling of the cell's node. The ray leaves that sibling at
    /// the cell's `t_exit`.
    fn push(&mut self, second_ix: u32, cell: &Cell);
    /// Sets `cell` to the next pending cell that may hold a hit nearer than `t_best`, or returns false if there is
    /// none.
    fn pop(
        &mut self,
        inputs: &KernelInputs<impl ReadCounter>,
        ray: &TraversalRay,
        t_best: f32,
        cell: &mut Cell,
    ) -> bool;
}

/// Descends to the leaf in which the ray enters the cell. If the ray keeps clear of a node's slab on the way, returns
/// an empty leaf in place of that node. If the t of a plane is NaN, both comparisons fail and the ray goes to the
/// first child alone, so that the traversal ends.
#[inline(always)]
fn descend<P: Pending>(
    inputs: &KernelInputs<impl ReadCounter>,
    ray: &TraversalRay,
    t_best: f32,
    pending: &mut P,
    cell: &mut Cell,
) -> KdNode {
    let mut node = inputs.kd_nodes[cell.node_ix as usize];
    loop {
        if let Some(slab) = slab_of(inputs, node, cell.node_ix)
            && ray.is_clear_of(slab, [cell.t_enter, min(cell.t_exit, t_best)])
        {
            return EMPTY_LEAF;
        }
        if is_leaf(node) {
            return node;
        }
        let t_cross = ray.crossing(node);
        let first_ix = ray.first_child(node);
        let in_first = t_cross >= cell.t_enter;
        let in_second = t_cross <= cell.t_exit;
        pending.go_down();
        cell.node_ix = if in_second && !in_first { first_ix ^ 1 } else { first_ix };
        if in_first && in_second {
            pending.push(first_ix ^ 1, cell);
            cell.t_exit = t_cross;
        }
        node = inputs.kd_nodes[cell.node_ix as usize];
    }
}

/// Returns whether the search can end because it needs only one hit and has one.
#[inline(always)]
pub(crate) fn is_done<const ANY_HIT: bool>(best: &Hit) -> bool {
    ANY_HIT && best.triangle_ix != NO_TRIANGLE
}

/// Visits all leaves that the ray meets from `t_enter` to `t_exit`, until no nearer hit can follow.
#[inline(always)]
pub(crate) fn search<P: Pending, const ANY_HIT: bool>(
    inputs: &KernelInputs<impl ReadCounter>,
    ray: &TraversalRay,
    pending: &mut P,
    best: &mut Hit,
) {
    // The comparison is not `>` with an early return, since a NaN has to miss.
    if ray.t_enter <= ray.t_exit {
        let root = Cell { node_ix: 0, t_enter: ray.t_enter, t_exit: ray.t_exit };
        search_cell::<_, ANY_HIT>(inputs, ray, pending, root, best);
    }
}

/// Does what [`search`] does, from a cell that the ray is in.
#[inline(always)]
pub(crate) fn search_cell<P: Pending, const ANY_HIT: bool>(
    inputs: &KernelInputs<impl ReadCounter>,
    ray: &TraversalRay,
    pending: &mut P,
    mut cell: Cell,
    best: &mut Hit,
) {
    pending.clear();
    loop {
        let leaf = descend(inputs, ray, best.t, pending, &mut cell);
        intersect_leaf(inputs, ray, leaf, [cell.t_enter, min(cell.t_exit, best.t)], best);
        if is_done::<ANY_HIT>(best) || !pending.pop(inputs, ray, best.t, &mut cell) {
            return;
        }
    }
}
