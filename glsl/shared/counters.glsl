// What the kernels count for the profile.
#ifndef KDRAY_COUNTERS
#define KDRAY_COUNTERS

#include "layout.glsl"

layout(std430, set = 0, binding = BIND_COUNTERS) buffer CountersBlock { Counters counters[]; };

void count_hits(uint bounce_ix, bool is_hit) {
    uint n_hits = subgroupAdd(is_hit ? 1u : 0u);
    if (subgroupElect() && n_hits > 0u) atomicAdd(counters[bounce_ix].n_hits, n_hits);
}

void count_shadow_rays(uint bounce_ix, uint n_of_lane) {
    uint n_shadow_rays = subgroupAdd(n_of_lane);
    if (subgroupElect() && n_shadow_rays > 0u) atomicAdd(counters[bounce_ix].n_shadow_rays, n_shadow_rays);
}

#endif
