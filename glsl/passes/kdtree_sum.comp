#version 460
#extension GL_GOOGLE_include_directive : require
// Kd-tree, sum: adds up the pairs and the entries below the parents of a level's nodes. One workgroup per group of
// pairs of the level.
// Reads build, levels, built_parents; updates below.
#include "kdtree_build/kd_build.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_KD_BUILT_PARENTS) readonly buffer BuiltParentsBlock { uint built_parents[]; };
layout(std430, set = 0, binding = BIND_KD_BELOW) buffer BelowBlock { uvec2 below[]; };

void main() {
    KdLevel level = levels[stage.level_ix];
    if (index_of_entry() >= level.n_new_pairs) return;
    uint pair_ix = level.n_pairs - level.n_new_pairs + index_of_entry();
    below[built_parents[pair_ix]] = uvec2(1u, 0u) + below[2u * pair_ix] + below[2u * pair_ix + 1u];
}
