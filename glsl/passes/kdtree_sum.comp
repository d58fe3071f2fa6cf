#version 460
#extension GL_GOOGLE_include_directive : require
// Kd-tree, sum: adds up the pairs and the entries below each split. One workgroup per group of pairs. An invocation
// begins at a pair of leaves and goes towards the root. At a pair of two splits, only the invocation that comes second
// goes on. No invocation waits for another, and the sums do not depend on which one goes on.
// Reads build, built_nodes, built_parents; updates below, places.
#include "kdtree_build/kd_build.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_KD_BUILT_NODES) readonly buffer BuiltNodesBlock { KdNode built_nodes[]; };
layout(std430, set = 0, binding = BIND_KD_BUILT_PARENTS) readonly buffer BuiltParentsBlock { uint built_parents[]; };
layout(std430, set = 0, binding = BIND_KD_BELOW) coherent buffer BelowBlock { uvec2 below[]; };
layout(std430, set = 0, binding = BIND_KD_PLACES) buffer PlacesBlock { uvec2 places[]; };

bool is_leaf(uint built_ix) {
    return (built_nodes[built_ix].axis_and_child & KD_LEAF) != 0u;
}

void main() {
    uint pair_ix = index_of_entry();
    bool goes_on = pair_ix != 0u && pair_ix < build.n_pairs && is_leaf(2u * pair_ix) && is_leaf(2u * pair_ix + 1u);
    // All invocations take all turns: in Mesa 22.3, a memory barrier makes the invocations of a workgroup wait for one
    // another.
    for (uint turn = 0u; turn < build.depth; ++turn) {
        uint node_ix = 0u;
        if (goes_on) {
            node_ix = built_parents[pair_ix];
            below[node_ix] = uvec2(1u, 0u) + below[2u * pair_ix] + below[2u * pair_ix + 1u];
        }
        memoryBarrierBuffer();
        // Pair 0 has no parent.
        pair_ix = node_ix >> 1;
        goes_on = pair_ix != 0u;
        if (goes_on && !is_leaf(node_ix ^ 1u)) goes_on = atomicAdd(places[2u * pair_ix].x, 1u) != 0u;
        memoryBarrierBuffer();
    }
}
