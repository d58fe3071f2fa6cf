#version 460
#extension GL_GOOGLE_include_directive : require
// Closest point: finds the point of the triangles that is closest to each query point, and at most t_max away. There
// are 2^lanes_log2 invocations per point, the first of which works (rays/lanes.glsl).
// Reads cast_points, the triangles and the kd-tree; updates cast_hits, in which a suspended search leaves its mark
// (search/suspended_rays.glsl).
// Source: Arya and Mount, Algorithms for Fast Vector Quantization, 1993: the search descends to the nearer child first
// and keeps the other one, unless its cell is farther away than the best point. The distance to a cell is the length
// of a vector of which each step down replaces one component. In a world of instances, that is the search through each
// of them that may be closer (instances/closest.glsl).
#include "layout.glsl"

layout(push_constant) uniform CastBatchBlock { CastBatch batch; };

const bool COUNT_COSTS = false;
const bool PREDICATES_BRANCHES = false;
#include "constants.glsl"
#include "scene.glsl"
#include "search/suspended_rays.glsl"
#include "search/steps.glsl"
#include "search/triangle.glsl"
#include "search/magnitude.glsl"
#include "search/traversal_ray.glsl"
#include "search/point_triangle.glsl"
#include "kdtree/kd_nodes.glsl"
#include "kdtree/distant_cells.glsl"
#include "instances/closest.glsl"
#include "rays/lanes.glsl"

layout(constant_id = CONSTANT_SKIPS_HIDDEN) const bool SKIPS_HIDDEN = false;

layout(local_size_x = RAY_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_CAST_POINTS) readonly buffer CastPointsBlock { QueryPoint cast_points[]; };
layout(std430, set = 0, binding = BIND_CAST_HITS) buffer CastHitsBlock { Hit cast_hits[]; };

#include "kdtree/closest.glsl"

// Searches the trees of all instances that may be closer. position: the point in the world.
uint search_instances(Query query, vec3 position, inout Closest best) {
    TopCell at = TopCell(0u, 0u);
    bool is_inside = false;
    if (is_resumed()) {
        SuspendedRay state = suspended_rays[resumed_slot];
        at = TopCell(state.top_node, state.top_pending);
        is_inside = state.node_offset != NO_TRIANGLE;
        resumes = is_inside;
    }
    uint mark = 0u;
    bool goes_on = true;
    while (goes_on) {
        count_iteration();
        if (is_inside || find_closer_instance(query, best.squared, at)) {
            enter_geometry(top_node_at(at.node_ix).link & ~TOP_LEAF);
            outer = OuterSearch(at.node_ix, at.pending, 0.0, 0u);
            mark = search_tree(query, local_query(position, query.scale), best);
            if (mark == 0u) leave_node(at);
        }
        is_inside = false;
        goes_on = mark == 0u && at.node_ix != NO_TRIANGLE;
        if (goes_on && !has_iterations()) {
            outer = OuterSearch(at.node_ix, at.pending, 0.0, 0u);
            mark = suspend_at(LeafVisit(NO_TRIANGLE, 0u, 0u), best);
            goes_on = false;
        }
    }
    return mark;
}

// Searches all triangles. Returns 0, or the mark of a search that was suspended.
uint search(Query query, vec3 position, inout Closest best) {
    if (is_resumed()) best = resumed_best();
    if (INSTANCED) return search_instances(query, position, best);
    return search_tree(query, LocalQuery(query, 1.0, 0.0), best);
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
    Query query = query_at(point.position, accel.box_min, accel.box_max);
    precise float most = point.t_max * query.scale;
    precise float most_squared = most * most;
    Closest best = Closest(most_squared, NO_TRIANGLE, 0.0, 0.0);
    uint mark = search(query, point.position, best);
    if (CAN_SUSPEND && mark != 0u) return Hit(0.0, mark, 0.0, 0.0);
    if (best.triangle_ix == NO_TRIANGLE) return miss();
    return Hit(min(sqrt(best.squared) * inverse_of(query.scale), point.t_max), best.triangle_ix, best.u, best.v);
}

void main() {
    uint point_ix = ray_of_lane(gl_GlobalInvocationID.x, batch.lanes_log2);
    if (point_ix >= batch.n_rays || !runs_in_pass(batch.resume_pass, cast_hits[point_ix].triangle_ix)) return;
    QueryPoint point = cast_points[point_ix];
    cast_hits[point_ix] = is_point(point) && accel.n_triangles > 0u ? find_closest(point) : miss();
}
