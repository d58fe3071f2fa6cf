// Prefix sums over a workgroup of SCAN_GROUP_SIZE invocations, for every subgroup size from 4 to 128.
// Needs full subgroups. Include in kernels with that workgroup size.
#ifndef KDRAY_SCAN
#define KDRAY_SCAN

#include "layout.glsl"

// One total a subgroup: 32 subgroups at the most, of 4 invocations.
shared uint subgroup_totals[SCAN_GROUP_SIZE / 4u];

// This invocation's place in the order that subgroup scans follow (gl_LocalInvocationIndex need not be in that order).
uint scan_rank() {
    return gl_SubgroupID * gl_SubgroupSize + gl_SubgroupInvocationID;
}

// Sum of `value` over the invocations of lower rank; `total` over all of them. Uniform control flow only.
uint workgroup_exclusive_add(uint value, out uint total) {
    uint before = subgroupExclusiveAdd(value);
    if (gl_SubgroupInvocationID == gl_SubgroupSize - 1u) subgroup_totals[gl_SubgroupID] = before + value;
    barrier();
    total = 0u;
    for (uint i = 0u; i < gl_NumSubgroups; ++i) {
        if (i < gl_SubgroupID) before += subgroup_totals[i];
        total += subgroup_totals[i];
    }
    barrier();
    return before;
}

#endif
