#version 460
#extension GL_GOOGLE_include_directive : require
// Slabs of a kd-tree, 6 of 8: computes the normals of candidates with more than KD_SLAB_SMALL entries. Each workgroup
// goes through several candidates. The order of a sum depends on the number of entries alone.
// Reads tree, build, ranges, large, areas; writes the normals of patches.
#include "kdtree/slab_normal.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_KD_SLAB_BUILD) readonly buffer BuildBlock { KdSlabBuild build; };
layout(std430, set = 0, binding = BIND_KD_SLAB_RANGES) readonly buffer RangesBlock { uvec2 ranges[]; };
layout(std430, set = 0, binding = BIND_KD_SLAB_LARGE) readonly buffer LargeBlock { uint large[]; };
layout(std430, set = 0, binding = BIND_KD_SLAB_PATCHES) writeonly buffer PatchesBlock { KdSlabPatch patches[]; };

shared Tensor sums[SCAN_GROUP_SIZE];

// Returns the sum of a range of entries to the first invocation. Needs uniform control flow.
Tensor sum_over(uvec2 range) {
    uint rank = gl_LocalInvocationIndex;
    Tensor sum = Tensor(vec3(0.0), vec3(0.0));
    for (uint i = rank; i < range.y; i += SCAN_GROUP_SIZE) add_entry(sum, range.x + i);
    sums[rank] = sum;
    for (uint half_ = SCAN_GROUP_SIZE / 2u; half_ > 0u; half_ /= 2u) {
        barrier();
        if (rank < half_) sums[rank] = sum_of(sums[rank], sums[rank + half_]);
    }
    return sums[0];
}

void main() {
    for (uint i = gl_WorkGroupID.x; i < build.n_large; i += gl_NumWorkGroups.x) {
        uint node_ix = large[i];
        Tensor sum = sum_over(ranges[node_ix]);
        if (gl_LocalInvocationIndex == 0u) patches[node_ix].normal = main_axis(sum);
        barrier();
    }
}
