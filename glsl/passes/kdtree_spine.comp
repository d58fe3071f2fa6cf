#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Kd-tree, spine: the only workgroup turns the sums of blocks into exclusive prefix sums. Each invocation scans a
// contiguous part of the sums.
// Reads and writes scan_blocks; writes the totals of the level.
#include "kdtree_build/kd_build.glsl"
#include "scan.glsl"

// What is summed: KD_SCANS_TRIANGLES and its like.
layout(constant_id = CONSTANT_SCANS) const uint SCANS = KD_SCANS_TRIANGLES;
// The number of sums that an invocation loads before it uses the first, so that no load waits for another.
const uint N_AT_ONCE = 8u;

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_KD_SCAN_BLOCKS) buffer ScanBlocksBlock { uvec4 scan_blocks[]; };

// Returns where the sums begin and how many there are.
uvec2 sums() {
    switch (SCANS) {
        case KD_SCANS_TRIANGLES: return uvec2(0u, blocks_of(build.n_triangles));
        case KD_SCANS_REFERENCES: return uvec2(0u, blocks_of(levels[stage.level_ix].n_references));
        default: return uvec2(build.cell_blocks_begin, blocks_of(levels[stage.level_ix].n_cells));
    }
}

uvec3 exclusive_add(uvec3 value, out uvec3 total) {
    uvec3 before;
    before.x = workgroup_exclusive_add(value.x, total.x);
    before.y = workgroup_exclusive_add(value.y, total.y);
    before.z = workgroup_exclusive_add(value.z, total.z);
    return before;
}

uvec3 part_of(uint begin, uint end, uint i) {
    return i < end ? scan_blocks[begin + i].xyz : uvec3(0u);
}

void finish(uvec3 total) {
    if (SCANS == KD_SCANS_REFERENCES) {
        levels[stage.level_ix].n_below = total.x;
        levels[stage.level_ix].n_above = total.y;
    }
    if (SCANS == KD_SCANS_CELLS) {
        levels[stage.level_ix].n_splits = total.x;
        levels[stage.level_ix].n_open = total.y;
        levels[stage.level_ix].n_in_leaves = total.z;
    }
}

void main() {
    uvec2 begin_and_n = sums();
    uint begin = begin_and_n.x, n = begin_and_n.y;
    uint n_each = (n + SCAN_GROUP_SIZE - 1u) / SCAN_GROUP_SIZE;
    uint mine = min(scan_rank() * n_each, n), end = min(mine + n_each, n);
    uvec3 sum = uvec3(0u);
    for (uint first = mine; first < end; first += N_AT_ONCE) {
        uvec3 part[N_AT_ONCE];
        for (uint i = 0u; i < N_AT_ONCE; ++i) part[i] = part_of(begin, end, first + i);
        for (uint i = 0u; i < N_AT_ONCE; ++i) sum += part[i];
    }
    uvec3 total;
    uvec3 before = exclusive_add(sum, total);
    for (uint first = mine; first < end; first += N_AT_ONCE) {
        uvec3 part[N_AT_ONCE];
        for (uint i = 0u; i < N_AT_ONCE; ++i) part[i] = part_of(begin, end, first + i);
        for (uint i = 0u; i < N_AT_ONCE; ++i) {
            if (first + i < end) scan_blocks[begin + first + i] = uvec4(before, 0u);
            before += part[i];
        }
    }
    if (gl_LocalInvocationIndex == 0u) finish(total);
}
