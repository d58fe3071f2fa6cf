// Which nodes are candidates for slabs. Needs nothing before it; includes slab_build.glsl.
//
// The limits are those of src/accel/kdtree/slabs.rs.
#ifndef KDRAY_SLAB_CANDIDATES
#define KDRAY_SLAB_CANDIDATES

#include "kdtree/slab_build.glsl"

layout(std430, set = 0, binding = BIND_KD_SLAB_PARENTS) readonly buffer ParentsBlock { uint parents[]; };
layout(std430, set = 0, binding = BIND_KD_SLAB_RANGES) readonly buffer RangesBlock { uvec2 ranges[]; };

const uint LEAST_ENTRY_LIMIT = 8u;
const uint LIMIT_RATIO = 4u;
const uint LEAF_ENTRIES = 2u;
const float THICKEST_SPLIT = 0.2;
const float THICKEST_LEAF = 0.3;

// The greatest thickness of a node's slab, as a share of the longest side of its cell. 0 if the node is no candidate.
float thickest_share(uint node_ix, KdNode node) {
    uint n_entries = ranges[node_ix].y;
    if (n_entries == 0u || n_entries > KD_SLAB_MAX_ENTRIES) return 0.0;
    if (is_leaf(node)) return n_entries >= LEAF_ENTRIES ? THICKEST_LEAF : 0.0;
    uint limit = LEAST_ENTRY_LIMIT;
    while (limit < n_entries) limit *= LIMIT_RATIO;
    bool is_first = node_ix == 0u || ranges[parents[node_ix >> 1]].y > limit;
    return is_first ? THICKEST_SPLIT : 0.0;
}

#endif
