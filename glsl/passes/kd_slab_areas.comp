#version 460
#extension GL_GOOGLE_include_directive : require
// Slabs of a kd-tree, 4 of 8: computes the area vector of each entry's piece. One invocation per entry.
// Reads tree, leaf_triangles, entry_leaves, patches; writes areas.
#include "kdtree/slab_pieces.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_KD_SLAB_PATCHES) readonly buffer PatchesBlock { KdSlabPatch patches[]; };
layout(std430, set = 0, binding = BIND_KD_SLAB_AREAS) writeonly buffer AreasBlock { vec4 areas[]; };

void main() {
    uint entry_ix = invocation_ix();
    if (entry_ix >= tree.n_entries) return;
    uint leaf_ix = entry_leaves[entry_ix];
    if (leaf_ix == NO_NODE) return;
    LeafTriangle triangle = leaf_triangles[entry_ix];
    find_piece(triangle, scale_of_triangle(triangle), patches[leaf_ix]);
    areas[entry_ix] = vec4(area_of_piece(), 0.0);
}
