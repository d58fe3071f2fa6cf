// Prefix sums over a workgroup of SCAN_SIZE invocations, for every subgroup size from 4 to 128. The kernel that
// includes this file must have that workgroup size, full subgroups and GL_KHR_shader_subgroup_arithmetic.
#ifndef KDRAY_SCAN
#define KDRAY_SCAN

#include "layout.glsl"

// Invocations of the workgroup. Kernels whose workgroups have SCAN_GROUP_SIZE invocations keep the default.
layout(constant_id = CONSTANT_SCAN_SIZE) const uint SCAN_SIZE = SCAN_GROUP_SIZE;

// One total per subgroup. A subgroup has at least 4 invocations.
shared uint subgroup_totals[SCAN_SIZE / 4u];

// The invocation's index in the order of subgroup scans, which need not be that of gl_LocalInvocationIndex.
uint scan_rank() {
    return gl_SubgroupID * gl_SubgroupSize + gl_SubgroupInvocationID;
}

// The two counts that are the halves of a word. The count in the lower half comes first.
uvec2 halves_of(uint word) {
    return uvec2(word & 0xffffu, word >> 16u);
}

// The sum of `value` over the invocations of lower rank. total: the sum over all invocations. Needs uniform control
// flow.
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
