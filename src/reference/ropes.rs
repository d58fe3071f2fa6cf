//! Traversal from leaf to leaf by ropes, without a stack. Twin of `kdtree/ropes.glsl`.

use super::{
    counting::table::ReadCounter,
    inputs::KernelInputs,
    kdtree::{is_done, is_leaf},
    leaf::intersect_leaf,
    slab::slab_of,
    traversal_ray::{TraversalRay, min},
};
use crate::layout::{Hit, KdNode};

/// Descends from the node to the leaf that contains the ray at t. Returns the leaf, and its index in `node_ix`.
#[inline(always)]
fn leaf_at(inputs: &KernelInputs<impl ReadCounter>, ray: &TraversalRay, t: f32, node_ix: &mut u32) -> KdNode {
    let mut node = inputs.kd_nodes[*node_ix as usize];
    while !is_leaf(node) {
        *node_ix = ray.first_child(node) ^ u32::from(t > ray.crossing(node));
        node = inputs.kd_nodes[*node_ix as usize];
    }
    node
}

/// Returns the t at which the ray leaves a leaf's cell, through the face that it comes to first, and the node behind
/// that face. The node is 0 outside the root's cell.
#[inline(always)]
fn exit_of(inputs: &KernelInputs<impl ReadCounter>, ray: &TraversalRay, leaf_ix: u32) -> (f32, u32) {
    let exits = [0, 1, 2].map(|axis| {
        let is_above = usize::from(!(ray.inv_direction[axis] < 0.0));
        let rope = inputs.kd_ropes[6 * leaf_ix as usize + 2 * axis + is_above];
        (rope.position * ray.inv_direction[axis] + ray.bias[axis], rope.node_ix)
    });
    exits.into_iter().reduce(|first, other| if other.0 < first.0 { other } else { first }).expect("three")
}

/// Finds the closest hit nearer than `best`, or with `ANY_HIT` one that need not be the closest, and keeps it in
/// `best`.
#[inline]
pub fn follow_ropes<const ANY_HIT: bool>(inputs: &KernelInputs<impl ReadCounter>, ray: &TraversalRay, best: &mut Hit) {
    if !(ray.t_enter <= ray.t_exit) {
        return;
    }
    let (mut node_ix, mut t) = (0, ray.t_enter);
    loop {
        let leaf = leaf_at(inputs, ray, t, &mut node_ix);
        let t_enter = t;
        let rope;
        (t, rope) = exit_of(inputs, ray, node_ix);
        let way = [t_enter, min(t, best.t)];
        if !slab_of(inputs, leaf, node_ix).is_some_and(|slab| ray.is_clear_of(slab, way)) {
            intersect_leaf(inputs, ray, leaf, way, best);
        }
        if is_done::<ANY_HIT>(best) || best.t < t {
            return;
        }
        node_ix = rope;
        if node_ix == 0 {
            return;
        }
    }
}
