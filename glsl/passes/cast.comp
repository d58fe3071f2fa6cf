#version 460
#extension GL_GOOGLE_include_directive : require
// Cast: finds each ray's closest hit in (t_min, t_max], or with ANY_HIT one that need not be the closest. There are
// 2^lanes_log2 invocations per ray, the first of which works (rays/lanes.glsl).
// Reads cast_rays and the acceleration structure; updates cast_hits, in which a suspended ray leaves its mark
// (search/suspended_rays.glsl).
#include "layout.glsl"

layout(push_constant) uniform CastBatchBlock { CastBatch batch; };
#define MASK_OF_CAST batch.mask

const bool COUNT_COSTS = false;
const bool TESTS_BLENDED = false;
const bool FROM_CAMERA = false;
#include "search/accel.glsl"
#include "rays/cast_rays.glsl"
#include "rays/lanes.glsl"

layout(constant_id = CONSTANT_ANY_HIT) const bool ANY_HIT = false;

layout(local_size_x = RAY_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_CAST_RAYS) readonly buffer CastRaysBlock { Ray cast_rays[]; };
layout(std430, set = 0, binding = BIND_CAST_HITS) buffer CastHitsBlock { Hit cast_hits[]; };

// The result of a ray that hits nothing.
Hit miss() {
    return Hit(uintBitsToFloat(INFINITY_BITS), NO_TRIANGLE, 0.0, 0.0);
}

// Finds the hit of a valid ray.
Hit cast_ray(Ray ray) {
    Hit hit = traverse_any_length(bounded_ray(ray), ray.t_min, ANY_HIT);
    if (hit.triangle_ix == NO_TRIANGLE) return miss();
    return hit;
}

void main() {
    uint ray_ix = ray_of_lane(gl_GlobalInvocationID.x, batch.lanes_log2);
    if (ray_ix >= batch.n_rays || !runs_in_pass(batch.resume_pass, cast_hits[ray_ix].triangle_ix)) return;
    Ray ray = cast_rays[ray_ix];
    cast_hits[ray_ix] = is_ray(ray) ? cast_ray(ray) : miss();
}
