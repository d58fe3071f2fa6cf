// The acceleration structure: finds the hit of a ray.
//
// Needs the macros TRAVERSAL and, for rays that pass through parts of triangles or back faces, WITH_ALPHA_TEST, and in
// worlds of instances WITH_INSTANCES (build.rs); and the constants `bool COUNT_COSTS` (steps.glsl), `bool
// TESTS_BLENDED` (shading/alpha_test.glsl) and `bool FROM_CAMERA` (shading/back_faces.glsl), which the kernel declares
// before this file. With the macro NEXT_HITS, which all_hits.comp defines, only hits behind `last_hit` count, which
// each search sets to the hit that it finds (candidate.glsl), and in a world of instances, a search ends at the first
// instance with such a hit (`next_cell`). Provides `traverse`, and `traverse_any_length` for
// directions of any length, which are all that a kernel calls to find a hit. Kernels also use `is_suspended` and
// `runs_in_pass` of suspended_rays.glsl. rays/cast_rays.glsl checks rays by `exponent_of`, `longest_bits` and
// `magnitude_bits`.
//
//   magnitude.glsl       magnitudes of floats as integers
//   traversal_ray.glsl   the ray, clipped to the structure's box
//   kdtree/kdtree.glsl   the search through a kd-tree
//   grid/grid.glsl       the search through a grid
//   candidate.glsl       the test of a triangle that the search comes to, against the nearest hit so far
//   instances/hierarchy.glsl   from instance to instance, in each of which one of these searches
//   local_memory.glsl    values that are kept out of registers during the search
#ifndef KDRAY_ACCEL
#define KDRAY_ACCEL

#include "layout.glsl"
#include "scene.glsl"
#include "search/suspended_rays.glsl"
#include "search/steps.glsl"
#include "search/triangle.glsl"
#include "search/magnitude.glsl"

// Whether the device runs both sides of a branch for all lanes, as software drivers do (kdtree/lockstep.glsl).
layout(constant_id = CONSTANT_PREDICATES_BRANCHES) const bool PREDICATES_BRANCHES = false;

#include "search/traversal_ray.glsl"
#include "search/local_memory.glsl"
#include "search/candidate.glsl"
#include "kdtree/kdtree.glsl"
#include "grid/grid.glsl"

// Searches the structure that the scene has. Returns 0, or the mark of a ray that was suspended (suspended_rays.glsl).
uint search(TraversalRay ray, bool any_hit, inout Nearest best) {
    if (TRAVERSAL == TRAVERSAL_GRID) return search_grid(ray, any_hit, best);
    return search_kdtree(ray, any_hit, best);
}

#include "instances/hierarchy.glsl"

#ifdef NEXT_HITS
// The place in the hierarchy from which the search goes on: the instance of the last hit, or without one a place from
// which instances are still to be visited.
TopCell next_cell = TopCell(0u, 0u);
#endif

// Stores the state of a ray that is in no instance, and returns the mark for its result.
uint suspend_between(Nearest best) {
    vec2 weights = spilled_pair(WEIGHTS_SLOT);
    return suspend(SuspendedRay(
        NO_TRIANGLE, 0.0, 0.0, 0u, 0u, 0.0, NO_TRIANGLE, weights.x, weights.y, steps_so_far(), uvec2(0u),
        outer.top_node, outer.top_pending, best.t, best.triangle_ix
    ));
}

// Loads the stored state of the search through the instances. Returns whether the ray is in one of them, whose state is
// loaded later.
bool resume_outer(out TopCell at, out Nearest best) {
    SuspendedRay state = suspended_rays[resumed_slot];
    at = TopCell(state.top_node, state.top_pending);
    best = Nearest(state.t_outer, state.outer_triangle);
    bool is_inside = state.node_offset != NO_TRIANGLE;
    if (!is_inside) {
        spill_pair(WEIGHTS_SLOT, state.u, state.v);
        count_steps(state.n_steps);
        resumes = false;
    }
    return is_inside;
}

// What the search through the instances needs between two of them is in local memory while a ray is in one.
void spill_world_ray(PathRay ray) {
    spill_pair(WORLD_RAY_SLOT, ray.origin.x, ray.origin.y);
    spill_pair(WORLD_RAY_SLOT + 1u, ray.origin.z, ray.direction.x);
    spill_pair(WORLD_RAY_SLOT + 2u, ray.direction.y, ray.direction.z);
    spill_pair(LENGTHS_SLOT, 0.0, ray.t_max);
}

PathRay spilled_world_ray(PathRay ray) {
    vec2 a = spilled_pair(WORLD_RAY_SLOT), b = spilled_pair(WORLD_RAY_SLOT + 1u), c = spilled_pair(WORLD_RAY_SLOT + 2u);
    ray.origin = vec3(a, b.x);
    ray.direction = vec3(b.y, c);
    return ray;
}

void spill_top(TopCell at, float t_best, float inv_scale) {
    spill_words(TOP_CELL_SLOT, uvec2(at.node_ix, at.pending));
    spill_pair(TOP_LENGTHS_SLOT, t_best, inv_scale);
}

void load_spilled_top(out TopCell at, out float t_best, out float inv_scale) {
    uvec2 cell = spilled_words(TOP_CELL_SLOT);
    at = TopCell(cell.x, cell.y);
    vec2 lengths = spilled_pair(TOP_LENGTHS_SLOT);
    t_best = lengths.x;
    inv_scale = lengths.y;
}

// Returns the closest hit in (t_min, t_max], or with any_hit one that need not be the closest. The direction has
// about unit length. A miss has t = t_max. If the ray was suspended, the hit's triangle_ix is its mark. During the
// search, all t are half of the ray's own (traversal_ray.glsl). Without INSTANCED, the loop has one turn; with it, one
// for each instance that the ray comes to.
Hit traverse(PathRay ray_in, float t_min, bool any_hit) {
    Nearest best = Nearest(0.5 * ray_in.t_max, NO_TRIANGLE);
    TopCell at = TopCell(0u, 0u);
    bool is_inside = false;
    if (INSTANCED) {
#ifdef NEXT_HITS
        at = next_cell;
        is_inside = last_hit.triangle_ix != NO_TRIANGLE;
#endif
        if (is_resumed()) is_inside = resume_outer(at, best);
        spill_world_ray(ray_in);
    }
    uint mark = 0u;
    bool goes_on = true;
    while (goes_on) {
        PathRay ray = ray_in;
        float least_t = t_min;
        float inv_scale = 1.0;
        bool searches = true;
        if (INSTANCED) {
            count_iteration();
            ray = spilled_world_ray(ray_in);
            uint instance_ix = 0u;
            if (is_inside) instance_ix = top_node_at(at.node_ix).link & ~TOP_LEAF;
            else searches = find_instance(top_ray(ray, t_min), best.t, kind_of_rays(any_hit), at, instance_ix);
            is_inside = false;
            ray = in_geometry(instance_ix, ray, inv_scale);
            ray.t_max = 2.0 * best.t * inv_scale;
            least_t = t_min * inv_scale;
            outer = OuterSearch(at.node_ix, at.pending, best.t, best.triangle_ix);
        }
        float t_start;
        PathRay ray_near = near_scene(ray, least_t, t_start);
#ifdef NEXT_HITS
        // The origin is moved as in the search for the last hit, so each t has the same bits.
        if (last_hit.triangle_ix != NO_TRIANGLE) least_t = last_hit.t;
#endif
        TraversalRay prepared = traversal_ray(ray_near, least_t);
        spill_pair(LENGTHS_SLOT, t_start, INSTANCED ? spilled_pair(LENGTHS_SLOT).y : ray_in.t_max);
        Nearest found = Nearest(0.5 * ray_near.t_max, best.triangle_ix);
        if (INSTANCED) spill_top(at, best.t, inv_scale);
        if (searches) mark = search(prepared, any_hit, found);
        goes_on = false;
        if (INSTANCED) {
            load_spilled_top(at, best.t, inv_scale);
            t_start = spilled_pair(LENGTHS_SLOT).x;
            if (found.triangle_ix != best.triangle_ix && mark == 0u) {
                // The reciprocal of a power of two.
                float scale = uintBitsToFloat(0x7f000000u - floatBitsToUint(inv_scale));
                best = Nearest(min((found.t + 0.5 * t_start) * scale, best.t), found.triangle_ix);
            }
#ifdef NEXT_HITS
            if (best.triangle_ix != NO_TRIANGLE) {
                last_hit = Nearest(2.0 * found.t, best.triangle_ix);
                break;
            }
            if (mark == 0u) last_hit = Nearest(0.0, NO_TRIANGLE);
#endif
            if (searches && mark == 0u) leave_node(at);
            goes_on = mark == 0u && at.node_ix != NO_TRIANGLE && !is_done(any_hit, best);
            if (goes_on && !has_iterations()) {
                outer = OuterSearch(at.node_ix, at.pending, best.t, best.triangle_ix);
                mark = suspend_between(best);
                goes_on = false;
            }
        } else {
            best = found;
        }
        if (!goes_on) break;
    }
#ifdef NEXT_HITS
    if (INSTANCED) next_cell = at;
#endif
    if (CAN_SUSPEND && mark != 0u) return Hit(0.0, mark, 0.0, 0.0);
    vec2 lengths = spilled_pair(LENGTHS_SLOT);
    if (INSTANCED) lengths.x = 0.0;
    if (best.triangle_ix == NO_TRIANGLE) return Hit(lengths.y, NO_TRIANGLE, 0.0, 0.0);
    vec2 weights = spilled_pair(WEIGHTS_SLOT);
#ifdef NEXT_HITS
    if (!INSTANCED) last_hit = Nearest(2.0 * best.t, best.triangle_ix);
#endif
    // The sum could round to more than t_max.
    return Hit(min(2.0 * best.t + lengths.x, lengths.y), best.triangle_ix, weights.x, weights.y);
}

// Does what `traverse` does, for a ray whose direction has any length, such as a ray that was transformed to the
// space of an instance. t is in units of the direction. `exponent_of` the direction must be 1..254.
//
// The direction and t are scaled by a power of two, which loses none of their bits unless they underflow. For
// exponent 254, the power would be denormal, so the power for 253 is used.
Hit traverse_any_length(PathRay ray, float t_min, bool any_hit) {
    uint exponent = min(exponent_of(ray.direction), 253u);
    float scale = uintBitsToFloat((254u - exponent) << 23); // 2^(127 - exponent)
    float inv_scale = uintBitsToFloat(exponent << 23);
    ray.direction *= scale;
    ray.t_max *= inv_scale;
    Hit hit = traverse(ray, t_min * inv_scale, any_hit);
    hit.t *= scale;
    return hit;
}

#endif
