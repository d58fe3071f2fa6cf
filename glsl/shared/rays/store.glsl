// Stores of rays and hits, by whole vectors. Some drivers store a struct member by member, and a ray that is written
// in nine pieces takes three times as long (docs/experiments.md).
#ifndef KDRAY_STORE
#define KDRAY_STORE

#include "layout.glsl"

layout(std430, set = 0, binding = BIND_RAYS) writeonly buffer StoredRaysBlock { uvec4 stored_rays[]; };
layout(std430, set = 0, binding = BIND_HITS) writeonly buffer StoredHitsBlock { uvec4 stored_hits[]; };

uvec4 words_of(vec3 v, uint w) {
    return uvec4(floatBitsToUint(v), w);
}

uvec4 words_of(Hit hit) {
    return uvec4(floatBitsToUint(hit.t), hit.triangle_ix, floatBitsToUint(vec2(hit.u, hit.v)));
}

void store_ray(uint ray_ix, PathRay ray) {
    stored_rays[3u * ray_ix] = words_of(ray.origin, ray.pixel_ix);
    stored_rays[3u * ray_ix + 1u] = words_of(ray.direction, ray.source_triangle);
    stored_rays[3u * ray_ix + 2u] = words_of(ray.throughput, floatBitsToUint(ray.t_max));
}

void store_hit(uint ray_ix, Hit hit) {
    stored_hits[ray_ix] = words_of(hit);
}

#endif
