// Access to columns by their indices, which are consecutive over all items. Each workgroup takes a block of columns,
// whose items are consecutive, too. Needs nothing before it; includes grid_items.glsl.
#ifndef KDRAY_GRID_COLUMNS
#define KDRAY_GRID_COLUMNS

#include "grid/grid_items.glsl"

// The indices of the items of the block's first and last column.
shared uint end_items[2];

// Finds the items at both ends of the block. Needs uniform control flow.
void find_end_items(uint block) {
    if (gl_LocalInvocationIndex < 2u) {
        uint column_ix = (block + gl_LocalInvocationIndex) * GRID_BLOCK_SIZE - gl_LocalInvocationIndex;
        end_items[gl_LocalInvocationIndex] = item_of_column(column_ix, 0u, build.n_items);
    }
    barrier();
}

// Returns the item of a column. Needs `find_end_items` for the column's block. columns: those of the item. column:
// the column's cube indices on the first two axes of `columns`.
Item item_of(uint column_ix, out Columns columns, out uvec2 column) {
    uint item_ix = item_of_column(column_ix, end_items[0], end_items[1] + 1u);
    Item item = item_at(item_ix);
    columns = columns_of(item);
    column = column_at(columns, column_ix - first_column_of(item_ix));
    return item;
}

#endif
