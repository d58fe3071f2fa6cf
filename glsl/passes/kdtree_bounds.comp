#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Kd-tree, bounds: one workgroup per block of triangles finds the bounds of the finite ones and counts them. Atomics
// combine the blocks' bounds; a minimum, a maximum and a sum of integers are the same in every order. The last
// workgroup finds how many finite triangles come before each block.
// Reads triangles and n_triangles of build; updates least, greatest, n_finite and n_summed_blocks of build, and
// scan_blocks.
#include "kdtree_build/kd_build.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_KD_TRIANGLES) readonly buffer TrianglesBlock { Triangle triangles[]; };
layout(std430, set = 0, binding = BIND_KD_SCAN_BLOCKS) coherent buffer ScanBlocksBlock { uvec4 scan_blocks[]; };

#include "kdtree_build/kd_spine.glsl"

uvec3 ordered(vec3 v) {
    return uvec3(ordered(v.x), ordered(v.y), ordered(v.z));
}

void main() {
    uvec3 least = uvec3(0xffffffffu), greatest = uvec3(0u);
    uint n_finite = 0u;
    uint block = index_of_group(), n_blocks = blocks_of(build.n_triangles);
    for (uint row = 0u; row < KD_ROWS; ++row) {
        uint triangle_ix = block * KD_BLOCK_SIZE + row * SCAN_GROUP_SIZE + gl_LocalInvocationIndex;
        if (triangle_ix >= build.n_triangles) break;
        Triangle triangle = triangles[triangle_ix];
        if (!is_finite(triangle)) continue;
        least = min(least, ordered(least_of(triangle)));
        greatest = max(greatest, ordered(greatest_of(triangle)));
        n_finite += 1u;
    }
    uint total;
    workgroup_exclusive_add(n_finite, total);
    least = subgroupMin(least);
    greatest = subgroupMax(greatest);
    bool is_first = gl_LocalInvocationIndex == 0u;
    if (is_first) is_last_group = false;
    if (is_first && block < n_blocks) {
        scan_blocks[block] = uvec4(total, 0u, 0u, 0u);
        memoryBarrierBuffer();
        is_last_group = atomicAdd(build.n_summed_blocks, 1u) == n_blocks - 1u;
        memoryBarrierBuffer();
        atomicAdd(build.n_finite, total);
    }
    barrier();
    if (is_last_group) {
        uvec2 part = own_part(n_blocks);
        uvec3 of_all, before = sum_before_part(0u, part, of_all);
        write_prefix_sums(0u, part, before);
    }
    if (!subgroupElect() || total == 0u) return;
    atomicMin(build.least_x, least.x);
    atomicMin(build.least_y, least.y);
    atomicMin(build.least_z, least.z);
    atomicMax(build.greatest_x, greatest.x);
    atomicMax(build.greatest_y, greatest.y);
    atomicMax(build.greatest_z, greatest.z);
}
