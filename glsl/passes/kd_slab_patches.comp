#version 460
#extension GL_GOOGLE_include_directive : require
// Slabs of a kd-tree, 3 of 8: finds the cell of each candidate and of each leaf with entries, and the next candidate
// above it, by walking to the root. One invocation per node.
// Reads tree, nodes, parents, ranges; writes patches, extents (empty ones) and large; updates n_large of build.
#include "kdtree/slab_candidates.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_KD_SLAB_BUILD) buffer BuildBlock { KdSlabBuild build; };
layout(std430, set = 0, binding = BIND_KD_SLAB_PATCHES) writeonly buffer PatchesBlock { KdSlabPatch patches[]; };
layout(std430, set = 0, binding = BIND_KD_SLAB_EXTENTS) writeonly buffer ExtentsBlock { KdSlabExtent extents[]; };
layout(std430, set = 0, binding = BIND_KD_SLAB_LARGE) writeonly buffer LargeBlock { uint large[]; };

// The surface below a node, without its normal.
KdSlabPatch patch_of(uint node_ix) {
    KdSlabPatch patch_ = KdSlabPatch(tree.box_min, NO_NODE, tree.box_max, 0u, vec3(0.0), 0u);
    for (uint at = node_ix; at != 0u;) {
        uint parent = parents[at >> 1];
        KdNode split = nodes[parent];
        float position = uintBitsToFloat(split.split_or_first);
        bvec3 is_axis = equal(uvec3(split.axis_and_child & KD_AXIS_MASK), uvec3(0u, 1u, 2u));
        if ((at & 1u) == 0u) patch_.cell_max = mix(patch_.cell_max, min(patch_.cell_max, position), is_axis);
        else patch_.cell_min = mix(patch_.cell_min, max(patch_.cell_min, position), is_axis);
        if (patch_.above == NO_NODE && thickest_share(parent, split) > 0.0) patch_.above = parent;
        at = parent;
    }
    return patch_;
}

void main() {
    uint node_ix = invocation_ix();
    if (node_ix >= tree.n_nodes) return;
    KdNode node = nodes[node_ix];
    uint n_entries = ranges[node_ix].y;
    bool is_candidate = thickest_share(node_ix, node) > 0.0;
    bool has_entries = is_leaf(node) && n_entries > 0u && n_entries <= KD_SLAB_MAX_ENTRIES;
    if (!is_candidate && !has_entries) return;
    patches[node_ix] = patch_of(node_ix);
    extents[node_ix] = KdSlabExtent(0xffffffffu, 0u, 0xffffffffu);
    if (is_candidate && n_entries > KD_SLAB_SMALL) large[atomicAdd(build.n_large, 1u)] = node_ix;
}
