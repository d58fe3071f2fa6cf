// The size of the cells of a uniform grid or of the upper level. Twin of src/accel/grid/lattice.rs. Needs nothing
// before it; includes grid_build.glsl.
#ifndef KDRAY_GRID_SIZE
#define KDRAY_GRID_SIZE

#include "grid/grid_build.glsl"

// The largest finite number.
const float LARGEST = 3.4028235e38;

// The number of all cubes.
uint n_cubes(Lattice lattice) {
    return lattice.n_cells.x * lattice.n_cells.y * lattice.n_cells.z;
}

// The least number of cubes of a size that reach from one side of a box to the other, on each axis. If it is above
// GRID_MAX_RESOLUTION, any number above that is returned.
uvec3 n_cubes_along(vec3 least, vec3 greatest, float cell_size) {
    uvec3 n_too_few = uvec3(0u);
    for (uint step = GRID_MAX_RESOLUTION; step > 0u; step >>= 1u) {
        uvec3 n = n_too_few + step;
        precise vec3 reached = least + vec3(n) * cell_size;
        n_too_few = mix(n_too_few, n, lessThan(reached, greatest));
    }
    return n_too_few + 1u;
}

// The lattice of cubes of a size that fill a box. One cube of the largest size is assumed to fill any box.
Lattice lattice_of_size(vec3 least, vec3 greatest, float cell_size) {
    uvec3 n_cells = cell_size < LARGEST ? n_cubes_along(least, greatest, cell_size) : uvec3(1u);
    return Lattice(least, cell_size, greatest, n_cells);
}

// The lattice of cubes that are twice as long and fill the same box.
Lattice with_doubled_edges(Lattice lattice) {
    precise float cell_size = 2.0 * lattice.cell_size;
    return lattice_of_size(lattice.least, lattice.greatest, min(cell_size, LARGEST));
}

// The lattice of the smallest cubes with which a box has no more than max_cells cubes and no more than
// GRID_MAX_RESOLUTION along an axis. The cubes' edges are no shorter than the margin.
Lattice finest_lattice(vec3 least, vec3 greatest, float margin, uint max_cells) {
    // The bits of positive numbers have the same order as the numbers. The search finds the bits of the largest size
    // that is too small, the highest bit first. The next larger number is the result.
    uint bits = 0u;
    for (uint bit = 1u << 30; bit > 0u; bit >>= 1u) {
        float next = uintBitsToFloat(bits | bit);
        if ((bits | bit) >= 0x7f800000u) continue; // not finite
        Lattice lattice = lattice_of_size(least, greatest, next);
        uvec3 n = lattice.n_cells;
        bool is_coarse = max(n.x, max(n.y, n.z)) <= GRID_MAX_RESOLUTION && n_cubes(lattice) <= max(max_cells, 1u);
        if (next < margin || !is_coarse) bits |= bit;
    }
    return lattice_of_size(least, greatest, min(uintBitsToFloat(bits + 1u), LARGEST));
}

// Stores the lattice of the uniform grid or of the upper level in build.
void set_upper_lattice(Lattice lattice) {
    build.box_min = lattice.least;
    build.cell_size = lattice.cell_size;
    build.box_max = lattice.greatest;
    build.n_cells_x = lattice.n_cells.x;
    build.n_cells_y = lattice.n_cells.y;
    build.n_cells_z = lattice.n_cells.z;
    build.n_upper = n_cubes(lattice);
}

#endif
