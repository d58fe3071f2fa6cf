#version 460
#extension GL_GOOGLE_include_directive : require
// Slabs of a kd-tree, 5 of 8: computes the normals of candidates with at most KD_SLAB_SMALL entries. One invocation per
// node.
// Reads tree, nodes, parents, ranges, areas; writes the normals of patches.
#include "kdtree/slab_candidates.glsl"
#include "kdtree/slab_normal.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_KD_SLAB_PATCHES) writeonly buffer PatchesBlock { KdSlabPatch patches[]; };

void main() {
    uint node_ix = invocation_ix();
    if (node_ix >= tree.n_nodes) return;
    uvec2 range = ranges[node_ix];
    if (range.y > KD_SLAB_SMALL || thickest_share(node_ix, nodes[node_ix]) == 0.0) return;
    Tensor sum = Tensor(vec3(0.0), vec3(0.0));
    for (uint i = 0u; i < range.y; ++i) add_entry(sum, range.x + i);
    patches[node_ix].normal = main_axis(sum);
}
