#version 460
#extension GL_GOOGLE_include_directive : require
// Grid, blocks: writes where each upper cell's block of lower cells begins, and the block's resolution. One workgroup
// per GRID_BLOCK_SIZE upper cells; an invocation writes one cell per row.
// Reads build, blocks, scan_blocks; writes cells.
#include "grid/grid_build.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_GRID_BLOCKS) readonly buffer BlocksBlock { uvec2 blocks[]; };
layout(std430, set = 0, binding = BIND_GRID_SCAN_BLOCKS) readonly buffer ScanBlocksBlock { uint scan_blocks[]; };
layout(std430, set = 0, binding = BIND_GRID_CELLS) writeonly buffer CellsBlock { GridCell cells[]; };

void main() {
    uint block = block_of_group();
    for (uint row = 0u; row < GRID_ROWS; ++row) {
        uint cell_ix = block * GRID_BLOCK_SIZE + row * SCAN_GROUP_SIZE + gl_LocalInvocationIndex;
        if (cell_ix >= build.n_upper) break;
        uint first = build.n_upper + scan_blocks[build.cells_begin + block] + blocks[cell_ix].x;
        cells[cell_ix] = GridCell(first, blocks[cell_ix].y);
    }
}
