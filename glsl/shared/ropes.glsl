// From leaf to leaf by ropes, without a stack (Popov, Günther, Seidel, Slusallek: Stackless KD-Tree Traversal for High
// Performance GPU Ray Tracing, Eurographics 2007). A rope leads from a face of a leaf to the smallest node that has all
// of the face's other side.
//
// The leaves on the way end and begin at the same t, so every hit's t is in one of them; which of several that meet there
// does not matter.

// Where the ray leaves a cell, and the node that is there.
struct Exit {
    float t;
    uint node_ix;
};

// By the face that it comes to along an axis.
Exit exit_along(TraversalRay ray, uint leaf_ix, uint axis) {
    float inv_direction = along(ray.inv_direction, axis);
    KdRope rope = kd_rope_of(leaf_ix, 2u * axis + (inv_direction < 0.0 ? 0u : 1u));
    precise float t = fma(rope.position, inv_direction, along(ray.bias, axis));
    return Exit(t, rope.node_ix);
}

// By the face that it comes to first.
Exit exit_of(TraversalRay ray, uint leaf_ix) {
    Exit x = exit_along(ray, leaf_ix, 0u);
    Exit y = exit_along(ray, leaf_ix, 1u);
    Exit z = exit_along(ray, leaf_ix, 2u);
    float t = min(x.t, min(y.t, z.t));
    return Exit(t, x.t == t ? x.node_ix : (y.t == t ? y.node_ix : z.node_ix));
}

// Down to the leaf where the ray is at t_enter, through all slabs but the leaf's own: to find out where the ray leaves other cells
// costs more than their slabs spare (benches/EXPERIMENTS.md). Then node_offset is where the rope of the face leads to by which the ray leaves it.
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
