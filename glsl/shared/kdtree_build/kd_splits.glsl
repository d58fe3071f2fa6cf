// Candidates for a cell's split, and the choice among them. Ties go to the lower axis, then to the lower plane.
#ifndef KDRAY_KD_SPLITS
#define KDRAY_KD_SPLITS

#include "kdtree_build/kd_areas.glsl"

layout(std430, set = 0, binding = BIND_KD_CELLS_FROM) buffer CellsFromBlock { KdCell cells_from[]; };
layout(std430, set = 0, binding = BIND_KD_REFERENCES_FROM) readonly buffer ReferencesFromBlock {
    KdReference references_from[];
};

// A split: weight, axis and position, as integers that sort like them.
const uvec3 NO_SPLIT = uvec3(0x7f800000u, KD_NO_AXIS, 0xffffffffu);

bool is_before(uvec3 a, uvec3 b) {
    if (a.x != b.x) return a.x < b.x;
    return a.y != b.y ? a.y < b.y : a.z < b.z;
}

bool is_inside(Areas areas, float position) {
    return position > areas.least && position < areas.greatest;
}

// Replaces the best split by that at a position if the latter is better. A plane must be inside the cell.
void consider(inout uvec3 best, Areas areas, uint axis, float position, uvec2 n) {
    if (!is_inside(areas, position)) return;
    uvec3 split = uvec3(floatBitsToUint(weight_of(areas, position, n.x, n.y)), axis, ordered(position));
    if (is_before(split, best)) best = split;
}

// Writes the split of a cell of n references, if it is cheaper than a leaf.
void write_split(uint cell_ix, uint n, uvec3 best) {
    precise float leaf_cost = build.intersection_cost * float(n);
    precise float cost = build.traversal_cost + build.intersection_cost * uintBitsToFloat(best.x);
    bool pays = best.y < KD_NO_AXIS && cost < leaf_cost;
    cells_from[cell_ix].axis = pays ? best.y : KD_NO_AXIS;
    cells_from[cell_ix].position = from_ordered(best.z);
}

#endif
