#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Kd-tree, gather: writes the references of the root's cell, the bounds of the finite triangles grown by their margins.
// One workgroup per block of triangles.
// Reads build, triangles, scan_blocks; writes references_from.
#include "kdtree_build/kd_scales.glsl"
#include "scan.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_KD_TRIANGLES) readonly buffer TrianglesBlock { Triangle triangles[]; };
layout(std430, set = 0, binding = BIND_KD_SCAN_BLOCKS) readonly buffer ScanBlocksBlock { uvec4 scan_blocks[]; };
layout(std430, set = 0, binding = BIND_KD_REFERENCES_FROM) writeonly buffer ReferencesFromBlock {
    KdReference references_from[];
};

const float LARGEST = 3.4028235e38;

KdReference reference_of(uint triangle_ix, Triangle triangle) {
    float margin = margin_of(triangle);
    precise vec3 low = least_of(triangle) - margin;
    precise vec3 high = greatest_of(triangle) + margin;
    return KdReference(max(low, vec3(-LARGEST)), triangle_ix, min(high, vec3(LARGEST)), 0u);
}

void main() {
    uint block = index_of_group();
    bool is_block = block < blocks_of(build.n_triangles);
    uint first = is_block ? scan_blocks[block].x : 0u;
    for (uint row = 0u; row < KD_ROWS; ++row) {
        uint triangle_ix = block * KD_BLOCK_SIZE + row * SCAN_GROUP_SIZE + scan_rank();
        Triangle triangle;
        bool is_kept = triangle_ix < build.n_triangles;
        if (is_kept) {
            triangle = triangles[triangle_ix];
            is_kept = is_finite(triangle);
        }
        uint total;
        uint place = first + workgroup_exclusive_add(is_kept ? 1u : 0u, total);
        if (is_kept) references_from[place] = reference_of(triangle_ix, triangle);
        first += total;
    }
}
