// The acceleration structure: from a ray to its hit. All that a kernel calls is `traverse`, or for a direction of any length
// `traverse_any_length`.
//
//   traversal_ray.glsl   the ray, cut to the structure's box
//   kdtree.glsl          the search through a kd-tree
//   grid.glsl            the search through a grid
//   candidate.glsl       triangles that the search comes to, against the nearest hit so far
//   local_memory.glsl    what is kept out of registers meanwhile
#ifndef KDRAY_ACCEL
#define KDRAY_ACCEL

#include "layout.glsl"
#include "scene.glsl"
#include "stalls.glsl"
#include "steps.glsl"
#include "triangle.glsl"

// Whether the device runs both sides of a branch for all lanes, as software drivers do: lockstep.glsl.
layout(constant_id = CONSTANT_PREDICATES_BRANCHES) const bool PREDICATES_BRANCHES = false;

#include "traversal_ray.glsl"
#include "local_memory.glsl"
#include "candidate.glsl"
#include "kdtree.glsl"
#include "grid.glsl"

// The search through whichever structure the scene has. Returns 0, or the mark of a ray that has stalled.
uint search(TraversalRay ray, bool any_hit, inout Nearest best) {
    if (GRID_LEVELS == 0u) return search_kdtree(ray, any_hit, best);
    return search_grid(ray, any_hit, best);
}

// The closest hit in (t_min, t_max], or with any_hit one that need not be the closest. The direction has about unit length. A
// miss keeps t = t_max. If the ray has stalled, the hit's triangle_ix is its mark.
Hit traverse(PathRay ray_in, float t_min, bool any_hit) {
    float t_start;
    PathRay ray_near = near_scene(ray_in, t_start);
    TraversalRay ray = traversal_ray(ray_near, t_min - t_start);
    spill_pair(LENGTHS_SLOT, t_start, ray_in.t_max);
    Nearest best = Nearest(0.5 * ray_near.t_max, NO_TRIANGLE);
    uint mark = search(ray, any_hit, best);
    if (CAN_STALL && mark != 0u) return Hit(0.0, mark, 0.0, 0.0);
    vec2 lengths = spilled_pair(LENGTHS_SLOT);
    if (best.triangle_ix == NO_TRIANGLE) return Hit(lengths.y, NO_TRIANGLE, 0.0, 0.0);
    vec2 weights = spilled_pair(WEIGHTS_SLOT);
    return Hit(2.0 * best.t + lengths.x, best.triangle_ix, weights.x, weights.y);
}

// Magnitudes by bits, which keep their order: a device may flush a denormal, and need not know a NaN from a number.
uint magnitude_bits(float x) {
    return floatBitsToUint(x) & 0x7fffffffu;
}

uint longest_bits(vec3 v) {
    return max(max(magnitude_bits(v.x), magnitude_bits(v.y)), magnitude_bits(v.z));
}

// The longest component's exponent as the bits hold it, 1..254; 0: all but zero, 255: infinite or NaN.
uint exponent_of(vec3 direction) {
    return longest_bits(direction) >> 23;
}

// Does what `traverse` does for a ray whose direction has any length, such as one that a transform has taken to the space of an
// instance: t is in units of the direction. The exponent of the direction's longest component must be 1 to 254.
//
// The direction is scaled by a power of two, by which it and t keep their bits.
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
