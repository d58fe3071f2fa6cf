// Attempts to build a level. Each attempt counts the columns of the level's items and then the pairs of a cell and a
// triangle; at the lower level it counts the cells first. If a count is above its limit, the next attempt has larger
// cells. Once everything is counted, the kernels of further attempts get no workgroups. Twin of
// src/accel/grid/build.rs. Needs nothing before it; includes grid_build.glsl and grid_size.glsl.
#ifndef KDRAY_GRID_ATTEMPT
#define KDRAY_GRID_ATTEMPT

#include "grid/grid_build.glsl"
#include "grid/grid_size.glsl"

// The size of a dispatch of n_groups workgroups, in rows of at most GRID_GROUPS_X.
uvec2 groups_for(uint n_groups) {
    return uvec2(min(n_groups, GRID_GROUPS_X), (n_groups + GRID_GROUPS_X - 1u) / GRID_GROUPS_X);
}

// Sizes the dispatches that follow. Of the kernels that count, only those that count what is next (build.counts) get
// workgroups. The kernels after the attempts get workgroups only once everything is counted.
void size_dispatches() {
    uvec2 cells = groups_for(build.counts == GRID_COUNTS_CELLS ? blocks_of(build.n_upper) : 0u);
    uvec2 items = groups_for(build.counts == GRID_COUNTS_COLUMNS ? blocks_of(build.n_items) : 0u);
    uvec2 columns = groups_for(build.counts == GRID_COUNTS_PAIRS ? blocks_of(build.n_columns) : 0u);
    build.cell_groups_x = cells.x;
    build.cell_groups_y = cells.y;
    build.item_groups_x = items.x;
    build.item_groups_y = items.y;
    build.column_groups_x = columns.x;
    build.column_groups_y = columns.y;
    bool is_counted = build.counts == GRID_IS_COUNTED;
    uvec2 counted_columns = groups_for(is_counted ? blocks_of(build.n_columns) : 0u);
    uvec2 counted_pairs = groups_for(is_counted ? blocks_of(build.n_pairs) : 0u);
    uvec2 counted_cells = groups_for(is_counted ? blocks_of(build.n_upper) : 0u);
    build.counted_column_groups_x = counted_columns.x;
    build.counted_column_groups_y = counted_columns.y;
    build.counted_pair_groups_x = counted_pairs.x;
    build.counted_pair_groups_y = counted_pairs.y;
    build.counted_cell_groups_x = counted_cells.x;
    build.counted_cell_groups_y = counted_cells.y;
    uint n_blocks = is_counted ? blocks_of(build.n_pairs) : 0u;
    build.blocks_per_group = max((n_blocks + GRID_MAX_SORT_GROUPS - 1u) / GRID_MAX_SORT_GROUPS, 1u);
    build.sort_groups_x = (n_blocks + build.blocks_per_group - 1u) / build.blocks_per_group;
    build.sort_groups_y = 1u;
}

// The number of times that the cells' edges are doubled after an attempt whose count is above its limit. Each
// doubling reduces the number of cells that a surface meets to about a quarter. Each attempt that failed before this
// one adds one more doubling; build.n_attempts already includes this one. The last attempt has the largest cells
// possible.
uint n_doublings(uint count, uint limit) {
    if (build.n_attempts + 1u >= GRID_MAX_ATTEMPTS) return 32u;
    uint expected = 1u;
    while (expected < 15u && count >> (2u * expected) > limit) ++expected;
    return expected + build.n_attempts - 1u;
}

// Ends an attempt whose count is above its limit, and makes the cells of the next one larger.
void coarsen(uint count, uint limit) {
    build.n_attempts += 1u;
    uint steps = n_doublings(count, limit);
    if (LOWER_LEVEL) {
        build.n_halvings = min(build.n_halvings + steps, GRID_MAX_HALVINGS);
        build.counts = GRID_COUNTS_CELLS;
        return;
    }
    Lattice lattice = upper_lattice();
    for (uint i = 0u; i < steps && n_cubes(lattice) > 1u; ++i) {
        lattice = with_doubled_edges(lattice);
        build.n_coarser += 1u;
    }
    set_upper_lattice(lattice);
    build.counts = GRID_COUNTS_COLUMNS;
}

#endif
