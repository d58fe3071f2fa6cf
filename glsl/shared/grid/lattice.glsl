// Lattices: adjacent cubes that fill a box from its least corner on. A lattice's cubes are the cells of a grid, or
// those of a block of its lower level. At the greatest corner, the box may cut some of them. Twin of
// src/accel/grid/lattice.rs, with the same results to the last bit, except for `cube_near`, which is an estimate.
#ifndef KDRAY_LATTICE
#define KDRAY_LATTICE

#include "layout.glsl"

// least, greatest: the box's corners, world units. cell_size: the length of a cube's edge, world units. n_cells: the
// number of cubes along each axis.
struct Lattice {
    vec3 least;
    float cell_size;
    vec3 greatest;
    uvec3 n_cells;
};

// The coordinates on each axis at which cubes of these indices begin and those before them end. They are `precise`,
// so that the build sorts triangles into cells by the same planes that rays meet.
vec3 planes_of(Lattice lattice, uvec3 cube) {
    precise vec3 offsets = vec3(cube) * lattice.cell_size;
    precise vec3 planes = lattice.least + offsets;
    return min(planes, lattice.greatest);
}

// The approximate indices of the cube that contains a point, or of the nearest cube at the border if the point is
// outside the box.
uvec3 cube_near(Lattice lattice, vec3 point) {
    precise vec3 indices = (point - lattice.least) / lattice.cell_size;
    return uvec3(clamp(indices, vec3(0.0), vec3(lattice.n_cells - 1u)));
}

// A cube's place, its index among all cubes of the lattice: x fastest, then y.
uint cell_ix_of(Lattice lattice, uvec3 cube) {
    return cube.x + lattice.n_cells.x * (cube.y + lattice.n_cells.y * cube.z);
}

// The length of the edges of the cubes that a cube is cut into, world units. 1 / resolution is rounded up to a
// multiple of 2^-16 by integer arithmetic, since the last bit of a quotient of floats differs between devices.
float cell_size_within(Lattice lattice, uint resolution) {
    uint share = ((1u << 16) + resolution - 1u) / resolution;
    precise float cell_size = lattice.cell_size * (float(share) * (1.0 / 65536.0));
    return cell_size;
}

// The lattice that cuts a cube into `resolution` cubes along each axis.
Lattice lattice_within(Lattice lattice, uvec3 cube, uint resolution) {
    float cell_size = cell_size_within(lattice, resolution);
    return Lattice(planes_of(lattice, cube), cell_size, planes_of(lattice, cube + 1u), uvec3(resolution));
}

#endif
