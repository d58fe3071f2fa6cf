#version 460
#extension GL_GOOGLE_include_directive : require
// Closest point: finds the point of the triangles that is closest to each query point, and at most t_max away. There
// are 2^lanes_log2 invocations per point, the first of which works (rays/lanes.glsl).
// Reads cast_points, the triangles and the kd-tree; updates cast_hits, in which a suspended search leaves its mark
// (search/suspended_rays.glsl).
// Source: Arya and Mount, Algorithms for Fast Vector Quantization, 1993: the search descends to the nearer child first
// and keeps the other one, unless its cell is farther away than the best point. The distance to a cell is the length
// of a vector of which each step down replaces one component.
#include "layout.glsl"

const bool COUNT_COSTS = false;
const bool PREDICATES_BRANCHES = false;
#include "scene.glsl"
#include "search/suspended_rays.glsl"
#include "search/steps.glsl"
#include "search/triangle.glsl"
#include "search/magnitude.glsl"
#include "search/traversal_ray.glsl"
#include "search/point_triangle.glsl"
#include "kdtree/kd_nodes.glsl"
#include "kdtree/distant_cells.glsl"
#include "rays/lanes.glsl"
#include "constants.glsl"

layout(constant_id = CONSTANT_SKIPS_HIDDEN) const bool SKIPS_HIDDEN = false;

layout(local_size_x = RAY_GROUP_SIZE) in;
layout(push_constant) uniform CastBatchBlock { CastBatch batch; };
layout(std430, set = 0, binding = BIND_CAST_POINTS) readonly buffer CastPointsBlock { QueryPoint cast_points[]; };
layout(std430, set = 0, binding = BIND_CAST_HITS) buffer CastHitsBlock { Hit cast_hits[]; };

// A leaf and those of its entries that are still to be tested.
struct LeafVisit {
    uint node_offset;
    uint entry_ix;
    uint end_ix;
};

// The closest point so far: the square of its distance, its triangle and its weights.
struct Closest {
    float squared;
    uint triangle_ix;
    float u;
    float v;
};

// Descends to the leaf of a cell that is closest to the point.
LeafVisit descend(Query query, float best_squared, DistantCell cell) {
    KdNode node = kd_node(cell.node_offset);
    while (!is_leaf(node)) {
        DistantCell near, far;
        split_cell(query, node, cell, near, far);
        push_if_closer(far, best_squared);
        cell = near;
        node = kd_node(cell.node_offset);
    }
    uint n_entries = node.axis_and_child >> KD_PAIR_SHIFT;
    return LeafVisit(cell.node_offset, node.split_or_first, node.split_or_first + n_entries);
}

// Tests a triangle of a leaf. Of two that are equally close, the one of the lower index counts.
void test_entry(Query query, uint entry_ix, inout Closest best) {
    LeafTriangle entry = leaf_triangle_at(entry_ix);
    if (SKIPS_HIDDEN && (load_triangle_materials(entry.triangle_ix) & TRIANGLE_HIDDEN) != 0u) return;
    precise vec3 a = entry.v0 * query.scale - query.position;
    precise vec3 b = entry.v1 * query.scale - query.position;
    precise vec3 c = entry.v2 * query.scale - query.position;
    PointOnTriangle at = closest_on_triangle(a, b, c);
    bool is_first = at.squared == best.squared && entry.triangle_ix < best.triangle_ix;
    if (at.squared < best.squared || is_first) best = Closest(at.squared, entry.triangle_ix, at.u, at.v);
}

#include "kdtree/resume_closest.glsl"

// Searches the tree. Returns 0, or the mark of a search that was suspended.
uint search(Query query, inout Closest best) {
    LeafVisit leaf = LeafVisit(root_offset(), 0u, 0u); // nothing to test before the first descent
    if (is_resumed()) leaf = resume(query, best);
    else push_if_closer(root_of(query), best.squared);
    uint mark = 0u;
    bool goes_on = true;
    while (goes_on) {
        count_iteration();
        if (leaf.entry_ix < leaf.end_ix) {
            test_entry(query, leaf.entry_ix, best);
            leaf.entry_ix += 1u;
        } else if (n_pending > 0u) {
            DistantCell cell = pop_pending();
            if (may_be_closer(cell.gap, best.squared)) leaf = descend(query, best.squared, cell);
        } else {
            goes_on = false;
        }
        if (goes_on && !has_iterations()) {
            mark = suspend_at(leaf, best);
            goes_on = false;
        }
    }
    return mark;
}

Hit miss() {
    return Hit(INFINITY, NO_TRIANGLE, 0.0, 0.0);
}

// Whether a point can have a closest point: its position is finite, and its greatest distance a number from 0 on.
bool is_point(QueryPoint point) {
    const uint INFINITY_BITS = 0x7f800000u;
    return longest_bits(point.position) < INFINITY_BITS && magnitude_bits(point.t_max) <= INFINITY_BITS
        && point.t_max >= 0.0;
}

Hit find_closest(QueryPoint point) {
    uint bits = max(longest_bits(point.position), max(longest_bits(accel.box_min), longest_bits(accel.box_max)));
    uint exponent = clamp(bits >> 23, 1u, 253u);
    float scale = uintBitsToFloat((254u - exponent) << 23); // 2^(127 - exponent)
    float inv_scale = uintBitsToFloat(exponent << 23);
    precise vec3 position = point.position * scale;
    precise float most = point.t_max * scale;
    precise float most_squared = most * most;
    Closest best = Closest(most_squared, NO_TRIANGLE, 0.0, 0.0);
    uint mark = search(Query(position, scale), best);
    if (CAN_SUSPEND && mark != 0u) return Hit(0.0, mark, 0.0, 0.0);
    if (best.triangle_ix == NO_TRIANGLE) return miss();
    return Hit(min(sqrt(best.squared) * inv_scale, point.t_max), best.triangle_ix, best.u, best.v);
}

void main() {
    uint point_ix = ray_of_lane(gl_GlobalInvocationID.x, batch.lanes_log2);
    if (point_ix >= batch.n_rays || !runs_in_pass(batch.resume_pass, cast_hits[point_ix].triangle_ix)) return;
    QueryPoint point = cast_points[point_ix];
    cast_hits[point_ix] = is_point(point) && accel.n_triangles > 0u ? find_closest(point) : miss();
}
