#version 460
#extension GL_GOOGLE_include_directive : require
// Kd-tree, choose small: finds the cheapest split of each small cell (src/accel/kdtree/sah.rs). Every plane through a
// side of a reference's bounds is tried. One workgroup per group of references, for the small cells that begin there.
// An invocation tries the planes of one reference, and of a second one if the last cell reaches beyond the group.
// Reads build, levels, references_from; updates cells_from.
#include "kdtree_build/kd_splits.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;

// A workgroup looks at so many references for each invocation: its cells lie among these.
const uint N_ROWS = 2u;
const uint NO_CELL = 0xffffffffu;

// The begin and the end of each reference of the workgroup's cells, on each axis.
shared vec2 sides[N_ROWS * SCAN_GROUP_SIZE][3];
// The best split of each cell, at the place of its first reference: weight, axis and position, as integers that sort
// like them.
shared uint best_weights[SCAN_GROUP_SIZE];
shared uint best_axes[SCAN_GROUP_SIZE];
shared uint best_positions[SCAN_GROUP_SIZE];

// The index of a reference's cell, NO_CELL if the cell is not one of the workgroup's.
uint own_cell(uint begin, uint reference_ix) {
    if (reference_ix >= levels[stage.level_ix].n_references) return NO_CELL;
    uint cell_ix = references_from[reference_ix].cell_ix;
    uint first = cells_from[cell_ix].first;
    bool begins_here = first >= begin && first < begin + SCAN_GROUP_SIZE;
    return begins_here && cells_from[cell_ix].n_references <= KD_SMALL_CELL ? cell_ix : NO_CELL;
}

// The best of the planes through a reference's sides. first: the place of the cell's first reference.
uvec3 best_of_planes(KdCell cell, uint first, uint place) {
    uvec2 at_begin[3] = uvec2[3](uvec2(0u), uvec2(0u), uvec2(0u)), at_end[3] = at_begin;
    for (uint k = first; k < first + cell.n_references; ++k) {
        for (uint axis = 0u; axis < 3u; ++axis) {
            vec2 planes = sides[place][axis], other = sides[k][axis];
            at_begin[axis] += uvec2(other.x < planes.x ? 1u : 0u, other.y > planes.x ? 1u : 0u);
            at_end[axis] += uvec2(other.x < planes.y ? 1u : 0u, other.y > planes.y ? 1u : 0u);
        }
    }
    uvec3 best = NO_SPLIT;
    for (uint axis = 0u; axis < 3u; ++axis) {
        Areas areas = areas_of(cell, axis);
        vec2 planes = sides[place][axis];
        if (areas.slope < 0.0) continue;
        consider(best, areas, axis, planes.x, at_begin[axis]);
        consider(best, areas, axis, planes.y, at_end[axis]);
    }
    return best;
}

void main() {
    uint rank = gl_LocalInvocationIndex, begin = index_of_group() * SCAN_GROUP_SIZE;
    best_weights[rank] = NO_SPLIT.x;
    best_axes[rank] = NO_SPLIT.y;
    best_positions[rank] = NO_SPLIT.z;
    uint cells[N_ROWS];
    for (uint row = 0u; row < N_ROWS; ++row) {
        uint place = row * SCAN_GROUP_SIZE + rank;
        cells[row] = own_cell(begin, begin + place);
        if (cells[row] == NO_CELL) continue;
        vec3 low = references_from[begin + place].box_min, high = references_from[begin + place].box_max;
        for (uint axis = 0u; axis < 3u; ++axis) sides[place][axis] = vec2(low[axis], high[axis]);
    }
    barrier();
    uvec3 best[N_ROWS];
    uint firsts[N_ROWS];
    for (uint row = 0u; row < N_ROWS; ++row) {
        best[row] = NO_SPLIT;
        firsts[row] = 0u;
        if (cells[row] == NO_CELL) continue;
        KdCell cell = cells_from[cells[row]];
        firsts[row] = cell.first - begin;
        if (may_split(cell.n_references)) best[row] = best_of_planes(cell, firsts[row], row * SCAN_GROUP_SIZE + rank);
        atomicMin(best_weights[firsts[row]], best[row].x);
    }
    barrier();
    for (uint row = 0u; row < N_ROWS; ++row) {
        if (best[row].x == best_weights[firsts[row]]) atomicMin(best_axes[firsts[row]], best[row].y);
    }
    barrier();
    for (uint row = 0u; row < N_ROWS; ++row) {
        bool is_best = best[row].x == best_weights[firsts[row]] && best[row].y == best_axes[firsts[row]];
        if (is_best) atomicMin(best_positions[firsts[row]], best[row].z);
    }
    barrier();
    if (cells[0] == NO_CELL || firsts[0] != rank) return;
    uvec3 of_cell = uvec3(best_weights[rank], best_axes[rank], best_positions[rank]);
    write_split(cells[0], cells_from[cells[0]].n_references, of_cell);
}
