// From leaf to leaf by ropes, without a stack (Popov, Günther, Seidel, Slusallek: Stackless KD-Tree Traversal for High
// Performance GPU Ray Tracing, Eurographics 2007). A rope leads from a face of a leaf to the smallest node that has all
// of the face's other side.
//
// The leaves on the way end and begin at the same t, so every hit's t is in one of them; which of several that meet there
// does not matter.

// The leaf in node_ix where the ray is at t.
KdNode leaf_at(TraversalRay ray, float t, inout uint node_ix) {
    KdNode node = kd_node(node_ix);
    while (axis_of(node) != KD_LEAF) {
        node_ix = first_child(ray, node) ^ (t > crossing(ray, node) ? 1u : 0u);
        node = kd_node(node_ix);
    }
    return node;
}

void follow_ropes(TraversalRay ray, bool any_hit, inout Hit best) {
    if (!(ray.t_enter <= ray.t_exit)) return;
    uint node_ix = 0u;
    float t = ray.t_enter;
    do {
        KdNode leaf = leaf_at(ray, t, node_ix);
        vec3 far = slabs_of(ray, node_ix).far;
        uint axis = far.x <= far.y && far.x <= far.z ? 0u : (far.y <= far.z ? 1u : 2u);
        float t_enter = t;
        t = along(far, axis);
        Visit visit = visit_leaf(leaf, t_enter, min(t, best.t));
        intersect_rest(ray, visit, best);
        if (is_done(any_hit, best) || best.t < t) return;
        uint is_above = along(ray.inv_direction, axis) < 0.0 ? 0u : 1u;
        node_ix = kd_rope_of(node_ix, 2u * axis + is_above);
    } while (node_ix != 0u);
}
