// From leaf to leaf by ropes, without a stack (Popov, Günther, Seidel, Slusallek: Stackless KD-Tree Traversal for High
// Performance GPU Ray Tracing, Eurographics 2007). A rope leads from a face of a leaf to the smallest node that has all
// of the face's other side.
//
// A leaf that the ray merely touches, within the width of a plane at an edge or along a face, lies on no such way. So a
// leaf is passed by itself only where the ray keeps clear of its edges; elsewhere all leaves that the ray meets between
// entry and exit are searched from the root. Planes stand here where the ray enters them, widened.

// 6 a node: below and above on x, y, z; 0: the face is the root's.
layout(std430, set = 0, binding = BIND_KD_ROPES) readonly buffer KdRopesBlock { uint kd_ropes[]; };

// The leaf in node_ix where the ray is at t.
KdNode leaf_at(TraversalRay ray, float t, inout uint node_ix) {
    KdNode node = kd_nodes[node_ix];
    while (axis_of(node) != KD_LEAF) {
        node_ix = first_child(ray, node) ^ (t > crossing(ray, node).x ? 1u : 0u);
        node = kd_nodes[node_ix];
    }
    return node;
}

// A passage through a leaf from t_enter to t_exit, by planes on two axes that the ray is in for width_enter and
// width_exit (the walk begins without one: axis 3, width 0).
struct Passage {
    float t_enter;
    float t_exit;
    uint entry_axis;
    uint exit_axis;
    float width_enter;
    float width_exit;
};

// Is the ray out of all other planes of the leaf from its entry until it has quite left it? A leaf that it meets there
// lies on the way, then. Proof: where the ray is in widened planes it meets what lies up to their width behind it. In a
// clear leaf that is the leaf, or what lies behind the entry; if the leaf before was clear too, that is the leaf before,
// for the ray was within all of its other planes; if not, the search around that one went so far.
bool is_clear(TraversalRay ray, Slabs slabs, Passage passage) {
    const uvec3 axes = uvec3(0u, 1u, 2u);
    bvec3 is_within = lessThan(slabs.near + widths_of(ray), vec3(passage.t_enter));
    bvec3 is_short = greaterThan(slabs.far, vec3(passage.t_exit + passage.width_exit));
    return all(mix(is_within, bvec3(true), equal(axes, uvec3(passage.entry_axis)))) &&
           all(mix(is_short, bvec3(true), equal(axes, uvec3(passage.exit_axis)))) &&
           passage.t_enter + passage.width_enter < passage.t_exit;
}

// All leaves that the ray meets on a passage, by the mask.
void search_around(TraversalRay ray, Passage passage, bool any_hit, inout Hit best) {
    ray.t_enter = max(ray.t_enter, passage.t_enter);
    ray.t_exit = min(ray.t_exit, passage.t_exit + passage.width_exit);
    search(ray, any_hit, best);
}

void follow_ropes(TraversalRay ray, bool any_hit, inout Hit best) {
    if (!(ray.t_enter <= ray.t_exit)) return;
    uint node_ix = 0u;
    Passage passage = Passage(0.0, ray.t_enter, 0u, 3u, 0.0, 0.0);
    do {
        KdNode leaf = leaf_at(ray, passage.t_exit, node_ix);
        Slabs slabs = slabs_of(ray, node_ix);
        vec3 far = slabs.far;
        uint axis = far.x <= far.y && far.x <= far.z ? 0u : (far.y <= far.z ? 1u : 2u);
        passage = Passage(passage.t_exit, along(far, axis), passage.exit_axis, axis, passage.width_exit,
                          along(widths_of(ray), axis));
        if (is_clear(ray, slabs, passage)) intersect_leaf(ray, leaf, best);
        else search_around(ray, passage, any_hit, best);
        if (is_done(any_hit, best) || best.t < passage.t_exit) return;
        uint is_above = along(ray.inv_direction, axis) < 0.0 ? 0u : 1u;
        node_ix = kd_ropes[6u * node_ix + 2u * axis + is_above];
    } while (node_ix != 0u);
}
