#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Grid, spine: the only workgroup turns the sums of blocks into exclusive prefix sums. Each invocation scans a
// contiguous part of the sums. Except in the sort, the total decides how the attempt continues.
// Reads and writes scan_blocks and build.
#include "grid/grid_attempt.glsl"
#include "scan.glsl"

// What is summed: lower cells, columns, pairs, or pairs by the digit that the sort takes.
layout(constant_id = CONSTANT_SCANS) const uint SCANS = GRID_SCANS_COLUMNS;
// The number of sums that an invocation loads before it uses the first, so that no load waits for another.
const uint N_AT_ONCE = 16u;

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_GRID_SCAN_BLOCKS) buffer ScanBlocksBlock { uint scan_blocks[]; };

// Returns where the sums begin and how many there are. There are none if the build counts something else next.
uvec2 sums() {
    switch (SCANS) {
        case GRID_SCANS_CELLS:
            return uvec2(build.cells_begin, build.counts == GRID_COUNTS_CELLS ? blocks_of(build.n_upper) : 0u);
        case GRID_SCANS_COLUMNS:
            return uvec2(build.columns_begin, build.counts == GRID_COUNTS_COLUMNS ? blocks_of(build.n_items) : 0u);
        case GRID_SCANS_PAIRS:
            return uvec2(build.pairs_begin, build.counts == GRID_COUNTS_PAIRS ? blocks_of(build.n_columns) : 0u);
        default:
            return uvec2(0u, GRID_DIGITS * build.sort_groups_x);
    }
}

// Stores the total, and continues the attempt. If the total is above its limit, the next attempt has larger cells.
// The first three GRID_SCANS_* have the numbers of GRID_COUNTS_*, which are in counting order. So adding 1 to
// build.counts goes on to the next count.
void finish(uint total) {
    if (SCANS == GRID_SCANS_DIGITS || build.counts != SCANS) return;
    if (SCANS == GRID_SCANS_CELLS) build.n_lower = total;
    if (SCANS == GRID_SCANS_COLUMNS) build.n_columns = total;
    if (SCANS == GRID_SCANS_PAIRS) build.n_pairs = total;
    uint limit = SCANS == GRID_SCANS_COLUMNS ? build.max_columns : build.max_references;
    if (total <= limit) {
        build.counts += 1u;
    } else {
        coarsen(total, limit);
    }
    size_dispatches();
}

uint counts_of(uint begin, uint end, uint first, uint i) {
    return first + i < end ? scan_blocks[begin + first + i] : 0u;
}

void main() {
    uvec2 begin_and_n = sums();
    uint begin = begin_and_n.x, n = begin_and_n.y;
    uint n_each = (n + SCAN_GROUP_SIZE - 1u) / SCAN_GROUP_SIZE;
    uint mine = min(scan_rank() * n_each, n), end = min(mine + n_each, n);
    uint sum = 0u;
    for (uint first = mine; first < end; first += N_AT_ONCE) {
        uint counts[N_AT_ONCE];
        for (uint i = 0u; i < N_AT_ONCE; ++i) counts[i] = counts_of(begin, end, first, i);
        for (uint i = 0u; i < N_AT_ONCE; ++i) sum = sum + counts[i] < sum ? 0xffffffffu : sum + counts[i];
    }
    uint total, n_65536;
    uint before = workgroup_exclusive_add(sum, total);
    // The total may wrap around. n_65536, the sum of the upper 16 bits of each `sum`, cannot. So n_65536 tells
    // whether the total has.
    workgroup_exclusive_add(sum >> 16, n_65536);
    for (uint first = mine; first < end; first += N_AT_ONCE) {
        uint counts[N_AT_ONCE];
        for (uint i = 0u; i < N_AT_ONCE; ++i) counts[i] = counts_of(begin, end, first, i);
        for (uint i = 0u; i < N_AT_ONCE; ++i) {
            if (first + i < end) scan_blocks[begin + first + i] = before;
            before += counts[i];
        }
    }
    barrier();
    bool is_too_many = n_65536 > GRID_MAX_COUNT >> 16 || total > GRID_MAX_COUNT;
    if (gl_LocalInvocationIndex == 0u) finish(is_too_many ? 0xffffffffu : total);
}
