#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Grid, count: counts the pairs of a cell and a triangle. One workgroup per block of GRID_BLOCK_SIZE columns; an
// invocation tests the cells of one column per row.
// Reads build, triangles, first_columns, scan_blocks, and at the lower level upper_pairs and blocks; writes
// first_pairs and the block's sum in scan_blocks.
#include "grid/grid_columns.glsl"
#include "scan.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
// For each column: the index of its first pair among those of its block of GRID_BLOCK_SIZE columns.
layout(std430, set = 0, binding = BIND_GRID_FIRST_PAIRS) writeonly buffer FirstPairsBlock { uint first_pairs[]; };

uint n_pairs_of(uint column_ix) {
    Columns columns;
    uvec2 column;
    item_of(column_ix, columns, column);
    uvec2 cubes = cubes_of(columns, column);
    uint n = 0u;
    for (uint i = cubes.x; i < cubes.y; ++i) n += is_near(columns, uvec3(column, i)) ? 1u : 0u;
    return n;
}

void main() {
    uint block = block_of_group();
    find_end_items(block);
    uint sum = 0u;
    for (uint row = 0u; row < GRID_ROWS; ++row) {
        uint column_ix = block * GRID_BLOCK_SIZE + row * SCAN_GROUP_SIZE + scan_rank();
        bool is_column = column_ix < build.n_columns;
        uint total;
        uint before = sum + workgroup_exclusive_add(is_column ? n_pairs_of(column_ix) : 0u, total);
        if (is_column) first_pairs[column_ix] = before;
        sum += total;
    }
    if (gl_LocalInvocationIndex == 0u && block < blocks_of(build.n_columns)) {
        scan_blocks[build.pairs_begin + block] = sum;
    }
}
