#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Kd-tree, choose: finds the cheapest split (src/accel/kdtree/sah.rs) of each cell that is not small. Each bin has
// three planes: through its least begin, its greatest end, and its edge. Those are counted as if all references that
// begin or end in the bin did so on the costlier side, so that no weight is too low. One workgroup per KD_SMALL_CELL
// references: a cell with more references takes the first workgroup whose first reference is the cell's.
// Reads build, levels, references_from; reads and clears large_bins; updates cells_from.
#include "kdtree_build/kd_bins.glsl"
#include "kdtree_build/kd_splits.glsl"
#include "scan.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_KD_BINS) buffer BinsBlock { uint large_bins[]; };

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

// Replaces the best split by that at a position if the latter is better. A plane must be inside the cell.
void consider_at(inout uvec3 best, Areas areas, uint axis, float position, uvec2 n) {
    if (is_inside(areas, position)) consider(best, areas, axis, position, n);
}

// Considers the planes of a bin. before: references that begin before the bin, and that end there.
void consider_bin(inout uvec3 best, Areas areas, uint axis, uint bin, uvec2 before, uint n) {
    uint begins = bins[word_of(axis, BIN_BEGINS, bin)], ends = bins[word_of(axis, BIN_ENDS, bin)];
    uvec2 after = before + uvec2(begins, ends);
    if (begins > 0u) {
        float position = from_ordered(~bins[word_of(axis, BIN_LEAST, bin)]);
        consider_at(best, areas, axis, position, uvec2(before.x, n - before.y));
    }
    if (ends > 0u) {
        float position = from_ordered(bins[word_of(axis, BIN_GREATEST, bin)]);
        consider_at(best, areas, axis, position, uvec2(after.x, n - after.y));
    }
    precise float edge = 4.0 * (0.25 * areas.least + areas.quarter * (float(bin + 1u) / float(KD_BINS)));
    consider_at(best, areas, axis, edge, uvec2(after.x, n - after.y));
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

void main() {
    uint first = index_of_group() * KD_SMALL_CELL;
    bool is_reference = first < levels[stage.level_ix].n_references;
    uint cell_ix = references_from[is_reference ? first : 0u].cell_ix;
    KdCell cell = cells_from[cell_ix];
    bool is_own = is_reference && cell.n_references > KD_SMALL_CELL && first - cell.first < KD_SMALL_CELL;
    // The condition is the same for all invocations of the workgroup.
    if (!is_own) return;
    uvec3 best = NO_SPLIT;
    if (may_split(cell.n_references)) best = best_of(best_of_bins(cell), 0u, gl_NumSubgroups);
    if (gl_LocalInvocationIndex == 0u) write_split(cell_ix, cell.n_references, best);
}
