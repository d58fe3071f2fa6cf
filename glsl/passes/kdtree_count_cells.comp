#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Kd-tree, count cells: counts the references of the cells' children, and the splits, the children with references and
// the references in leaves of each group of cells. One workgroup per group of cells.
// Reads build, levels, sides; updates cells_from; writes scan_blocks.
#include "kdtree_build/kd_sides.glsl"
#include "scan.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_KD_CELLS_FROM) buffer CellsFromBlock { KdCell cells_from[]; };

// Counts the children's references. Returns the splits and, in the upper half, the children with references; and the
// references in leaves.
uvec2 count(uint cell_ix) {
    KdCell cell = cells_from[cell_ix];
    if (cell.axis == KD_NO_AXIS) return uvec2(0u, cell.n_references);
    uvec2 begin = sides_before(cell.first), end = sides_before(cell.first + cell.n_references);
    uvec2 n = end - begin;
    cells_from[cell_ix].n_below = n.x;
    cells_from[cell_ix].n_above = n.y;
    cells_from[cell_ix].below_offset = begin.y;
    cells_from[cell_ix].above_offset = end.x;
    uint n_open = (n.x > 0u ? 1u : 0u) + (n.y > 0u ? 1u : 0u);
    return uvec2(1u | n_open << 16, 0u);
}

// The references that the next level has from the cells up to one, and those of all cells after it.
uint next_and_after(uint cell_ix) {
    uint end = cells_from[cell_ix].first + cells_from[cell_ix].n_references;
    uvec2 n_sides = sides_before(end);
    return n_sides.x + n_sides.y + levels[stage.level_ix].n_references - end;
}

void main() {
    uint n_cells = levels[stage.level_ix].n_cells;
    uint begin = min(index_of_group() * SCAN_GROUP_SIZE, n_cells), end = min(begin + SCAN_GROUP_SIZE, n_cells);
    uint cell_ix = begin + scan_rank();
    uvec2 counts = uvec2(0u), total, before;
    if (cell_ix < end) counts = count(cell_ix);
    before.x = workgroup_exclusive_add(counts.x, total.x);
    before.y = workgroup_exclusive_add(counts.y, total.y);
    if (cell_ix < end) {
        uvec2 halves = halves_of(before.x);
        cells_from[cell_ix].splits_before = halves.x;
        cells_from[cell_ix].open_before = halves.y;
        cells_from[cell_ix].in_leaves_before = before.y;
    }
    if (gl_LocalInvocationIndex == 0u && begin < end) {
        scan_blocks[build.cell_groups_begin + index_of_group()] =
            uvec4(halves_of(total.x), total.y, next_and_after(end - 1u));
    }
}
