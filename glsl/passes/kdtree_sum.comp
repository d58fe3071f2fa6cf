#version 460
#extension GL_GOOGLE_include_directive : require
// Kd-tree, sum: adds up the pairs and the entries below the parents of a level's nodes. One workgroup per block of
// pairs of the level; an invocation takes one pair per row.
// Reads build, levels, built_parents; updates below.
#include "kdtree_build/kd_build.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_KD_BUILT_PARENTS) readonly buffer BuiltParentsBlock { uint built_parents[]; };
layout(std430, set = 0, binding = BIND_KD_BELOW) buffer BelowBlock { uvec2 below[]; };

void main() {
    KdLevel level = levels[stage.level_ix];
    uint begin = index_of_group() * KD_BLOCK_SIZE + gl_LocalInvocationIndex;
    for (uint row = 0u; row < KD_ROWS; ++row) {
        uint i = begin + row * SCAN_GROUP_SIZE;
        if (i >= level.n_new_pairs) break;
        uint pair_ix = level.n_pairs - level.n_new_pairs + i;
        below[built_parents[pair_ix]] = uvec2(1u, 0u) + below[2u * pair_ix] + below[2u * pair_ix + 1u];
    }
}
