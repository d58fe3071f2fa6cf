#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Grid, columns: counts the columns of cells in the items' boxes. One workgroup per block of GRID_BLOCK_SIZE items;
// an invocation counts those of one item per row.
// Reads build, triangles, and at the lower level upper_pairs, blocks and scan_blocks; writes first_columns and the
// block's sum in scan_blocks.
#include "grid/grid_items.glsl"
#include "scan.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;

// A triangle with a corner that is not finite is in no cell.
uint n_columns_of_item(uint item_ix) {
    Item item = item_at(item_ix);
    Triangle triangle = triangles[item.triangle_ix];
    return is_finite(triangle) ? n_columns_of(columns_of(item)) : 0u;
}

void main() {
    uint block = block_of_group();
    uint sum = 0u;
    for (uint row = 0u; row < GRID_ROWS; ++row) {
        uint item_ix = block * GRID_BLOCK_SIZE + row * SCAN_GROUP_SIZE + scan_rank();
        bool is_item = item_ix < build.n_items;
        uint n_columns = is_item ? n_columns_of_item(item_ix) : 0u;
        uint total;
        uint before = sum + workgroup_exclusive_add(n_columns, total);
        if (is_item) first_columns[item_ix] = before;
        sum += total;
    }
    if (gl_LocalInvocationIndex == 0u && block < blocks_of(build.n_items)) {
        scan_blocks[build.columns_begin + block] = sum;
    }
}
