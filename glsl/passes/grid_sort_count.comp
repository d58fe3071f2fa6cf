#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
// Grid, sort, 1 of 3: each workgroup goes through build.blocks_per_group blocks of GRID_BLOCK_SIZE pairs. It counts how
// many of their pairs have each value of one digit of the cell's index. grid_spine.comp is the second kernel. The
// sort is a least-significant-digit radix sort (Satish, Harris, Garland, "Designing efficient sorting algorithms for
// manycore GPUs", 2009).
// Reads build, pairs_from; writes scan_blocks[digit * workgroups + workgroup].
#include "grid/grid_build.glsl"
#include "grid/grid_digits.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_GRID_PAIRS_FROM) readonly buffer PairsFromBlock { uvec2 pairs_from[]; };
layout(std430, set = 0, binding = BIND_GRID_SCAN_BLOCKS) writeonly buffer ScanBlocksBlock { uint scan_blocks[]; };

shared uint n_by_digit[GRID_DIGITS];

void main() {
    if (gl_LocalInvocationIndex < GRID_DIGITS) n_by_digit[gl_LocalInvocationIndex] = 0u;
    barrier();
    uint begin = gl_WorkGroupID.x * build.blocks_per_group * GRID_BLOCK_SIZE;
    uint end = min(begin + build.blocks_per_group * GRID_BLOCK_SIZE, build.n_pairs);
    for (uint first = begin; first < end; first += SCAN_GROUP_SIZE) {
        uint pair_ix = first + gl_LocalInvocationIndex;
        bool has_pair = pair_ix < end;
        uint digit = has_pair ? digit_of(pairs_from[pair_ix].x) : 0u;
        uvec4 peers = peers_of(digit, has_pair);
        // One of the peers adds the number of all.
        if (has_pair && subgroupBallotFindLSB(peers) == gl_SubgroupInvocationID) {
            atomicAdd(n_by_digit[digit], subgroupBallotBitCount(peers));
        }
    }
    barrier();
    uint digit = gl_LocalInvocationIndex;
    if (digit < GRID_DIGITS) scan_blocks[digit * gl_NumWorkGroups.x + gl_WorkGroupID.x] = n_by_digit[digit];
}
