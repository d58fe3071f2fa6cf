#version 460
#extension GL_GOOGLE_include_directive : require
// Kd-tree, scales: one workgroup per block of triangles counts how many need each scale. Twin of src/accel/kdtree/
// scales.rs (`needed_by`). Atomics combine the blocks; the sums are the same in every order.
// Reads triangles and the bounds of build; updates scale_counts.
#include "kdtree_build/kd_scales.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_KD_TRIANGLES) readonly buffer TrianglesBlock { Triangle triangles[]; };
layout(std430, set = 0, binding = BIND_KD_SCALE_COUNTS) buffer ScaleCountsBlock { uint scale_counts[]; };

shared uint counts[KD_SCALES];

uint needed_by(Triangle triangle, float largest) {
    vec3 least = least_of(triangle), greatest = greatest_of(triangle);
    if (all(equal(least, greatest)) || !is_finite(triangle)) return 0u;
    precise vec3 size = greatest - least;
    precise float len = max(size.x, max(size.y, size.z)) * 16384.0; // 1 / (8 margins)
    uint own = scale_of_length(largest, largest_of(least, greatest), KD_SCALES - 1u);
    return min(scale_of_length(largest, len, KD_SCALES - 1u), own);
}

void main() {
    if (gl_LocalInvocationIndex < KD_SCALES) counts[gl_LocalInvocationIndex] = 0u;
    barrier();
    vec3 least, greatest;
    exact_bounds(least, greatest);
    float largest = largest_of(least, greatest);
    for (uint row = 0u; row < KD_ROWS; ++row) {
        uint triangle_ix = index_of_group() * KD_BLOCK_SIZE + row * SCAN_GROUP_SIZE + gl_LocalInvocationIndex;
        if (triangle_ix < build.n_triangles) atomicAdd(counts[needed_by(triangles[triangle_ix], largest)], 1u);
    }
    barrier();
    if (gl_LocalInvocationIndex >= KD_SCALES) return;
    uint count = counts[gl_LocalInvocationIndex];
    if (count > 0u) atomicAdd(scale_counts[gl_LocalInvocationIndex], count);
}
