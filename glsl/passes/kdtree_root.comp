#version 460
#extension GL_GOOGLE_include_directive : require
// Kd-tree, root: the only invocation finds the root's cell and the finest scale, and opens the first level.
// Reads build and scale_counts; writes build, the first of levels and of cells_from.
#include "kdtree_build/kd_build.glsl"

layout(local_size_x = 1) in;
layout(std430, set = 0, binding = BIND_KD_SCALE_COUNTS) readonly buffer ScaleCountsBlock { uint scale_counts[]; };
layout(std430, set = 0, binding = BIND_KD_CELLS_FROM) writeonly buffer CellsFromBlock { KdCell cells_from[]; };

// Twins of src/accel/bounds.rs and of LIMITS and TRIANGLES_PER_NEEDY in src/accel/kdtree/scales.rs.
const float MARGIN = 1.0 / 131072.0;
const float LEAST_MARGIN = 1.17549435e-38;
const float LARGEST = 3.4028235e38;
const float LEAST_WITH_SCALES = 8.2718061e-25; // 2^-80
const float GREATEST_WITH_SCALES = 1.1529215e18; // 2^60
const uint TRIANGLES_PER_NEEDY = 16u;

uint finest_needed(float largest) {
    if (!(largest >= LEAST_WITH_SCALES && largest <= GREATEST_WITH_SCALES)) return 0u;
    uint n_needy = 0u;
    for (uint scale = KD_SCALES - 1u; scale > 0u; --scale) {
        n_needy += scale_counts[scale];
        if (n_needy * TRIANGLES_PER_NEEDY >= build.n_triangles) return scale;
    }
    return 0u;
}

void set_groups() {
    uvec3 one = dispatch_of(1u), references = dispatch_of(groups_over(build.n_finite));
    uvec3 blocks = dispatch_of(blocks_of(build.n_finite));
    uint n_bin_blocks = build.n_finite > KD_BIN_BLOCK ? (build.n_finite + KD_BIN_BLOCK - 1u) / KD_BIN_BLOCK : 0u;
    uvec3 bins = dispatch_of(n_bin_blocks);
    levels[0].bin_groups_x = bins.x;
    levels[0].bin_groups_y = bins.y;
    levels[0].bin_groups_z = 1u;
    levels[0].choose_groups_x = build.n_finite > KD_SMALL_CELL ? 1u : 0u;
    levels[0].choose_groups_y = 1u;
    levels[0].choose_groups_z = 1u;
    levels[0].small_groups_x = build.n_finite > KD_SMALL_CELL ? 0u : references.x;
    levels[0].small_groups_y = references.y;
    levels[0].small_groups_z = 1u;
    levels[0].block_groups_x = blocks.x;
    levels[0].block_groups_y = blocks.y;
    levels[0].block_groups_z = 1u;
    levels[0].reference_groups_x = references.x;
    levels[0].reference_groups_y = references.y;
    levels[0].reference_groups_z = 1u;
    levels[0].cell_groups_x = one.x;
    levels[0].cell_groups_y = one.y;
    levels[0].cell_groups_z = 1u;
}

void main() {
    vec3 least, greatest;
    exact_bounds(least, greatest);
    build.largest = largest_of(least, greatest);
    precise float margin = MARGIN * build.largest;
    build.margin = max(margin, LEAST_MARGIN);
    build.finest = finest_needed(build.largest);
    precise vec3 below = least - build.margin;
    precise vec3 above = greatest + build.margin;
    build.box_min = max(below, vec3(-LARGEST));
    build.box_max = min(above, vec3(LARGEST));
    levels[0].n_cells = 1u;
    levels[0].n_references = build.n_finite;
    levels[0].n_pairs = 1u;
    set_groups();
    KdCell cell;
    cell.box_min = build.box_min;
    cell.first = 0u;
    cell.box_max = build.box_max;
    cell.n_references = build.n_finite;
    cell.node_ix = 0u;
    cell.axis = KD_NO_AXIS;
    cells_from[0] = cell;
}
