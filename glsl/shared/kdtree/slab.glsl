// Two ways to save tests. If a ray keeps clear of the slab around a node's surface, everything below the node is
// skipped. If it keeps clear of a triangle's plane, the triangle is skipped. A part of kdtree.glsl.
//
// Needs scene.glsl, search/steps.glsl, search/traversal_ray.glsl, kd_nodes.glsl and PREDICATES_BRANCHES. Provides
// `Interval`, `is_clear`, `is_open_split`, `has_slab` and `enter_slab`.

// A segment of the ray, from t_middle - t_half to t_middle + t_half in the ray's own t.
struct Interval {
    float t_middle;
    float t_half;
};

// The segment between two t of the traversal, which are half of the ray's own.
Interval interval_of(float t_enter, float t_exit) {
    return Interval(t_enter + t_exit, t_exit - t_enter);
}

// Whether the ray, within `interval`, stays on one side of a plane and farther from it than `reach`. plane: xyz is a
// normal of any length, w is `dot(normal, p)` of the plane's points p. reach: in the same units, a distance times the
// normal's length.
bool is_clear(TraversalRay ray, Interval interval, vec4 plane, float reach) {
    float height = dot(plane.xyz, ray.shear.origin) - plane.w;
    float slope = dot(plane.xyz, ray.direction);
    return abs(fma(interval.t_middle, slope, height)) > fma(interval.t_half, abs(slope), reach);
}

// Whether the node is a split whose children can be visited. Either it has no slab, or `enter_slab` has removed the
// mark, since the ray comes into the slab.
bool is_open_split(KdNode node) {
    return (node.axis_and_child & (KD_LEAF | KD_HAS_SLAB)) == 0u;
}

bool has_slab(KdNode node) {
    if (PREDICATES_BRANCHES) return false;
    return (node.axis_and_child & KD_HAS_SLAB) != 0u;
}

// Tests the node's slab. Returns the node without the mark of a slab if the ray comes into the slab within its
// interval through the cell, and otherwise an empty leaf.
KdNode enter_slab(TraversalRay ray, float t_best, Cell cell, KdNode node) {
    count_steps(1u);
    Interval interval = interval_of(cell.t_enter, min(cell.t_exit, t_best));
    if (is_clear(ray, interval, load_kd_slabs(node_ix_of(cell.node_offset)), 1.0)) return KdNode(0u, KD_LEAF);
    return KdNode(node.split_or_first, node.axis_and_child & ~KD_HAS_SLAB);
}
