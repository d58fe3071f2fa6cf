// Exclusive prefix sums over the sums of all blocks, or groups of cells, in `scan_blocks`. The last workgroup to write
// its sums computes them; no workgroup waits for another. Each invocation scans a contiguous part. The kernel declares
// scan_blocks as coherent, and an invocation writes the workgroup's sums like this:
//
//     scan_blocks[block] = sums;
//     memoryBarrierBuffer();
//     is_last_group = atomicAdd(n_summed_blocks, 1u) == n_blocks - 1u;
//     memoryBarrierBuffer();
//
// After the next barrier(), all invocations of the last workgroup can call sum_before_part.
#ifndef KDRAY_KD_SPINE
#define KDRAY_KD_SPINE

#include "scan.glsl"

// The number of sums that an invocation loads before it uses the first, so that no load waits for another.
const uint N_AT_ONCE = 8u;

// Whether the workgroup is the last one.
shared bool is_last_group;

// The first of the invocation's sums, and the one after the last.
uvec2 own_part(uint n) {
    uint n_each = (n + SCAN_GROUP_SIZE - 1u) / SCAN_GROUP_SIZE;
    return min(scan_rank() * n_each + uvec2(0u, n_each), uvec2(n));
}

uvec3 sums_at(uint begin, uint end, uint i) {
    return i < end ? scan_blocks[begin + i].xyz : uvec3(0u);
}

// The sum of all parts before the invocation's. begin: where the sums begin in scan_blocks. total: of all parts. Needs
// uniform control flow.
uvec3 sum_before_part(uint begin, uvec2 part, out uvec3 total) {
    memoryBarrierBuffer();
    uvec3 sum = uvec3(0u), before;
    for (uint first = part.x; first < part.y; first += N_AT_ONCE) {
        uvec3 sums[N_AT_ONCE];
        for (uint i = 0u; i < N_AT_ONCE; ++i) sums[i] = sums_at(begin, part.y, first + i);
        for (uint i = 0u; i < N_AT_ONCE; ++i) sum += sums[i];
    }
    before.x = workgroup_exclusive_add(sum.x, total.x);
    before.y = workgroup_exclusive_add(sum.y, total.y);
    before.z = workgroup_exclusive_add(sum.z, total.z);
    return before;
}

// Replaces the sums of a part by the sums of all before.
void write_prefix_sums(uint begin, uvec2 part, uvec3 before) {
    for (uint first = part.x; first < part.y; first += N_AT_ONCE) {
        uvec3 sums[N_AT_ONCE];
        for (uint i = 0u; i < N_AT_ONCE; ++i) sums[i] = sums_at(begin, part.y, first + i);
        for (uint i = 0u; i < N_AT_ONCE && first + i < part.y; ++i) {
            scan_blocks[begin + first + i] = uvec4(before, 0u);
            before += sums[i];
        }
    }
}

#endif
