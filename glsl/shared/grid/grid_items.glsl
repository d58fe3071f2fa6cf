// The items of a level, each a triangle and the lattice into whose cells it is sorted. At the upper level, each
// triangle is an item; at the lower level, each pair of the upper level is. The box of an item is cut into columns of
// cells, whose indices are consecutive over all items. Needs nothing before it; includes grid_build.glsl and
// grid_overlap.glsl.
#ifndef KDRAY_GRID_ITEMS
#define KDRAY_GRID_ITEMS

#include "grid/grid_build.glsl"
#include "grid/grid_overlap.glsl"

layout(std430, set = 0, binding = BIND_GRID_TRIANGLES) readonly buffer TrianglesBlock { Triangle triangles[]; };
// The pairs of the upper level: a cell's index and a triangle's.
layout(std430, set = 0, binding = BIND_GRID_UPPER_PAIRS) readonly buffer UpperPairsBlock { uvec2 upper_pairs[]; };
// For each upper cell, x is the index of its first lower cell, counted from the first lower cell of all those upper
// cells that share its sum in scan_blocks. y is the number of its lower cells along each axis.
layout(std430, set = 0, binding = BIND_GRID_BLOCKS) readonly buffer BlocksBlock { uvec2 blocks[]; };
// For each item: the index of its first column, counted from the first column of its block of GRID_BLOCK_SIZE items.
layout(std430, set = 0, binding = BIND_GRID_FIRST_COLUMNS) buffer FirstColumnsBlock { uint first_columns[]; };
// The sums of blocks. The scan replaces each by the sum of all blocks before it.
layout(std430, set = 0, binding = BIND_GRID_SCAN_BLOCKS) buffer ScanBlocksBlock { uint scan_blocks[]; };

// first_cell: the index of the lattice's first cell at its level.
struct Item {
    uint triangle_ix;
    uint first_cell;
    Lattice lattice;
};

// The indices of the cube of a cell (the inverse of `cell_ix_of`).
uvec3 cube_at(Lattice lattice, uint cell_ix) {
    uvec2 n = lattice.n_cells.xy;
    return uvec3(cell_ix % n.x, cell_ix / n.x % n.y, cell_ix / n.x / n.y);
}

Item upper_item(uint triangle_ix) {
    return Item(triangle_ix, 0u, upper_lattice());
}

Item lower_item(uvec2 pair) {
    uvec2 block = blocks[pair.x];
    uint first_cell = scan_blocks[build.cells_begin + pair.x / GRID_BLOCK_SIZE] + block.x;
    Lattice upper = upper_lattice();
    return Item(pair.y, first_cell, lattice_within(upper, cube_at(upper, pair.x), block.y));
}

Item item_at(uint item_ix) {
    if (LOWER_LEVEL) return lower_item(upper_pairs[item_ix]);
    return upper_item(item_ix);
}

Columns columns_of(Item item) {
    return columns_of(item.lattice, triangles[item.triangle_ix], build.margin);
}

// The index of an item's first column among all columns.
uint first_column_of(uint item_ix) {
    return scan_blocks[build.columns_begin + item_ix / GRID_BLOCK_SIZE] + first_columns[item_ix];
}

// The item of a column, searched in [low, high): the last item whose first column is this one or an earlier one. An
// item without columns has the same first column as the item after it, so it is not the last.
uint item_of_column(uint column_ix, uint low, uint high) {
    while (high - low > 1u) {
        uint middle = (low + high) / 2u;
        if (first_column_of(middle) <= column_ix) low = middle; else high = middle;
    }
    return low;
}

#endif
