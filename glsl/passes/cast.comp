#version 460
#extension GL_GOOGLE_include_directive : require
// Cast: finds each ray's closest hit in (t_min, t_max], or with ANY_HIT one that need not be the closest. There are
// 2^lanes_log2 invocations per ray, the first of which works (rays/lanes.glsl).
// Reads cast_rays and the acceleration structure; updates cast_hits, in which a suspended ray leaves its mark
// (search/suspended_rays.glsl).
#include "layout.glsl"

const bool COUNT_COSTS = false;
const bool TESTS_BLENDED = false;
const bool FROM_CAMERA = false;
#include "search/accel.glsl"
#include "rays/lanes.glsl"

layout(constant_id = CONSTANT_ANY_HIT) const bool ANY_HIT = false;

layout(local_size_x = RAY_GROUP_SIZE) in;
layout(push_constant) uniform CastBatchBlock { CastBatch batch; };
layout(std430, set = 0, binding = BIND_CAST_RAYS) readonly buffer CastRaysBlock { Ray cast_rays[]; };
layout(std430, set = 0, binding = BIND_CAST_HITS) buffer CastHitsBlock { Hit cast_hits[]; };

const uint INFINITY_BITS = 0x7f800000u;
const float GREATEST = 3.40282347e38;

// The result of a ray that hits nothing.
Hit miss() {
    return Hit(uintBitsToFloat(INFINITY_BITS), NO_TRIANGLE, 0.0, 0.0);
}

// Whether a ray can hit anything: it has no NaN, a finite origin, and a direction that is finite and neither zero nor
// denormal.
bool is_ray(Ray ray) {
    uint exponent = exponent_of(ray.direction);
    return exponent > 0u && exponent < 255u && longest_bits(ray.origin) < INFINITY_BITS
        && magnitude_bits(ray.t_min) <= INFINITY_BITS && magnitude_bits(ray.t_max) <= INFINITY_BITS;
}

// Finds the hit of a valid ray. Clamps t_max to the greatest finite number, so a hit with an infinite t is a miss.
Hit cast_ray(Ray ray) {
    PathRay bounded = PathRay(ray.origin, 0u, ray.direction, NO_TRIANGLE, vec3(0.0), min(ray.t_max, GREATEST));
    Hit hit = traverse_any_length(bounded, ray.t_min, ANY_HIT);
    if (hit.triangle_ix == NO_TRIANGLE) return miss();
    return hit;
}

void main() {
    uint ray_ix = ray_of_lane(gl_GlobalInvocationID.x, batch.lanes_log2);
    if (ray_ix >= batch.n_rays || !runs_in_pass(batch.resume_pass, cast_hits[ray_ix].triangle_ix)) return;
    Ray ray = cast_rays[ray_ix];
    cast_hits[ray_ix] = is_ray(ray) ? cast_ray(ray) : miss();
}
