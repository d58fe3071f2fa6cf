#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Kd-tree, choose: one workgroup per cell finds the cheapest split (src/accel/kdtree/sah.rs). In a small cell, every
// plane through a side of a reference's bounds is tried. In other cells, each bin has three planes: through its least
// begin, its greatest end, and its edge. Those are counted as if all references that begin or end in the bin did so on
// the costlier side, so that no weight is too low. Ties go to the lower axis, then to the lower plane.
// Reads build, levels, references_from; reads and clears large_bins; updates cells_from.
#include "kdtree_build/kd_bins.glsl"
#include "scan.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_KD_CELLS_FROM) buffer CellsFromBlock { KdCell cells_from[]; };
layout(std430, set = 0, binding = BIND_KD_REFERENCES_FROM) readonly buffer ReferencesFromBlock {
    KdReference references_from[];
};
layout(std430, set = 0, binding = BIND_KD_BINS) buffer BinsBlock { uint large_bins[]; };

// The best split of a subgroup: weight, axis and position, as integers that sort like them.
shared uvec3 best_of_subgroups[SCAN_GROUP_SIZE / 4u];
shared vec3 least[KD_SMALL_CELL];
shared vec3 greatest[KD_SMALL_CELL];

const uvec3 NO_SPLIT = uvec3(0x7f800000u, KD_NO_AXIS, 0xffffffffu);

bool is_before(uvec3 a, uvec3 b) {
    if (a.x != b.x) return a.x < b.x;
    return a.y != b.y ? a.y < b.y : a.z < b.z;
}

// Replaces the best split by that at a position if the latter is better. A plane must be inside the cell.
void consider(inout uvec3 best, Areas areas, uint axis, float position, uvec2 n) {
    if (!(position > areas.least && position < areas.greatest)) return;
    uvec3 split = uvec3(floatBitsToUint(weight_of(areas, position, n.x, n.y)), axis, ordered(position));
    if (is_before(split, best)) best = split;
}

uvec3 best_of_small(KdCell cell) {
    uint n = cell.n_references;
    for (uint i = gl_LocalInvocationIndex; i < n; i += SCAN_GROUP_SIZE) {
        least[i] = references_from[cell.first + i].box_min;
        greatest[i] = references_from[cell.first + i].box_max;
    }
    barrier();
    uvec3 best = NO_SPLIT;
    for (uint i = gl_LocalInvocationIndex; i < 6u * n; i += SCAN_GROUP_SIZE) {
        uint axis = i / (2u * n), side = i - axis * 2u * n;
        float position = side < n ? least[side][axis] : greatest[side - n][axis];
        Areas areas = areas_of(cell, axis);
        if (areas.slope < 0.0) continue;
        uvec2 counts = uvec2(0u);
        for (uint k = 0u; k < n; ++k) {
            counts += uvec2(least[k][axis] < position ? 1u : 0u, greatest[k][axis] > position ? 1u : 0u);
        }
        consider(best, areas, axis, position, counts);
    }
    return best;
}

void fill_bins(KdCell cell) {
    if (cell.n_references > KD_BIN_BLOCK) {
        uint first_word = cell.first / KD_BIN_BLOCK * KD_BIN_WORDS;
        for (uint i = gl_LocalInvocationIndex; i < KD_BIN_WORDS; i += SCAN_GROUP_SIZE) {
            bins[i] = large_bins[first_word + i];
            large_bins[first_word + i] = 0u;
        }
    } else {
        clear_bins();
        barrier();
        Areas areas[3] = Areas[3](areas_of(cell, 0u), areas_of(cell, 1u), areas_of(cell, 2u));
        for (uint i = gl_LocalInvocationIndex; i < cell.n_references; i += SCAN_GROUP_SIZE) {
            count_in_bins(areas, references_from[cell.first + i].box_min, references_from[cell.first + i].box_max);
        }
    }
    barrier();
}

// Considers the planes of a bin. before: references that begin before the bin, and that end there.
void consider_bin(inout uvec3 best, Areas areas, uint axis, uint bin, uvec2 before, uint n) {
    uint begins = bins[word_of(axis, BIN_BEGINS, bin)], ends = bins[word_of(axis, BIN_ENDS, bin)];
    uvec2 after = before + uvec2(begins, ends);
    if (begins > 0u) {
        float position = from_ordered(~bins[word_of(axis, BIN_LEAST, bin)]);
        consider(best, areas, axis, position, uvec2(before.x, n - before.y));
    }
    if (ends > 0u) {
        float position = from_ordered(bins[word_of(axis, BIN_GREATEST, bin)]);
        consider(best, areas, axis, position, uvec2(after.x, n - after.y));
    }
    precise float edge = 4.0 * (0.25 * areas.least + areas.quarter * (float(bin + 1u) / float(KD_BINS)));
    consider(best, areas, axis, edge, uvec2(after.x, n - after.y));
}

uvec3 best_of_bins(KdCell cell) {
    fill_bins(cell);
    uvec3 best = NO_SPLIT;
    for (uint axis = 0u; axis < 3u; ++axis) {
        Areas areas = areas_of(cell, axis);
        uint bin = 2u * scan_rank();
        uvec2 first = uvec2(bins[word_of(axis, BIN_BEGINS, bin)], bins[word_of(axis, BIN_ENDS, bin)]);
        uvec2 second = uvec2(bins[word_of(axis, BIN_BEGINS, bin + 1u)], bins[word_of(axis, BIN_ENDS, bin + 1u)]);
        uvec2 total;
        uvec2 before;
        before.x = workgroup_exclusive_add(first.x + second.x, total.x);
        before.y = workgroup_exclusive_add(first.y + second.y, total.y);
        if (areas.slope < 0.0) continue;
        consider_bin(best, areas, axis, bin, before, cell.n_references);
        consider_bin(best, areas, axis, bin + 1u, before + first, cell.n_references);
    }
    return best;
}

// The best of the splits of all invocations.
uvec3 best_of_group(uvec3 mine) {
    uvec3 best;
    best.x = subgroupMin(mine.x);
    best.y = subgroupMin(mine.x == best.x ? mine.y : 0xffffffffu);
    best.z = subgroupMin(mine.xy == best.xy ? mine.z : 0xffffffffu);
    if (subgroupElect()) best_of_subgroups[gl_SubgroupID] = best;
    barrier();
    for (uint i = 0u; i < gl_NumSubgroups; ++i) {
        if (is_before(best_of_subgroups[i], best)) best = best_of_subgroups[i];
    }
    return best;
}

void main() {
    uint cell_ix = index_of_group();
    bool is_cell = cell_ix < levels[stage.level_ix].n_cells;
    KdCell cell = cells_from[is_cell ? cell_ix : 0u];
    uvec3 best = NO_SPLIT;
    // The condition is the same for all invocations of the workgroup.
    if (is_cell && may_split(cell.n_references)) {
        best = cell.n_references <= KD_SMALL_CELL ? best_of_small(cell) : best_of_bins(cell);
        best = best_of_group(best);
    }
    precise float leaf_cost = build.intersection_cost * float(cell.n_references);
    precise float cost = build.traversal_cost + build.intersection_cost * uintBitsToFloat(best.x);
    bool pays = best.y < KD_NO_AXIS && cost < leaf_cost;
    if (gl_LocalInvocationIndex != 0u || !is_cell) return;
    cells_from[cell_ix].axis = pays ? best.y : KD_NO_AXIS;
    cells_from[cell_ix].position = from_ordered(best.z);
}
