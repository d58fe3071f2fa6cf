#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Kd-tree, spine: the only workgroup turns the sums of blocks, or of groups of cells, into exclusive prefix sums. Each
// invocation scans a contiguous part of the sums. Of cells, it also finds the first group after which a capacity would
// be passed, if all cells before are split and all cells after become leaves.
// Reads and writes scan_blocks; writes the totals and the cutoff of the level.
#include "kdtree_build/kd_sides.glsl"
#include "scan.glsl"

// What is summed: KD_SCANS_TRIANGLES and its like.
layout(constant_id = CONSTANT_SCANS) const uint SCANS = KD_SCANS_TRIANGLES;
// The number of sums that an invocation loads before it uses the first, so that no load waits for another.
const uint N_AT_ONCE = 8u;

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_KD_CELLS_FROM) readonly buffer CellsFromBlock { KdCell cells_from[]; };

// The first group of cells after which a capacity would be passed, and the sums before it.
shared uint first_full;
shared uvec3 sums_before_full;

// Returns where the sums begin and how many there are.
uvec2 sums() {
    switch (SCANS) {
        case KD_SCANS_TRIANGLES: return uvec2(0u, blocks_of(build.n_triangles));
        case KD_SCANS_REFERENCES: return uvec2(0u, blocks_of(levels[stage.level_ix].n_references));
        default: return uvec2(build.cell_groups_begin, groups_over(levels[stage.level_ix].n_cells));
    }
}

uvec3 exclusive_add(uvec3 value, out uvec3 total) {
    uvec3 before;
    before.x = workgroup_exclusive_add(value.x, total.x);
    before.y = workgroup_exclusive_add(value.y, total.y);
    before.z = workgroup_exclusive_add(value.z, total.z);
    return before;
}

uvec3 counts_of(uint begin, uint end, uint i) {
    return i < end ? scan_blocks[begin + i].xyz : uvec3(0u);
}

// Whether there is room for the children of all cells up to the end of a group. next_and_after: see
// kdtree_count_cells.comp.
bool has_room(KdLevel level, uvec3 sums, uint next_and_after) {
    return level.n_closed + sums.z + next_and_after <= build.max_references
        && level.n_pairs + sums.x <= build.max_pairs && sums.y <= build.max_cells;
}

void finish_cells(uint cutoff, uvec3 sums) {
    KdLevel level = levels[stage.level_ix];
    uint first_leaf = cutoff < level.n_cells ? cells_from[cutoff].first : level.n_references;
    uvec2 n_sides = sides_before(first_leaf);
    levels[stage.level_ix].cutoff = cutoff;
    levels[stage.level_ix].n_splits = sums.x;
    levels[stage.level_ix].n_open = sums.y;
    levels[stage.level_ix].n_next = n_sides.x + n_sides.y;
    levels[stage.level_ix].n_in_leaves = sums.z + level.n_references - first_leaf;
}

// Finds the first group after which a capacity would be passed. before: the sums before the invocation's groups.
void find_full(uvec2 mine, uint begin, uvec3 before) {
    KdLevel level = levels[stage.level_ix];
    for (uint i = mine.x; i < mine.y; ++i) {
        uvec4 counts = scan_blocks[begin + i];
        before += counts.xyz;
        if (has_room(level, before, counts.w)) continue;
        atomicMin(first_full, i);
        break;
    }
}

void main() {
    uvec2 begin_and_n = sums();
    uint begin = begin_and_n.x, n = begin_and_n.y;
    uint n_each = (n + SCAN_GROUP_SIZE - 1u) / SCAN_GROUP_SIZE;
    uvec2 mine = min(scan_rank() * n_each + uvec2(0u, n_each), uvec2(n));
    if (gl_LocalInvocationIndex == 0u) first_full = 0xffffffffu;
    uvec3 sum = uvec3(0u);
    for (uint first = mine.x; first < mine.y; first += N_AT_ONCE) {
        uvec3 counts[N_AT_ONCE];
        for (uint i = 0u; i < N_AT_ONCE; ++i) counts[i] = counts_of(begin, mine.y, first + i);
        for (uint i = 0u; i < N_AT_ONCE; ++i) sum += counts[i];
    }
    uvec3 total;
    uvec3 before = exclusive_add(sum, total);
    if (SCANS == KD_SCANS_CELLS) find_full(mine, begin, before);
    barrier();
    for (uint first = mine.x; first < mine.y; first += N_AT_ONCE) {
        uvec3 counts[N_AT_ONCE];
        for (uint i = 0u; i < N_AT_ONCE; ++i) counts[i] = counts_of(begin, mine.y, first + i);
        for (uint i = 0u; i < N_AT_ONCE; ++i) {
            if (first + i >= mine.y) break;
            if (first + i == first_full) sums_before_full = before;
            scan_blocks[begin + first + i] = uvec4(before, 0u);
            before += counts[i];
        }
    }
    barrier();
    if (gl_LocalInvocationIndex != 0u) return;
    if (SCANS == KD_SCANS_REFERENCES) {
        levels[stage.level_ix].n_below = total.x;
        levels[stage.level_ix].n_above = total.y;
    }
    if (SCANS == KD_SCANS_CELLS) {
        bool is_full = first_full < n;
        finish_cells(is_full ? first_full * SCAN_GROUP_SIZE : 0xffffffffu, is_full ? sums_before_full : total);
    }
}
