// From leaf to leaf by ropes, without a stack (Popov, Günther, Seidel, Slusallek: Stackless KD-Tree Traversal for High
// Performance GPU Ray Tracing, Eurographics 2007). A rope leads from a face of a leaf to the smallest node that has all
// of the face's other side.
//
// Ropes lead from the leaf that the ray is in to the one that it enters, one at a time. A leaf that it merely touches,
// within the slack of an edge or along a face, lies on no such way. So a leaf is passed by itself only where the ray
// keeps clear of its edges; elsewhere all leaves that it meets between entry and exit are searched from the root.

// 6 a node: below and above on x, y, z; 0: the face is the root's.
layout(std430, set = 0, binding = BIND_KD_ROPES) readonly buffer KdRopesBlock { uint kd_ropes[]; };

// The leaf in node_ix where the ray is at t, by planes as they are, not widened.
KdNode leaf_at(TraversalRay ray, float t, inout uint node_ix) {
    KdNode node = kd_nodes[node_ix];
    while (axis_of(node) != KD_LEAF) {
        node_ix = first_child(ray, node) ^ (t > at_plane(ray, node) ? 1u : 0u);
        node = kd_nodes[node_ix];
    }
    return node;
}

// A passage through a leaf: from t_enter, through a face on entry_axis that was widened by slack_enter (3 and 0 where
// the walk begins), to t_exit.
struct Passage {
    float t_enter;
    float t_exit;
    uint entry_axis;
    uint exit_axis;
    float slack_enter;
    float slack_exit;
};

// Does the ray, with the slack around it, cross the leaf from one face to another and meet no third? Then what it
// touches there is the leaf, the one before and the next, if these are clear too; if not, their search finds it.
bool is_clear(TraversalRay ray, Slabs slabs, Passage passage) {
    const uvec3 axes = uvec3(0u, 1u, 2u);
    bvec3 is_within = lessThan(slabs.enter + ray.slack, vec3(passage.t_enter - passage.slack_enter));
    bvec3 is_short = greaterThan(slabs.exit - ray.slack, vec3(passage.t_exit + passage.slack_exit));
    return all(mix(is_within, bvec3(true), equal(axes, uvec3(passage.entry_axis)))) &&
           all(mix(is_short, bvec3(true), equal(axes, uvec3(passage.exit_axis)))) &&
           passage.t_enter + passage.slack_enter + passage.slack_exit < passage.t_exit;
}

// All leaves that the ray meets on a passage. By the mask.
void search_around(TraversalRay ray, Passage passage, bool any_hit, inout Hit best) {
    ray.t_enter = max(ray.t_enter, passage.t_enter - passage.slack_enter);
    ray.t_exit = min(ray.t_exit, passage.t_exit + passage.slack_exit);
    search(ray, any_hit, best);
}

void follow_ropes(TraversalRay ray, bool any_hit, inout Hit best) {
    if (!(ray.t_enter <= ray.t_exit)) return;
    uint node_ix = 0u;
    Passage passage = Passage(0.0, ray.t_enter, 0u, 3u, 0.0, 0.0);
    do {
        KdNode leaf = leaf_at(ray, passage.t_exit, node_ix);
        Slabs slabs = slabs_of(ray, node_ix);
        vec3 exit = slabs.exit;
        uint axis = exit.x <= exit.y && exit.x <= exit.z ? 0u : (exit.y <= exit.z ? 1u : 2u);
        passage = Passage(passage.t_exit, along(exit, axis), passage.exit_axis, axis, passage.slack_exit,
                          along(ray.slack, axis));
        if (is_clear(ray, slabs, passage)) intersect_leaf(ray, leaf, best);
        else search_around(ray, passage, any_hit, best);
        if (is_done(any_hit, best) || best.t < passage.t_exit - passage.slack_exit) return;
        uint is_above = along(ray.inv_direction, axis) < 0.0 ? 0u : 1u;
        node_ix = kd_ropes[6u * node_ix + 2u * axis + is_above];
    } while (node_ix != 0u);
}
