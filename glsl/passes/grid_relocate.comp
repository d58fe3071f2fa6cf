#version 460
#extension GL_GOOGLE_include_directive : require
// Grid, relocate: makes the indices in a finished grid those of arrays that hold several grids, one after the other.
// One workgroup per block of cells or entries, whichever are more; an invocation changes one of each per row. Here,
// LOWER_LEVEL says whether the grid has a lower level, so that the cells of the upper one lead to blocks of cells. Twin
// of src/buffers/two_level.rs.
// Reads build; updates cells, leaf_triangles.
#include "grid/grid_build.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(push_constant) uniform PlaceBlock { StructurePlace place; };
layout(std430, set = 0, binding = BIND_GRID_CELLS) buffer CellsBlock { GridCell cells[]; };
// Three rows per entry, which make up a LeafTriangle.
layout(std430, set = 0, binding = BIND_GRID_LEAF_TRIANGLES) buffer LeafTrianglesBlock { uvec4 leaf_triangles[]; };

void main() {
    uint begin = block_of_group() * GRID_BLOCK_SIZE + gl_LocalInvocationIndex;
    for (uint row = 0u; row < GRID_ROWS; ++row) {
        uint i = begin + row * SCAN_GROUP_SIZE;
        bool is_block = LOWER_LEVEL && i < build.n_upper;
        if (i < build.n_upper + build.n_lower) cells[i].first += is_block ? place.first_element : place.first_entry;
        if (i < build.n_pairs) leaf_triangles[3u * i].w += place.first_row;
    }
}
