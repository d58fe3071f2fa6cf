// Where the cells, pairs and references of a level go. Needs the prefix sums over its cells.
#ifndef KDRAY_KD_NEXT
#define KDRAY_KD_NEXT

#include "kdtree_build/kd_sides.glsl"

layout(std430, set = 0, binding = BIND_KD_CELLS_FROM) readonly buffer CellsFromBlock { KdCell cells_from[]; };

// Splits, children with references, and references in leaves of all cells before a group.
uvec3 before_group(uint cell_ix) {
    return scan_blocks[build.cell_groups_begin + cell_ix / SCAN_GROUP_SIZE].xyz;
}

// The same of all cells before a cell.
uvec3 before_cell(KdCell cell, uint cell_ix) {
    return before_group(cell_ix) + uvec3(cell.splits_before, cell.open_before, cell.in_leaves_before);
}

bool is_split(KdCell cell, uint cell_ix) {
    return cell.axis != KD_NO_AXIS && cell_ix < levels[stage.level_ix].cutoff;
}

// References in leaves of all levels, and of this level before those of a cell, which is a leaf itself.
uint in_leaves_before(KdCell cell, uint cell_ix) {
    KdLevel level = levels[stage.level_ix];
    if (cell_ix <= level.cutoff) return level.n_closed + before_cell(cell, cell_ix).z;
    return level.n_closed + before_group(level.cutoff).z + cell.first - cells_from[level.cutoff].first;
}

#endif
