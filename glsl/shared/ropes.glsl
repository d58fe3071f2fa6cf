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

// The leaf in node_ix where the ray is at t; then t is where the ray leaves it, and node_ix where the rope there leads to.
Visit next_by_rope(TraversalRay ray, float t_best, inout uint node_ix, inout float t) {
    KdNode leaf = leaf_at(ray, t, node_ix);
    vec3 far = slabs_of(ray, node_ix).far;
    uint axis = far.x <= far.y && far.x <= far.z ? 0u : (far.y <= far.z ? 1u : 2u);
    uint is_above = along(ray.inv_direction, axis) < 0.0 ? 0u : 1u;
    node_ix = kd_rope_of(node_ix, 2u * axis + is_above);
    float t_enter = t;
    t = along(far, axis);
    return visit_leaf(leaf, t_enter, min(t, t_best));
}

bool rope_ends(bool any_hit, Hit best, uint node_ix, float t) {
    return is_done(any_hit, best) || best.t < t || node_ix == 0u;
}

void follow_by_leaves(TraversalRay ray, bool any_hit, inout Hit best) {
    uint node_ix = 0u;
    float t = ray.t_enter;
    do {
        Visit visit = next_by_rope(ray, best.t, node_ix, t);
        intersect_rest(ray, visit, best);
    } while (!rope_ends(any_hit, best, node_ix, t));
}

void follow_by_turns(TraversalRay ray, bool any_hit, inout Hit best) {
    uint node_ix = 0u;
    float t = ray.t_enter;
    Visit visit = next_by_rope(ray, best.t, node_ix, t);
    bool goes_on = true;
    do {
        uint entry_ix;
        if (find_candidate(ray, visit, entry_ix)) {
            intersect(ray, leaf_triangle_at(entry_ix), best);
            goes_on = !is_done(any_hit, best);
        } else {
            goes_on = !rope_ends(any_hit, best, node_ix, t);
            if (goes_on) visit = next_by_rope(ray, best.t, node_ix, t);
        }
    } while (goes_on);
}

void follow_ropes(TraversalRay ray, bool any_hit, inout Hit best) {
    if (!(ray.t_enter <= ray.t_exit)) return;
    if (RUNS_BOTH_SIDES) follow_by_leaves(ray, any_hit, best);
    else follow_by_turns(ray, any_hit, best);
}
