// Traversal from leaf to leaf by ropes, without a stack (Popov, Günther, Seidel, Slusallek: Stackless KD-Tree
// Traversal for High Performance GPU Ray Tracing, Eurographics 2007). A rope leads from a face of a leaf to the
// smallest node that contains everything on the other side of the face. A part of pending.glsl.
//
// Each leaf on the ray's path begins at the t at which the leaf before it ends, so every hit's t is in one of them.
// If several leaves meet at that t, it does not matter which of them the ray enters.
//
// Needs scene.glsl, kd_nodes.glsl and slab.glsl. Provides `descend_to_rope`.

// The t at which the ray leaves a cell, and the node that it enters there: 0 if it leaves the root's cell.
struct Exit {
    float t;
    uint node_ix;
};

// The exit through the far face on one axis.
Exit exit_along(TraversalRay ray, uint leaf_ix, uint axis) {
    float inv_direction = along(ray.inv_direction, axis);
    KdRope rope = kd_rope_of(leaf_ix, 2u * axis + (inv_direction < 0.0 ? 0u : 1u));
    precise float t = fma(rope.position, inv_direction, along(ray.bias, axis));
    return Exit(t, rope.node_ix);
}

// The exit through the face that the ray comes to first.
Exit exit_of(TraversalRay ray, uint leaf_ix) {
    Exit x = exit_along(ray, leaf_ix, 0u);
    Exit y = exit_along(ray, leaf_ix, 1u);
    Exit z = exit_along(ray, leaf_ix, 2u);
    float t = min(x.t, min(y.t, z.t));
    return Exit(t, x.t == t ? x.node_ix : (y.t == t ? y.node_ix : z.node_ix));
}

// Descends to the leaf that contains the ray at t_enter. Of all slabs, only the leaf's own is tested: the others
// would require the t at which the ray leaves their cells, which costs more than these slabs save
// (docs/experiments.md). Afterwards, the cell's t_exit is the leaf's, but its node_offset is already that of the
// next node: the one to which the rope of the leaf's exit face leads.
KdNode descend_to_rope(TraversalRay ray, float t_best, inout Cell cell) {
    KdNode node = kd_node(cell.node_offset);
    while (!is_leaf(node)) {
        cell.node_offset = child_of(ray, node, cell.t_enter > crossing(ray, node));
        node = kd_node(cell.node_offset);
        if (PREDICATES_BRANCHES && is_leaf(node)) break;
    }
    Exit exit = exit_of(ray, node_ix_of(cell.node_offset));
    cell.t_exit = exit.t;
    if (has_slab(node)) node = enter_slab(ray, t_best, cell, node);
    cell.node_offset = offset_of(exit.node_ix);
    return node;
}
