#version 460
#extension GL_GOOGLE_include_directive : require
// Grid, emit: writes the pairs of a cell and a triangle, in the order of the columns and their cells. One workgroup
// per block of GRID_BLOCK_SIZE columns; an invocation writes the pairs of one column per row.
// Reads build, triangles, first_columns, first_pairs, scan_blocks, and at the lower level upper_pairs and blocks;
// writes pairs_to.
#include "grid/grid_columns.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_GRID_FIRST_PAIRS) readonly buffer FirstPairsBlock { uint first_pairs[]; };
layout(std430, set = 0, binding = BIND_GRID_PAIRS_TO) writeonly buffer PairsToBlock { uvec2 pairs_to[]; };

// Writes the pairs of a column from pair_ix on.
void emit(uint column_ix, uint pair_ix) {
    Columns columns;
    uvec2 column;
    Item item = item_of(column_ix, columns, column);
    uvec2 cubes = cubes_of(columns, column);
    for (uint i = cubes.x; i < cubes.y; ++i) {
        uvec3 cube = uvec3(column, i);
        if (is_near(columns, cube)) {
            uint cell_ix = item.first_cell + cell_ix_of(item.lattice, axis_back(cube, columns.axis));
            pairs_to[pair_ix] = uvec2(cell_ix, item.triangle_ix);
            pair_ix += 1u;
        }
    }
}

void main() {
    uint block = block_of_group();
    find_end_items(block);
    for (uint row = 0u; row < GRID_ROWS; ++row) {
        uint column_ix = block * GRID_BLOCK_SIZE + row * SCAN_GROUP_SIZE + gl_LocalInvocationIndex;
        if (column_ix < build.n_columns) {
            emit(column_ix, scan_blocks[build.pairs_begin + block] + first_pairs[column_ix]);
        }
    }
}
