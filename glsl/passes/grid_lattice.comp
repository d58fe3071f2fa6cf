#version 460
#extension GL_GOOGLE_include_directive : require
// Grid, lattice: the only invocation finds the size of the cells of a uniform grid or of the upper level, and
// prepares the first attempt.
// Reads the bounds, n_finite, n_triangles and upper_density of build; writes build's lattice, margin,
// largest_coordinate, n_items, counts and sizes of dispatches.
#include "grid/grid_attempt.glsl"

layout(local_size_x = 1) in;

// The margin as a multiple of the largest coordinate. The margin is at least LEAST_MARGIN, the smallest number that
// is not denormal, so it is never 0. Twin of src/accel/bounds.rs.
const float MARGIN = 1.0 / 131072.0;
const float LEAST_MARGIN = 1.17549435e-38;

// The inverse of `ordered` in grid_bounds.comp.
vec3 from_ordered(uvec3 bits) {
    return uintBitsToFloat(bits ^ mix(uvec3(0xffffffffu), uvec3(0x80000000u), greaterThan(bits, uvec3(0x7fffffffu))));
}

float largest_of(vec3 least, vec3 greatest) {
    vec3 largest = max(abs(least), abs(greatest));
    return max(largest.x, max(largest.y, largest.z));
}

float margin_of(vec3 least, vec3 greatest) {
    precise float margin = MARGIN * largest_of(least, greatest);
    return max(margin, LEAST_MARGIN);
}

void main() {
    vec3 least = vec3(0.0), greatest = vec3(0.0);
    if (build.n_finite > 0u) {
        least = from_ordered(uvec3(build.least_x, build.least_y, build.least_z));
        greatest = from_ordered(uvec3(build.greatest_x, build.greatest_y, build.greatest_z));
    }
    float margin = margin_of(least, greatest);
    precise vec3 below = least - margin;
    precise vec3 above = greatest + margin;
    least = max(below, vec3(-LARGEST));
    greatest = min(above, vec3(LARGEST));
    // No grid has more than 2^30 cells. The lower limit of their size is the margin of the grown box, which is
    // slightly larger than build.margin.
    precise float max_cells = build.upper_density * float(build.n_finite);
    uint n_cells = uint(min(max_cells, 1073741824.0));
    set_upper_lattice(finest_lattice(least, greatest, margin_of(least, greatest), n_cells));
    build.margin = margin;
    build.largest_coordinate = largest_of(least, greatest);
    build.n_items = build.n_triangles;
    build.counts = GRID_COUNTS_COLUMNS;
    size_dispatches();
}
