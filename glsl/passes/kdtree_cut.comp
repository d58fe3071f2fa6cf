#version 460
#extension GL_GOOGLE_include_directive : require
// Kd-tree, cut: completes the prefix sums of each cell, and finds the first cell whose children would pass a capacity.
// One workgroup per block of cells; an invocation tests one cell per row. The minimum is the same in every order.
// Reads build, scan_blocks; updates cells_from and the cutoff of the level.
#include "kdtree_build/kd_build.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_KD_SCAN_BLOCKS) readonly buffer ScanBlocksBlock { uvec4 scan_blocks[]; };
layout(std430, set = 0, binding = BIND_KD_CELLS_FROM) buffer CellsFromBlock { KdCell cells_from[]; };

// Whether there is room for the children of a split, if all cells after it become leaves.
bool has_room(KdCell cell, KdLevel level) {
    uint n_open = (cell.n_below > 0u ? 1u : 0u) + (cell.n_above > 0u ? 1u : 0u);
    uint n_children = cell.above_offset + cell.below_offset + cell.n_above;
    uint n_after = level.n_references - (cell.first + cell.n_references);
    return level.n_closed + cell.in_leaves_before + n_children + n_after <= build.max_references
        && level.n_pairs + cell.splits_before + 1u <= build.max_pairs && cell.open_before + n_open <= build.max_cells;
}

void main() {
    uint block = index_of_group();
    for (uint row = 0u; row < KD_ROWS; ++row) {
        uint cell_ix = block * KD_BLOCK_SIZE + row * SCAN_GROUP_SIZE + gl_LocalInvocationIndex;
        if (cell_ix >= levels[stage.level_ix].n_cells) break;
        uvec3 before = scan_blocks[build.cell_blocks_begin + block].xyz;
        KdCell cell = cells_from[cell_ix];
        cell.splits_before += before.x;
        cell.open_before += before.y;
        cell.in_leaves_before += before.z;
        cells_from[cell_ix] = cell;
        if (cell.axis != KD_NO_AXIS && !has_room(cell, levels[stage.level_ix])) {
            atomicMin(levels[stage.level_ix].cutoff, cell_ix);
        }
    }
}
