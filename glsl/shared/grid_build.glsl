// The state of a grid's build, which its kernels hand to one another (src/passes/grid). Kernels that go through entries
// have workgroups of SCAN_GROUP_SIZE invocations, each of which takes a block of GRID_BLOCK_SIZE entries in GRID_ROWS
// rows.
#ifndef KDRAY_GRID_BUILD
#define KDRAY_GRID_BUILD

#include "layout.glsl"
#include "lattice.glsl"

// Whether the kernel builds the lower level of a grid of two levels.
layout(constant_id = CONSTANT_LOWER) const bool LOWER = false;

layout(std430, set = 0, binding = BIND_GRID_BUILD) buffer BuildBlock { GridBuild build; };

// The uniform grid's lattice, or that of the upper level.
Lattice upper_lattice() {
    uvec3 n_cells = uvec3(build.n_cells_x, build.n_cells_y, build.n_cells_z);
    return Lattice(build.cell_min, build.cell_size, build.cell_max, n_cells);
}

uint blocks_of(uint n_entries) {
    return (n_entries + GRID_BLOCK_SIZE - 1u) / GRID_BLOCK_SIZE;
}

// The number of the workgroup's block. The last row of workgroups may go beyond the last block.
uint block_of_group() {
    return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
}

bool is_finite(vec3 v) {
    return all(notEqual(floatBitsToUint(v) & 0x7f800000u, uvec3(0x7f800000u)));
}

// Of bits: a compiler may take it that no number is NaN.
bool is_finite(Triangle triangle) {
    return is_finite(triangle.v0) && is_finite(triangle.v1) && is_finite(triangle.v2);
}

#endif
