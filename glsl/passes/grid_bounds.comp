#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Grid, bounds: one workgroup per block of GRID_BLOCK_SIZE triangles finds the bounds of the finite ones and counts
// them. Atomics combine the blocks; a minimum, a maximum and a sum of integers are the same in every order.
// Reads triangles and n_triangles of build; updates least, greatest and n_finite of build.
#include "grid/grid_build.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_GRID_TRIANGLES) readonly buffer TrianglesBlock { Triangle triangles[]; };

// Maps floats to integers of the same order: a negative number has all bits inverted, any other only its sign bit.
uvec3 ordered(vec3 v) {
    uvec3 bits = floatBitsToUint(v);
    return bits ^ mix(uvec3(0x80000000u), uvec3(0xffffffffu), greaterThan(bits, uvec3(0x7fffffffu)));
}

void main() {
    uvec3 least = uvec3(0xffffffffu), greatest = uvec3(0u);
    uint n_finite = 0u;
    uint begin = block_of_group() * GRID_BLOCK_SIZE + gl_LocalInvocationIndex;
    for (uint row = 0u; row < GRID_ROWS; ++row) {
        uint triangle_ix = begin + row * SCAN_GROUP_SIZE;
        if (triangle_ix >= build.n_triangles) break;
        Triangle triangle = triangles[triangle_ix];
        if (!is_finite(triangle)) continue;
        least = min(least, min(ordered(triangle.v0), min(ordered(triangle.v1), ordered(triangle.v2))));
        greatest = max(greatest, max(ordered(triangle.v0), max(ordered(triangle.v1), ordered(triangle.v2))));
        n_finite += 1u;
    }
    least = subgroupMin(least);
    greatest = subgroupMax(greatest);
    n_finite = subgroupAdd(n_finite);
    if (!subgroupElect() || n_finite == 0u) return;
    atomicMin(build.least_x, least.x);
    atomicMin(build.least_y, least.y);
    atomicMin(build.least_z, least.z);
    atomicMax(build.greatest_x, greatest.x);
    atomicMax(build.greatest_y, greatest.y);
    atomicMax(build.greatest_z, greatest.z);
    atomicAdd(build.n_finite, n_finite);
}
