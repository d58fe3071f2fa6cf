// The acceleration structure: finds the hit of a ray.
//
// Needs the macros TRAVERSAL and, for scenes with alpha-tested materials, WITH_ALPHA_TEST (build.rs); and the constants
// `bool COUNT_COSTS` (steps.glsl) and `bool TESTS_BLENDED` (shading/alpha_test.glsl), which the kernel declares before
// this file. Provides `traverse`, and `traverse_any_length` for directions of any length, which are all that a kernel
// calls to find a hit. Kernels also use `is_suspended` and `runs_in_pass` of suspended_rays.glsl. cast.comp checks its
// rays by `exponent_of`, `longest_bits` and `magnitude_bits`.
//
//   traversal_ray.glsl   the ray, clipped to the structure's box
//   kdtree/kdtree.glsl   the search through a kd-tree
//   grid/grid.glsl       the search through a grid
//   candidate.glsl       the test of a triangle that the search comes to, against the nearest hit so far
//   local_memory.glsl    values that are kept out of registers during the search
#ifndef KDRAY_ACCEL
#define KDRAY_ACCEL

#include "layout.glsl"
#include "scene.glsl"
#include "search/suspended_rays.glsl"
#include "search/steps.glsl"
#include "search/triangle.glsl"

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

// Returns the closest hit in (t_min, t_max], or with any_hit one that need not be the closest. The direction has
// about unit length. A miss has t = t_max. If the ray was suspended, the hit's triangle_ix is its mark. During the
// search, all t are half of the ray's own (traversal_ray.glsl).
Hit traverse(PathRay ray_in, float t_min, bool any_hit) {
    float t_start;
    PathRay ray_near = near_scene(ray_in, t_min, t_start);
    TraversalRay ray = traversal_ray(ray_near, t_min);
    spill_pair(LENGTHS_SLOT, t_start, ray_in.t_max);
    Nearest best = Nearest(0.5 * ray_near.t_max, NO_TRIANGLE);
    uint mark = search(ray, any_hit, best);
    if (CAN_SUSPEND && mark != 0u) return Hit(0.0, mark, 0.0, 0.0);
    vec2 lengths = spilled_pair(LENGTHS_SLOT);
    if (best.triangle_ix == NO_TRIANGLE) return Hit(lengths.y, NO_TRIANGLE, 0.0, 0.0);
    vec2 weights = spilled_pair(WEIGHTS_SLOT);
    // The sum could round to more than t_max.
    return Hit(min(2.0 * best.t + lengths.x, lengths.y), best.triangle_ix, weights.x, weights.y);
}

// The bits of a magnitude, which have the order of the magnitudes. Integers are used since a device may flush
// denormals and need not tell a NaN from a number.
uint magnitude_bits(float x) {
    return floatBitsToUint(x) & 0x7fffffffu;
}

uint longest_bits(vec3 v) {
    return max(max(magnitude_bits(v.x), magnitude_bits(v.y)), magnitude_bits(v.z));
}

// The biased exponent of the component of largest magnitude, 1..254. It is 0 if that component is zero or denormal,
// and 255 if it is infinite or NaN.
uint exponent_of(vec3 direction) {
    return longest_bits(direction) >> 23;
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
