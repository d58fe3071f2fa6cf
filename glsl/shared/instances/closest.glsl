// The search for closest points through a world of instances. It goes through the hierarchy over the instances
// depth-first, to the nearer child first. In each leaf, it goes through the geometry's kd-tree, for the query point in
// the geometry's space. Triangles are tested in the world, as in a flattened scene. Twin of
// src/reference/closest_instances.rs. A part of closest_point.comp.
//
// A cell is left out if it is farther away than the best point may be in the geometry's space. With N, the inverse
// linear map, that is |N| times the best distance. The square of |N| is at most the largest sum of magnitudes of a row
// of N N^T. Of a scale before a rotation, this matrix is diagonal, and the bound is exact.
//
// Rounding, with u = 2^-24: the query point p is at N (p - c), of which each coefficient and each difference is rounded
// once, and each product and sum 4 times. So a component is off by 6 u of the sum of its magnitudes. In the same way, a
// component of a corner in the world is off by 6 u of the sum of its own. Both are covered by 8 u of the sums of all
// components (`slack`). A share of 2^-19 of |N| covers its own rounding and that of `limit_of`.
//
// Needs `batch`, constants.glsl, scene.glsl, search/suspended_rays.glsl, search/traversal_ray.glsl,
// search/magnitude.glsl and kdtree/distant_cells.glsl. Provides `LocalQuery`, `local_query`, `limit_of` and
// `find_closer_instance`, and what top_nodes.glsl does.

#include "instances/top_nodes.glsl"

// The query point in the space of a geometry. A distance d from the point in the world is at most factor * d + slack
// there, in units of both queries.
struct LocalQuery {
    Query query;
    float factor;
    float slack;
};

float component_sum(vec3 v) {
    return v.x + v.y + v.z;
}

// The largest sum of magnitudes of a row of N N^T, whose rows are x, y, z.
float norm_squared(vec3 x, vec3 y, vec3 z) {
    float xy = abs(dot_in_order(x, y)), yz = abs(dot_in_order(y, z)), zx = abs(dot_in_order(z, x));
    float of_x = dot_in_order(x, x) + xy + zx;
    float of_y = dot_in_order(y, y) + xy + yz;
    float of_z = dot_in_order(z, z) + yz + zx;
    return max(of_x, max(of_y, of_z));
}

// The query point in the space of the entered geometry.
LocalQuery local_query(vec3 position, float world_scale) {
    const float ROUNDING = 4.7683716e-7; // 2^-21
    uint ix = placed.instance_ix;
    vec3 x = instance_row(ix, 4u).xyz, y = instance_row(ix, 5u).xyz, z = instance_row(ix, 6u).xyz;
    vec3 translation = instance_row(ix, 3u).xyz;
    precise vec3 offset = position - translation;
    vec3 local = local_vector(ix, offset);
    bool is_finite = longest_bits(local) < 0x7f800000u;
    if (!is_finite) local = vec3(0.0);
    float norm = sqrt(norm_squared(x, y, z));
    vec3 reach = max(abs(extent().box_min), abs(extent().box_max));
    float of_corners = component_sum(abs(translation)) + reach.x * component_sum(abs(instance_row(ix, 0u).xyz))
        + reach.y * component_sum(abs(instance_row(ix, 1u).xyz))
        + reach.z * component_sum(abs(instance_row(ix, 2u).xyz));
    float of_point = component_sum((abs(x) + abs(y) + abs(z)) * abs(offset));
    Query query = query_at(local, extent().box_min, extent().box_max);
    float slack = ROUNDING * (norm * of_corners + of_point) * query.scale;
    float factor = norm * (1.0 + 4.0 * ROUNDING) * inverse_of(world_scale) * query.scale;
    return LocalQuery(query, factor, is_finite ? slack : INFINITY);
}

// The square of the distance in the geometry beyond which no point is as close as the best one.
float limit_of(LocalQuery local, float best_squared) {
    float d = sqrt(min(best_squared, 3.0e38)) * local.factor + local.slack;
    return d * d;
}

// Goes down to the nearer child of a pair. The other one waits.
void enter_nearer(Query query, uint pair, inout TopCell at) {
    TopNode first = top_node_at(2u * pair), second = top_node_at(2u * pair + 1u);
    vec3 to_first = gap_to(query, first.box_min, first.box_max);
    vec3 to_second = gap_to(query, second.box_min, second.box_max);
    bool is_second = dot_in_order(to_second, to_second) < dot_in_order(to_first, to_first);
    at.node_ix = 2u * pair + (is_second ? 1u : 0u);
    at.pending = (at.pending << 1) | 1u;
}

// Goes on to the next instance that may have a point as close as the best one, of those that the search's mask meets.
// Returns false if none is left, or if the invocation's loop iterations are spent.
bool find_closer_instance(Query query, float best_squared, inout TopCell at) {
    bool found = false;
    bool looks = at.node_ix != NO_TRIANGLE && has_iterations();
    while (looks) {
        count_iteration();
        TopNode node = top_node_at(at.node_ix);
        bool may_be = may_be_closer(gap_to(query, node.box_min, node.box_max), best_squared);
        if (may_be && (node.link & TOP_LEAF) == 0u) {
            enter_nearer(query, node.link, at);
        } else {
            uint instance_ix = may_be ? node.link & ~TOP_LEAF : 0u;
            found = may_be && (floatBitsToUint(instance_row(instance_ix, 4u).w) & batch.mask) != 0u;
            if (!found) leave_node(at);
        }
        looks = !found && at.node_ix != NO_TRIANGLE && has_iterations();
        if (!looks) break;
    }
    return found;
}
