// From leaf to leaf by ropes, without a stack (Popov, Günther, Seidel, Slusallek: Stackless KD-Tree Traversal for High
// Performance GPU Ray Tracing, Eurographics 2007). A rope leads from a face of a leaf to the smallest node that has all
// of the face's other side.
//
// The leaves on the way end and begin at the same t, so every hit's t is in one of them; which of several that meet there
// does not matter.

// Down to the leaf where the ray is at t_enter, through all slabs but the leaf's own: where the ray leaves other cells is not
// known. Then node_ix is where the rope of the face leads to by which the ray leaves it.
KdNode descend_to_rope(TraversalRay ray, float t_best, inout Cell cell) {
    KdNode node = kd_node(cell.node_ix);
    while (axis_of(node) != KD_LEAF) {
        cell.node_ix = child_of(ray, node, cell.t_enter > crossing(ray, node));
        node = kd_node(cell.node_ix);
    }
    vec3 far = slabs_of(ray, cell.node_ix).far;
    uint axis = far.x <= far.y && far.x <= far.z ? 0u : (far.y <= far.z ? 1u : 2u);
    uint is_above = along(ray.inv_direction, axis) < 0.0 ? 0u : 1u;
    cell.t_exit = along(far, axis);
    if (has_slab(node)) node = enter_slab(ray, t_best, cell, node);
    cell.node_ix = kd_rope_of(cell.node_ix, 2u * axis + is_above);
    return node;
}

// Whether the rope leads to anything that may hold a hit nearer than t_best.
bool follow_rope(float t_best, inout Cell cell) {
    cell.t_enter = cell.t_exit;
    return cell.node_ix != 0u && !(t_best < cell.t_enter);
}
