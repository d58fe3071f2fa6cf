#version 460
#extension GL_GOOGLE_include_directive : require
// Slabs of a kd-tree, 2 of 8: finds the entries below each node, from those of its first and its last leaf, and the
// leaf of each entry. One invocation per node. All entries of too large leaves keep the value NO_NODE.
// Reads tree, nodes; writes ranges and entry_leaves.
#include "kdtree/slab_build.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_KD_SLAB_RANGES) writeonly buffer RangesBlock { uvec2 ranges[]; };
layout(std430, set = 0, binding = BIND_KD_SLAB_ENTRY_LEAVES) writeonly buffer EntryLeavesBlock { uint entry_leaves[]; };

// The first leaf below a node (side 0), or the last one (side 1).
KdNode end_leaf(KdNode node, uint side) {
    while (!is_leaf(node)) node = nodes[child_of(node) + side];
    return node;
}

uint count_of(KdNode leaf) {
    return leaf.axis_and_child >> KD_PAIR_SHIFT;
}

void main() {
    uint node_ix = invocation_ix();
    if (node_ix >= tree.n_nodes) return;
    KdNode node = nodes[node_ix];
    KdNode first = end_leaf(node, 0u), last = end_leaf(node, 1u);
    uvec2 range = uvec2(first.split_or_first, last.split_or_first + count_of(last) - first.split_or_first);
    ranges[node_ix] = range;
    if (!is_leaf(node) || range.y > KD_SLAB_MAX_ENTRIES) return;
    for (uint i = 0u; i < range.y; ++i) entry_leaves[range.x + i] = node_ix;
}
