// Where the cells, pairs and references of a level go, once its cutoff is known.
#ifndef KDRAY_KD_NEXT
#define KDRAY_KD_NEXT

#include "kdtree_build/kd_build.glsl"

layout(std430, set = 0, binding = BIND_KD_CELLS_FROM) readonly buffer CellsFromBlock { KdCell cells_from[]; };

bool is_split(KdCell cell, uint cell_ix) {
    return cell.axis != KD_NO_AXIS && cell_ix < levels[stage.level_ix].cutoff;
}

// References in leaves of the level before those of a cell, which is a leaf itself.
uint in_leaves_before(KdCell cell, uint cell_ix) {
    uint cutoff = levels[stage.level_ix].cutoff;
    if (cell_ix <= cutoff) return cell.in_leaves_before;
    KdCell first_leaf = cells_from[cutoff];
    return first_leaf.in_leaves_before + cell.first - first_leaf.first;
}

#endif
