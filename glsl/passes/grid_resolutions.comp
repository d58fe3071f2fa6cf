#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Grid, resolutions: determines into how many lower cells each upper cell is cut along each axis. One workgroup per
// block of GRID_BLOCK_SIZE upper cells; an invocation takes one cell per row.
// Reads build, cells; writes blocks and, in scan_blocks, the number of lower cells of the block.
#include "grid/grid_build.glsl"
#include "scan.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_GRID_CELLS) readonly buffer CellsBlock { GridCell cells[]; };
layout(std430, set = 0, binding = BIND_GRID_BLOCKS) writeonly buffer BlocksBlock { uvec2 blocks[]; };
layout(std430, set = 0, binding = BIND_GRID_SCAN_BLOCKS) writeonly buffer ScanBlocksBlock { uint scan_blocks[]; };

// Whether a block of `resolution` cells along each axis has no more than max_cells, and none smaller than the margin.
bool fits(uint resolution, float max_cells) {
    float n_cells = float(resolution * resolution * resolution);
    return n_cells <= max_cells && cell_size_within(upper_lattice(), resolution) >= build.margin;
}

// The resolution of an upper cell with n_triangles. It is the finest one that fits (twin of `finest_resolution` in
// src/accel/grid/build.rs), halved build.n_halvings times after attempts that exceeded a limit.
uint resolution_for(uint n_triangles) {
    precise float max_cells = build.lower_density * float(n_triangles);
    uint finest = 1u;
    while (finest < GRID_MAX_BLOCK_RESOLUTION && fits(finest + 1u, max_cells)) ++finest;
    return n_triangles == 0u ? 0u : max(finest >> build.n_halvings, 1u);
}

void main() {
    uint block = block_of_group();
    uint sum = 0u;
    for (uint row = 0u; row < GRID_ROWS; ++row) {
        uint cell_ix = block * GRID_BLOCK_SIZE + row * SCAN_GROUP_SIZE + scan_rank();
        bool is_cell = cell_ix < build.n_upper;
        uint resolution = is_cell ? resolution_for(cells[cell_ix].count) : 0u;
        uint total;
        uint before = sum + workgroup_exclusive_add(resolution * resolution * resolution, total);
        if (is_cell) blocks[cell_ix] = uvec2(before, resolution);
        sum += total;
    }
    if (gl_LocalInvocationIndex == 0u && block < blocks_of(build.n_upper)) {
        scan_blocks[build.cells_begin + block] = sum;
    }
}
