// Cells of the kd-tree with their distance from a point, for closest_point.comp. Twin: src/reference/distant_cells.rs.
//
// Needs scene.glsl, search/point_triangle.glsl, search/magnitude.glsl, search/traversal_ray.glsl and kd_nodes.glsl.
// Provides `Query`, `query_at`, `inverse_of`, `DistantCell`, `gap_to`, `root_of`, `may_be_closer`, `split_cell`, and
// the cells that wait: `push_if_closer` and `pop_pending`.

// The point in units of 1 / scale, a power of two that brings all coordinates below 4: squares do not overflow.
struct Query {
    vec3 position;
    float scale;
};

// The query of a point at a box.
Query query_at(vec3 position, vec3 box_min, vec3 box_max) {
    uint bits = max(longest_bits(position), max(longest_bits(box_min), longest_bits(box_max)));
    uint exponent = clamp(bits >> 23, 1u, 253u);
    float scale = uintBitsToFloat((254u - exponent) << 23); // 2^(127 - exponent)
    precise vec3 scaled = position * scale;
    return Query(scaled, scale);
}

// The reciprocal of a power of two.
float inverse_of(float scale) {
    return uintBitsToFloat(0x7f000000u - floatBitsToUint(scale));
}

// A node, and the distance from the point to the node's cell on each axis, which is 0 within the cell's extent.
struct DistantCell {
    uint node_offset;
    vec3 gap;
};

// Cells that wait, at most one for each level: the node's offset, and the bits of the gap.
uvec4 pending[KD_MAX_DEPTH];
uint n_pending = 0u;

// Whether a cell may hold a point that is as close as the best one. A gap is one rounded difference, which is off by a
// share of 2^-24, and its square by 3 * 2^-24. Two sums and the product below make it 6 * 2^-24. Less 2^-20 of it, the
// computed square is below the real one. So the points of a cell that is left out are farther away than the best
// distance as it was computed, and the result is right up to the rounding of distances (search/point_triangle.glsl). A
// leaf has every triangle that comes into its cell (src/accel/bounds.rs).
bool may_be_closer(vec3 gap, float best_squared) {
    const float SHARE = 0.99999905; // 1 - 2^-20
    precise float bound = SHARE * dot_in_order(gap, gap);
    return bound <= best_squared;
}

// The distance from the point to a box on each axis.
vec3 gap_to(Query query, vec3 box_min, vec3 box_max) {
    precise vec3 below = box_min * query.scale - query.position;
    precise vec3 above = query.position - box_max * query.scale;
    return max(max(below, above), vec3(0.0));
}

DistantCell root_of(Query query) {
    return DistantCell(root_offset(), gap_to(query, extent().box_min, extent().box_max));
}

// The children of a split: the one on the point's side of the plane, which is as close as the split's cell, and the
// other one, which is as far away as the plane on its axis.
void split_cell(Query query, KdNode node, DistantCell cell, out DistantCell near, out DistantCell far) {
    precise float to_plane = plane_of(node) * query.scale - along_split(query.position, node);
    uint pair_at = node.axis_and_child & ~((1u << KD_PAIR_SHIFT) - 1u);
    near = DistantCell(to_plane > 0.0 ? pair_at : sibling_of(pair_at), cell.gap);
    far = DistantCell(sibling_of(near.node_offset), cell.gap);
    far.gap[node.axis_and_child & KD_AXIS_MASK] = abs(to_plane);
}

void push_if_closer(DistantCell cell, float best_squared) {
    if (!may_be_closer(cell.gap, best_squared)) return;
    pending[n_pending] = uvec4(cell.node_offset, floatBitsToUint(cell.gap));
    n_pending += 1u;
}

// Takes the last cell that waits. There must be one.
DistantCell pop_pending() {
    n_pending -= 1u;
    return DistantCell(pending[n_pending].x, uintBitsToFloat(pending[n_pending].yzw));
}
