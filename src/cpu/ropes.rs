//! From leaf to leaf by ropes, without a stack. Twin of `ropes.glsl`.

use super::{
    bindings::Bindings,
    kdtree::{TraversalRay, is_done, is_leaf, min},
    leaf::intersect_leaf,
    slab::slab_of,
    table::Reads,
};
use crate::layout::{Hit, KdNode};

/// The leaf in `node_ix` where the ray is at t.
#[inline(always)]
fn leaf_at(bindings: &Bindings<impl Reads>, ray: &TraversalRay, t: f32, node_ix: &mut u32) -> KdNode {
    let mut node = bindings.kd_nodes[*node_ix as usize];
    while !is_leaf(node) {
        *node_ix = ray.first_child(node) ^ u32::from(t > ray.crossing(node));
        node = bindings.kd_nodes[*node_ix as usize];
    }
    node
}

/// The closest hit, or with `ANY_HIT` one that need not be the closest.
#[inline]
pub fn follow_ropes<const ANY_HIT: bool>(bindings: &Bindings<impl Reads>, ray: &TraversalRay, best: &mut Hit) {
    if !(ray.t_enter <= ray.t_exit) {
        return;
    }
    let (mut node_ix, mut t) = (0, ray.t_enter);
    loop {
        let leaf = leaf_at(bindings, ray, t, &mut node_ix);
        let far = ray.slabs_of(bindings, node_ix).far;
        let axis = match (far[0] <= far[1] && far[0] <= far[2], far[1] <= far[2]) {
            (true, _) => 0,
            (_, true) => 1,
            _ => 2,
        };
        let t_enter = t;
        t = far[axis];
        let way = [t_enter, min(t, best.t)];
        if !slab_of(bindings, leaf, node_ix).is_some_and(|slab| ray.is_clear_of(slab, way)) {
            intersect_leaf(bindings, ray, leaf, way, best);
        }
        if is_done::<ANY_HIT>(best) || best.t < t {
            return;
        }
        let is_above = usize::from(!(ray.inv_direction[axis] < 0.0));
        node_ix = bindings.kd_ropes[6 * node_ix as usize + 2 * axis + is_above];
        if node_ix == 0 {
            return;
        }
    }
}
