// What spares a ray tests: where it keeps clear of the slab around a node's surface, all that is below; where it keeps clear of
// a triangle's plane, the triangle.

// A way from t_middle - t_half to t_middle + t_half, in the ray's own t.
struct Segment {
    float t_middle;
    float t_half;
};

// In the traversal's t, which are half as large.
Segment segment_of(float t_enter, float t_exit) {
    return Segment(t_enter + t_exit, t_exit - t_enter);
}

// Whether the ray keeps to one side of a plane (normal, distance from the origin) on its way, farther from it than `reach`.
bool is_clear(TraversalRay ray, Segment way, vec4 plane, float reach) {
    float height = dot(plane.xyz, ray.shear.origin) - plane.w;
    float slope = dot(plane.xyz, ray.direction);
    return abs(fma(way.t_middle, slope, height)) > fma(way.t_half, abs(slope), reach);
}

// A split that has no slab, or none that is looked at.
bool is_open_split(KdNode node) {
    return (node.axis_and_child & (KD_LEAF | KD_HAS_SLAB)) == 0u;
}

bool has_slab(KdNode node) {
    if (PREDICATES_BRANCHES) return false;
    return (node.axis_and_child & KD_HAS_SLAB) != 0u;
}

// The node as it is within its slab; an empty leaf, if the ray does not come into that in its way through the cell.
KdNode enter_slab(TraversalRay ray, float t_best, Cell cell, KdNode node) {
    count_steps(1u);
    Segment way = segment_of(cell.t_enter, min(cell.t_exit, t_best));
    if (is_clear(ray, way, load_kd_slabs(node_ix_of(cell.node_offset)), 1.0)) return KdNode(0u, KD_LEAF);
    return KdNode(node.split_or_first, node.axis_and_child & ~KD_HAS_SLAB);
}
