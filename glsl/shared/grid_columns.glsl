// Columns by their numbers over all items. A workgroup goes through a block of them, whose items are neighbours.
#ifndef KDRAY_GRID_COLUMNS
#define KDRAY_GRID_COLUMNS

#include "grid_items.glsl"

// The items of the block's first column and of its last one.
shared uint end_items[2];

// Finds the items at both ends of the block. Uniform control flow only.
void find_end_items(uint block) {
    if (gl_LocalInvocationIndex < 2u) {
        uint column_ix = (block + gl_LocalInvocationIndex) * GRID_BLOCK_SIZE - gl_LocalInvocationIndex;
        end_items[gl_LocalInvocationIndex] = item_of_column(column_ix, 0u, build.n_items);
    }
    barrier();
}

// Needs `find_end_items` of the column's block. `column`: the column's place in the box of the item's triangle.
Item item_of(uint column_ix, out Columns columns, out uvec2 column) {
    uint item_ix = item_of_column(column_ix, end_items[0], end_items[1] + 1u);
    Item item = item_at(item_ix);
    columns = columns_of(item);
    column = column_at(columns, column_ix - first_column_of(item_ix));
    return item;
}

#endif
