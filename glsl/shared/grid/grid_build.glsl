// The state of a grid's build, `build`, which its kernels hand to one another (src/passes/grid). The terms of the
// build:
//
//   pair     the index of a cell, and the index of a triangle that comes near to it
//   item     a triangle, and the lattice into whose cells it is sorted (grid_items.glsl)
//   box      of an item: the cells of its lattice that meet its triangle's bounds, which are grown by the margin
//   column   the cells of an item's box that are in a line along one axis (grid_overlap.glsl)
//   block    GRID_BLOCK_SIZE consecutive items, columns, pairs or upper cells, whose sum is one of scan_blocks. A
//            block of lower cells (`blocks`) is something else: the cells that an upper cell is cut into.
//
// Kernels over blocks have workgroups of SCAN_GROUP_SIZE invocations. A workgroup takes one block, in GRID_ROWS rows
// of one entry per invocation.
#ifndef KDRAY_GRID_BUILD
#define KDRAY_GRID_BUILD

#include "layout.glsl"
#include "grid/lattice.glsl"

// Whether the kernel builds the lower level of a grid of two levels.
layout(constant_id = CONSTANT_LOWER_LEVEL) const bool LOWER_LEVEL = false;

layout(std430, set = 0, binding = BIND_GRID_BUILD) buffer BuildBlock { GridBuild build; };

// The uniform grid's lattice, or that of the upper level.
Lattice upper_lattice() {
    uvec3 n_cells = uvec3(build.n_cells_x, build.n_cells_y, build.n_cells_z);
    return Lattice(build.box_min, build.cell_size, build.box_max, n_cells);
}

// The number of blocks of n_entries entries.
uint blocks_of(uint n_entries) {
    return (n_entries + GRID_BLOCK_SIZE - 1u) / GRID_BLOCK_SIZE;
}

// The index of the workgroup's block. In the last row of workgroups, it may be beyond the last block.
uint block_of_group() {
    return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
}

// Whether all components are finite. Tests the bits, since a compiler may assume that no number is NaN.
bool is_finite(vec3 v) {
    return all(notEqual(floatBitsToUint(v) & 0x7f800000u, uvec3(0x7f800000u)));
}

// Whether all corners are finite.
bool is_finite(Triangle triangle) {
    return is_finite(triangle.v0) && is_finite(triangle.v1) && is_finite(triangle.v2);
}

// The sum of the components' magnitudes, which is no less than the length.
float sum_of_magnitudes(vec3 v) {
    precise float sum = abs(v.x) + abs(v.y) + abs(v.z);
    return sum;
}

#endif
