// Counters of the kernels for the profile: hits and shadow rays of each bounce. Needs
// GL_KHR_shader_subgroup_arithmetic. Each subgroup sums its counts and adds the sum with one atomic. Each bounce has
// COUNTER_COPIES counters, whose sum is the count, so that this many workgroups can add at the same time.
#ifndef KDRAY_COUNTERS
#define KDRAY_COUNTERS

#include "layout.glsl"

layout(std430, set = 0, binding = BIND_COUNTERS) buffer CountersBlock { Counters counters[]; };

// The index in `counters` of one of a bounce's counters.
uint counters_of(uint bounce_ix, uint place) {
    return (bounce_ix * COUNTER_COPIES + place % COUNTER_COPIES) * COUNTER_STRIDE;
}

// Counts the hit of this invocation if is_hit. place: selects one of the bounce's counters. It is the same for all
// invocations of a workgroup, and should differ between neighbouring workgroups if these add at the same time.
void count_hits(uint bounce_ix, uint place, bool is_hit) {
    uint n_hits = subgroupAdd(is_hit ? 1u : 0u);
    if (subgroupElect() && n_hits > 0u) atomicAdd(counters[counters_of(bounce_ix, place)].n_hits, n_hits);
}

// Counts n_of_lane shadow rays of this invocation. place: as for `count_hits`.
void count_shadow_rays(uint bounce_ix, uint place, uint n_of_lane) {
    uint n_shadow_rays = subgroupAdd(n_of_lane);
    if (subgroupElect() && n_shadow_rays > 0u)
        atomicAdd(counters[counters_of(bounce_ix, place)].n_shadow_rays, n_shadow_rays);
}

#endif
