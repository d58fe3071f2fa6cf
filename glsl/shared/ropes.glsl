// From leaf to leaf by ropes, without a stack (Popov, Günther, Seidel, Slusallek: Stackless KD-Tree Traversal for High
// Performance GPU Ray Tracing, Eurographics 2007). A rope leads from a face of a leaf to the smallest node that has all
// of the face's other side.
//
// The leaves on the way end and begin at the same t, so every hit's t is in one of them; which of several that meet there
// does not matter.

// Down to the leaf where the ray is at t_enter, through all slabs but the leaf's own: where the ray leaves other cells is not
// known. Then node_at is where the rope of the face leads to by which the ray leaves it.
KdNode descend_to_rope(TraversalRay ray, float t_best, inout Cell cell) {
    KdNode node = kd_node(cell.node_at);
    while (!is_leaf(node)) {
        cell.node_at = child_of(ray, node, cell.t_enter > crossing(ray, node));
        node = kd_node(cell.node_at);
    }
    vec3 far = slabs_of(ray, index_of(cell.node_at)).far;
    uint axis = far.x <= far.y && far.x <= far.z ? 0u : (far.y <= far.z ? 1u : 2u);
    uint is_above = along(ray.inv_direction, axis) < 0.0 ? 0u : 1u;
    cell.t_exit = along(far, axis);
    if (has_slab(node)) node = enter_slab(ray, t_best, cell, node);
    cell.node_at = place_of(kd_rope_of(index_of(cell.node_at), 2u * axis + is_above));
    return node;
}
