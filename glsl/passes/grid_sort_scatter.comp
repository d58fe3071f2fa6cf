#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_ballot : require
// Grid, sort, 3 of 3: each workgroup goes through the same blocks as in grid_sort_count.comp, and writes each pair to
// its place in the order of the digit. Pairs of the same digit keep their order. A block is sorted in shared memory
// first, so that neighbouring invocations write to neighbouring addresses.
// Reads build, pairs_from, scan_blocks; writes pairs_to.
#include "grid/grid_build.glsl"
#include "grid/grid_digits.glsl"
#include "scan.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_GRID_PAIRS_FROM) readonly buffer PairsFromBlock { uvec2 pairs_from[]; };
layout(std430, set = 0, binding = BIND_GRID_PAIRS_TO) writeonly buffer PairsToBlock { uvec2 pairs_to[]; };
layout(std430, set = 0, binding = BIND_GRID_SCAN_BLOCKS) readonly buffer ScanBlocksBlock { uint scan_blocks[]; };

// One word for each digit and each subgroup, ordered by digit and then subgroup. At first it is the number of the
// subgroup's pairs with this digit. `scan_places` replaces it by the place where these pairs begin in the block. There
// are at most 32 subgroups.
shared uint places[GRID_DIGITS * SCAN_GROUP_SIZE / 4u];
shared uvec2 block_pairs[GRID_BLOCK_SIZE];
// For each digit: where the workgroup's next pair with this digit is written in pairs_to.
shared uint next_places[GRID_DIGITS];

// The index in the block of the invocation's pair in a row. Each subgroup has a contiguous part of the block.
uint place_in_block(uint row) {
    return (gl_SubgroupID * GRID_ROWS + row) * gl_SubgroupSize + gl_SubgroupInvocationID;
}

// The index in `places` of a digit of this subgroup.
uint slot_of(uint digit) {
    return digit * gl_NumSubgroups + gl_SubgroupID;
}

// Adds a row of pairs to the subgroup's counts. Returns how many pairs with the same digit come before this
// invocation's pair in the subgroup's part of the block.
uint rank_of(uint digit, bool has_pair) {
    uvec4 peers = peers_of(digit, has_pair);
    uint before = places[slot_of(digit)];
    subgroupBarrier();
    if (has_pair && subgroupBallotFindLSB(peers) == gl_SubgroupInvocationID) {
        places[slot_of(digit)] = before + subgroupBallotBitCount(peers);
    }
    subgroupMemoryBarrierShared();
    subgroupBarrier();
    return before + subgroupBallotExclusiveBitCount(peers);
}

// Turns the counts into the places where each subgroup's pairs of each digit begin.
void scan_places() {
    uint n = GRID_DIGITS * gl_NumSubgroups;
    uint n_each = (n + SCAN_GROUP_SIZE - 1u) / SCAN_GROUP_SIZE;
    uint begin = min(scan_rank() * n_each, n), end = min(begin + n_each, n);
    uint sum = 0u;
    for (uint i = begin; i < end; ++i) sum += places[i];
    uint total;
    uint before = workgroup_exclusive_add(sum, total);
    for (uint i = begin; i < end; ++i) {
        uint n_pairs = places[i];
        places[i] = before;
        before += n_pairs;
    }
}

// Sorts the n_pairs pairs from `first` on into `block_pairs`, and leaves in `places` where each digit begins there.
void sort_block(uint first, uint n_pairs) {
    for (uint i = gl_LocalInvocationIndex; i < GRID_DIGITS * gl_NumSubgroups; i += SCAN_GROUP_SIZE) places[i] = 0u;
    barrier();
    uvec2 pairs[GRID_ROWS];
    uint ranks[GRID_ROWS];
    for (uint row = 0u; row < GRID_ROWS; ++row) {
        uint place = place_in_block(row);
        pairs[row] = place < n_pairs ? pairs_from[first + place] : uvec2(0u);
    }
    for (uint row = 0u; row < GRID_ROWS; ++row) {
        ranks[row] = rank_of(digit_of(pairs[row].x), place_in_block(row) < n_pairs);
    }
    barrier();
    scan_places();
    barrier();
    for (uint row = 0u; row < GRID_ROWS; ++row) {
        if (place_in_block(row) >= n_pairs) continue;
        block_pairs[places[slot_of(digit_of(pairs[row].x))] + ranks[row]] = pairs[row];
    }
    barrier();
}

// Where the block's pairs of a digit begin.
uint first_of(uint digit, uint n_pairs) {
    return digit < GRID_DIGITS ? places[digit * gl_NumSubgroups] : n_pairs;
}

void main() {
    uint rank = gl_LocalInvocationIndex;
    if (rank < GRID_DIGITS) next_places[rank] = scan_blocks[rank * gl_NumWorkGroups.x + gl_WorkGroupID.x];
    uint begin = gl_WorkGroupID.x * build.blocks_per_group * GRID_BLOCK_SIZE;
    uint end = min(begin + build.blocks_per_group * GRID_BLOCK_SIZE, build.n_pairs);
    for (uint first = begin; first < end; first += GRID_BLOCK_SIZE) {
        uint n_pairs = min(end - first, GRID_BLOCK_SIZE);
        sort_block(first, n_pairs);
        for (uint i = rank; i < n_pairs; i += SCAN_GROUP_SIZE) {
            uvec2 pair = block_pairs[i];
            uint digit = digit_of(pair.x);
            pairs_to[next_places[digit] + i - first_of(digit, n_pairs)] = pair;
        }
        barrier();
        if (rank < GRID_DIGITS) next_places[rank] += first_of(rank + 1u, n_pairs) - first_of(rank, n_pairs);
        barrier();
    }
}
