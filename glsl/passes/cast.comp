#version 460
#extension GL_GOOGLE_include_directive : require
// Cast: finds each ray's closest hit in (t_min, t_max], or with ANY_HIT one that need not be the closest. There are
// 2^lanes_log2 invocations per ray, the first of which works (rays/lanes.glsl).
// Reads cast_rays and the acceleration structure; updates cast_hits, in which a suspended ray leaves its mark
// (search/suspended_rays.glsl). Streams may have bare rays and bare hits in place of these.
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
layout(std430, set = 0, binding = BIND_CAST_RAYS) readonly buffer BareRaysBlock { vec2 bare_rays[]; }; // three a ray
layout(std430, set = 0, binding = BIND_CAST_HITS) buffer CastHitsBlock { Hit cast_hits[]; };
layout(std430, set = 0, binding = BIND_CAST_HITS) buffer BareHitsBlock { uint bare_hits[]; }; // the bits of t

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

Ray load_ray(uint ray_ix) {
    if (batch.bare_rays == 0u) return cast_rays[ray_ix];
    vec2 xy = bare_rays[3u * ray_ix];
    vec2 zx = bare_rays[3u * ray_ix + 1u];
    vec2 yz = bare_rays[3u * ray_ix + 2u];
    return Ray(vec3(xy, zx.x), 0.0, vec3(zx.y, yz), uintBitsToFloat(INFINITY_BITS));
}

// The mark of the ray, if it was suspended.
uint mark_of(uint ray_ix) {
    return batch.bare_hits == 0u ? cast_hits[ray_ix].triangle_ix : bare_hits[ray_ix];
}

void store_hit(uint ray_ix, Hit hit) {
    if (batch.bare_hits == 0u) {
        cast_hits[ray_ix] = hit;
    } else {
        bare_hits[ray_ix] = is_suspended(hit.triangle_ix) ? hit.triangle_ix : floatBitsToUint(hit.t);
    }
}

void main() {
    uint ray_ix = ray_of_lane(gl_GlobalInvocationID.x, batch.lanes_log2);
    if (ray_ix >= batch.n_rays) return;
    if (batch.resume_pass != PASS_BEGIN && !runs_in_pass(batch.resume_pass, mark_of(ray_ix))) return;
    Ray ray = load_ray(ray_ix);
    store_hit(ray_ix, is_ray(ray) ? cast_ray(ray) : miss());
}
