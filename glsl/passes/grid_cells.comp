#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Grid, cells: one workgroup per block of GRID_BLOCK_SIZE pairs, which are sorted by their cells. The invocation at a
// cell's first pair writes where the cell's entries begin and how many there are. Entries have the indices of their
// pairs (grid_leaves.comp). All other cells have been cleared.
// Atomics count the cells that have entries; the sum is the same in every order.
// Reads build, pairs_from; writes cells and n_filled_* of build.
#include "grid/grid_build.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_GRID_PAIRS_FROM) readonly buffer PairsFromBlock { uvec2 pairs_from[]; };
layout(std430, set = 0, binding = BIND_GRID_CELLS) writeonly buffer CellsBlock { GridCell cells[]; };

// Returns the index one beyond the last pair of a cell. The search doubles its step as long as the pairs are of the
// cell, and then bisects the last step.
uint end_of_cell(uint cell_ix, uint first) {
    uint low = first, step = 1u;
    while (low + step < build.n_pairs && pairs_from[low + step].x == cell_ix) {
        low += step;
        step *= 2u;
    }
    uint high = min(low + step, build.n_pairs);
    while (high - low > 1u) {
        uint middle = (low + high) / 2u;
        if (pairs_from[middle].x == cell_ix) low = middle; else high = middle;
    }
    return high;
}

void main() {
    uint n_filled = 0u;
    uint begin = block_of_group() * GRID_BLOCK_SIZE + gl_LocalInvocationIndex;
    for (uint row = 0u; row < GRID_ROWS; ++row) {
        uint entry_ix = begin + row * SCAN_GROUP_SIZE;
        if (entry_ix >= build.n_pairs) break;
        uint cell_ix = pairs_from[entry_ix].x;
        if (entry_ix > 0u && pairs_from[entry_ix - 1u].x == cell_ix) continue;
        uint count = end_of_cell(cell_ix, entry_ix) - entry_ix;
        cells[cell_ix + (LOWER_LEVEL ? build.n_upper : 0u)] = GridCell(entry_ix, count);
        n_filled += 1u;
    }
    n_filled = subgroupAdd(n_filled);
    if (!subgroupElect() || n_filled == 0u) return;
    if (LOWER_LEVEL) atomicAdd(build.n_filled_lower, n_filled);
    else atomicAdd(build.n_filled_upper, n_filled);
}
