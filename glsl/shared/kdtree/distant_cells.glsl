// Cells of the kd-tree with their distance from a point, for closest_point.comp. Twin: src/reference/distant_cells.rs.
//
// Needs scene.glsl, search/point_triangle.glsl and kd_nodes.glsl. Provides `Query`, `DistantCell`, `root_of`,
// `may_be_closer`, `split_cell`, and the cells that wait: `push_if_closer` and `pop_pending`.

// The point in units of 1 / scale, a power of two that brings all coordinates below 4: squares do not overflow.
struct Query {
    vec3 position;
    float scale;
};

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

DistantCell root_of(Query query) {
    precise vec3 below = accel.box_min * query.scale - query.position;
    precise vec3 above = query.position - accel.box_max * query.scale;
    return DistantCell(root_offset(), max(max(below, above), vec3(0.0)));
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
