// What the kernels count for the profile.
#ifndef KDRAY_COUNTERS
#define KDRAY_COUNTERS

#include "layout.glsl"

layout(std430, set = 0, binding = BIND_COUNTERS) buffer CountersBlock { Counters counters[]; };

uint counters_of(uint bounce_ix, uint place) {
    return (bounce_ix * COUNTER_PLACES + place % COUNTER_PLACES) * COUNTER_STRIDE;
}

// place: the same for a workgroup, and others for its neighbours, if they all come at once.
void count_hits(uint bounce_ix, uint place, bool is_hit) {
    uint n_hits = subgroupAdd(is_hit ? 1u : 0u);
    if (subgroupElect() && n_hits > 0u) atomicAdd(counters[counters_of(bounce_ix, place)].n_hits, n_hits);
}

void count_shadow_rays(uint bounce_ix, uint place, uint n_of_lane) {
    uint n_segments = subgroupAdd(n_of_lane);
    if (subgroupElect() && n_segments > 0u) atomicAdd(counters[counters_of(bounce_ix, place)].n_shadow_rays, n_segments);
}

#endif
