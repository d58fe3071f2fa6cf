#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Kd-tree, choose: finds the cheapest split (src/accel/kdtree/sah.rs) of each cell that is not small. Each bin has
// three planes: through its least begin, its greatest end, and its edge. Those are counted as if all references that
// begin or end in the bin did so on the costlier side, so that no weight is too low. One workgroup per KD_CHOOSE_BLOCK
// references takes one cell after the other. It looks at every KD_SMALL_CELL-th reference, and takes a cell at the
// first of these that belongs to it.
// Reads build, levels, references_from; reads and clears large_bins; updates cells_from.
#include "kdtree_build/kd_bins.glsl"
#include "kdtree_build/kd_splits.glsl"
#include "scan.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_KD_BINS) buffer BinsBlock { uint large_bins[]; };

// The references by which a workgroup finds cells.
const uint N_PROBES = KD_CHOOSE_BLOCK / KD_SMALL_CELL;

// The areas of the cell on each axis.
shared Areas areas[3];
// Begins and ends in the bins of each subgroup's invocations, on each axis.
shared uvec2 in_subgroups[3][SCAN_GROUP_SIZE / 4u];
// The best split of each subgroup.
shared uvec3 best_of_subgroups[SCAN_GROUP_SIZE / 4u];

void fill_bins(KdCell cell) {
    if (scan_rank() < 3u) areas[scan_rank()] = areas_of(cell, scan_rank());
    if (cell.n_references > KD_BIN_BLOCK) {
        uint first_word = cell.first / KD_BIN_BLOCK * KD_BIN_WORDS;
        for (uint i = gl_LocalInvocationIndex; i < KD_BIN_WORDS; i += SCAN_GROUP_SIZE) {
            bins[i] = large_bins[first_word + i];
            large_bins[first_word + i] = 0u;
        }
    } else {
        clear_bins();
        barrier();
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

// The best of all invocations' splits. Needs uniform control flow.
uvec3 best_of(uvec3 mine) {
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

uvec3 best_of_bins(KdCell cell) {
    fill_bins(cell);
    uint bin = scan_rank();
    uvec2 before[3];
    for (uint axis = 0u; axis < 3u; ++axis) {
        uvec2 mine = uvec2(bins[word_of(axis, BIN_BEGINS, bin)], bins[word_of(axis, BIN_ENDS, bin)]);
        before[axis] = subgroupExclusiveAdd(mine);
        if (gl_SubgroupInvocationID == gl_SubgroupSize - 1u) in_subgroups[axis][gl_SubgroupID] = before[axis] + mine;
    }
    barrier();
    uvec3 best = NO_SPLIT;
    for (uint axis = 0u; axis < 3u; ++axis) {
        Areas of_axis = areas[axis];
        if (of_axis.slope < 0.0) continue;
        for (uint i = 0u; i < gl_SubgroupID; ++i) before[axis] += in_subgroups[axis][i];
        consider_bin(best, of_axis, axis, bin, before[axis], cell.n_references);
    }
    return best_of(best);
}

void main() {
    uint begin = index_of_group() * KD_CHOOSE_BLOCK, end = levels[stage.level_ix].n_references;
    uint cells[N_PROBES];
    bool is_own[N_PROBES];
    for (uint i = 0u; i < N_PROBES; ++i) {
        uint reference_ix = begin + i * KD_SMALL_CELL;
        cells[i] = references_from[reference_ix < end ? reference_ix : 0u].cell_ix;
    }
    for (uint i = 0u; i < N_PROBES; ++i) {
        uint reference_ix = begin + i * KD_SMALL_CELL;
        bool is_first = reference_ix - cells_from[cells[i]].first < KD_SMALL_CELL;
        is_own[i] = reference_ix < end && is_first && cells_from[cells[i]].n_references > KD_SMALL_CELL;
    }
    for (uint i = 0u; i < N_PROBES; ++i) {
        // The condition is the same for all invocations of the workgroup.
        if (!is_own[i]) continue;
        KdCell cell = cells_from[cells[i]];
        uvec3 best = may_split(cell.n_references) ? best_of_bins(cell) : NO_SPLIT;
        if (gl_LocalInvocationIndex == 0u) write_split(cells[i], cell.n_references, best);
    }
}
