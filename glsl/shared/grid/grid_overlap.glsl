// Tests which cubes of a lattice a triangle comes near to, which means within the margin (src/accel/bounds.rs). Twin
// of src/accel/grid/overlap.rs, which explains the method and derives the bounds of the errors. All arithmetic is
// `precise`, so that it gives the same bits as the twin; divisions may round differently, which does not change the
// result.
//
// No intermediate result is denormal in scenes whose largest coordinate is 2^-20 or more and whose edges are 0 or at
// least 2^-20 times that. In smaller scenes, a device that flushes denormals may build a grid with a few
// different entries.
#ifndef KDRAY_GRID_OVERLAP
#define KDRAY_GRID_OVERLAP

#include "grid/grid_build.glsl"
#include "search/triangle.glsl"

// A factor on the margin, which covers the rounding of the cubes' middles and half edges.
const float MARGIN_FACTOR = 1.0625;
// A bound of the error of a cross product, and of the dot product of a cross product and a third vector. It is a
// multiple of the product of all factors' `sum_of_magnitudes`.
const float PRODUCT_ERROR = 1.0 / 1048576.0;

// A triangle and the columns of its box. The axes are permuted so that columns extend along z, which is the axis of
// the normal's longest component. normal: not of unit length. normal_error: a bound of its components' error.
// half_size: half of a cube's edge plus MARGIN_FACTOR times the margin, world units. first, last: the first and the
// last index of the box's cubes on each axis, inclusive. axis: the lattice's own axis that is z here.
struct Columns {
    Lattice lattice;
    vec3 v0;
    vec3 v1;
    vec3 v2;
    vec3 normal;
    float normal_error;
    float half_size;
    uvec3 first;
    uvec3 last;
    uint axis;
};

// v rotated cyclically so that component `axis` is last.
uvec3 axis_last(uvec3 v, uint axis) {
    return axis == 2u ? v : (axis == 0u ? v.yzx : v.zxy);
}

// The inverse of axis_last.
uvec3 axis_back(uvec3 v, uint axis) {
    return axis == 2u ? v : (axis == 0u ? v.zxy : v.yzx);
}

// The index, on each axis, of the first cube whose upper face is at or above `least`, or of the lattice's last cube
// if there is none. A cube that only touches `least` counts, too.
uvec3 first_cubes(Lattice lattice, vec3 least) {
    uvec3 first = cube_near(lattice, least);
    bool moves = true;
    while (moves) {
        bvec3 are_late = greaterThanEqual(planes_of(lattice, first), least);
        bvec3 are_early = lessThan(planes_of(lattice, first + 1u), least);
        uvec3 down = uvec3(are_late) * uvec3(greaterThan(first, uvec3(0u)));
        uvec3 up = uvec3(are_early) * uvec3(lessThan(first, lattice.n_cells - 1u));
        first = first + up - down;
        moves = any(notEqual(up + down, uvec3(0u)));
        if (!moves) break;
    }
    return first;
}

// The index, on each axis, of the last cube whose lower face is at or below `greatest`, or of the lattice's first
// cube if there is none. A cube that only touches `greatest` counts, too.
uvec3 last_cubes(Lattice lattice, vec3 greatest) {
    uvec3 last = cube_near(lattice, greatest);
    bool moves = true;
    while (moves) {
        bvec3 are_late = greaterThan(planes_of(lattice, last), greatest);
        bvec3 are_early = lessThanEqual(planes_of(lattice, last + 1u), greatest);
        uvec3 down = uvec3(are_late) * uvec3(greaterThan(last, uvec3(0u)));
        uvec3 up = uvec3(are_early) * uvec3(lessThan(last, lattice.n_cells - 1u));
        last = last + up - down;
        moves = any(notEqual(up + down, uvec3(0u)));
        if (!moves) break;
    }
    return last;
}

// The columns of a triangle. margin: the margin of the box of all triangles, world units.
Columns columns_of(Lattice lattice, Triangle triangle, float margin) {
    precise float grown = MARGIN_FACTOR * margin;
    precise vec3 a = triangle.v1 - triangle.v0;
    precise vec3 b = triangle.v2 - triangle.v0;
    precise vec3 normal = a.yzx * b.zxy - a.zxy * b.yzx;
    precise float normal_error = PRODUCT_ERROR * (sum_of_magnitudes(a) * sum_of_magnitudes(b));
    vec3 n = abs(normal);
    uint axis = n.z >= n.x && n.z >= n.y ? 2u : (n.y >= n.x ? 1u : 0u);
    Columns columns;
    columns.lattice = Lattice(
        axis_last(lattice.least, axis), lattice.cell_size, axis_last(lattice.greatest, axis),
        axis_last(lattice.n_cells, axis)
    );
    columns.v0 = axis_last(triangle.v0, axis);
    columns.v1 = axis_last(triangle.v1, axis);
    columns.v2 = axis_last(triangle.v2, axis);
    columns.normal = axis_last(normal, axis);
    columns.normal_error = normal_error;
    precise float half_size = 0.5 * lattice.cell_size + grown;
    columns.half_size = half_size;
    precise vec3 least = min(columns.v0, min(columns.v1, columns.v2)) - grown;
    precise vec3 greatest = max(columns.v0, max(columns.v1, columns.v2)) + grown;
    columns.first = first_cubes(columns.lattice, least);
    columns.last = last_cubes(columns.lattice, greatest);
    columns.axis = axis;
    return columns;
}

uint n_columns_of(Columns columns) {
    uvec3 n = columns.last - columns.first + 1u;
    return n.x * n.y;
}

// x: whether a square is certainly on the right of an edge. y: whether it is certainly on the edge's left. middle,
// half_size: the square's middle and half of its edge.
bvec2 sides_of(vec2 from, vec2 to, vec2 middle, float half_size) {
    precise vec2 along = to - from;
    precise vec2 way = middle - from;
    precise float span = abs(along.x) + abs(along.y);
    precise float height = along.x * way.y - along.y * way.x;
    precise float reach = span * half_size + PRODUCT_ERROR * (span * (abs(way.x) + abs(way.y)));
    return bvec2(height < -reach, height > reach);
}

// Whether a square is certainly outside a triangle. A point of the triangle is on the left of all edges or on the
// right of all, so the square is outside if it is on the right of one edge and on the left of another.
bool is_beside(vec2 a, vec2 b, vec2 c, vec2 middle, float half_size) {
    bvec2 ab = sides_of(a, b, middle, half_size);
    bvec2 bc = sides_of(b, c, middle, half_size);
    bvec2 ca = sides_of(c, a, middle, half_size);
    return (ab.x || bc.x || ca.x) && (ab.y || bc.y || ca.y);
}

// Whether the triangle's plane may come near to the cube with this middle.
bool meets_plane(Columns columns, vec3 middle) {
    precise vec3 way = middle - columns.v0;
    vec3 n = columns.normal;
    precise float height = n.x * way.x + n.y * way.y + n.z * way.z;
    precise float error = columns.normal_error * (sum_of_magnitudes(way) + 3.0 * columns.half_size);
    precise float reach = sum_of_magnitudes(n) * columns.half_size + error;
    return !(abs(height) > reach);
}

// The approximate index along z of the cube that contains a coordinate; the index at the border if none contains it.
uint index_near(Lattice lattice, float at) {
    precise float index = (at - lattice.least.z) / lattice.cell_size;
    return uint(clamp(index, 0.0, float(lattice.n_cells.z - 1u)));
}

// The first and the last index along z of the cubes of a column that may meet the triangle's plane. The range is up
// to a cube wider on each side than `meets_plane` needs, so the rounding of its ends makes no difference.
uvec2 near_plane(Columns columns, uvec2 column) {
    Lattice lattice = columns.lattice;
    uint first = columns.first.z, last = columns.last.z;
    vec3 low = planes_of(lattice, uvec3(column, first));
    vec3 high = planes_of(lattice, uvec3(column + 1u, last + 1u));
    precise vec2 way = 0.5 * low.xy + 0.5 * high.xy - columns.v0.xy;
    vec3 n = columns.normal;
    precise float slope = 1.0 / abs(n.z);
    precise float extent = high.z - low.z;
    precise float error = columns.normal_error * (abs(way.x) + abs(way.y) + extent + columns.half_size) * slope;
    precise float most_error = 0.25 * lattice.cell_size;
    if (!(error < most_error)) return uvec2(first, last);
    precise float height = n.x * way.x + n.y * way.y;
    precise float at = columns.v0.z - (n.z < 0.0 ? -height : height) * slope;
    precise float reach = ((abs(n.x) + abs(n.y)) * slope + 1.0) * columns.half_size + lattice.cell_size;
    precise float low_end = at - reach;
    precise float high_end = at + reach;
    return uvec2(max(first, index_near(lattice, low_end)), min(last, index_near(lattice, high_end)));
}

// The middle of a cube.
vec3 middle_of(Lattice lattice, uvec3 cube) {
    precise vec3 middle = 0.5 * planes_of(lattice, cube) + 0.5 * planes_of(lattice, cube + 1u);
    return middle;
}

// The indices of a column's cubes on the first two axes. Columns are numbered along x, then y.
uvec2 column_at(Columns columns, uint column_ix) {
    uint n_in_row = columns.last.x - columns.first.x + 1u;
    return columns.first.xy + uvec2(column_ix % n_in_row, column_ix / n_in_row);
}

// The first index along z of a column's cubes that the triangle may come near to, and one beyond the last.
uvec2 cubes_of(Columns columns, uvec2 column) {
    vec2 middle = middle_of(columns.lattice, uvec3(column, columns.first.z)).xy;
    if (is_beside(columns.v0.xy, columns.v1.xy, columns.v2.xy, middle, columns.half_size)) return uvec2(0u);
    return near_plane(columns, column) + uvec2(0u, 1u);
}

// Whether the triangle comes near to a cube that is in the range of `cubes_of`. Tests the triangle's plane and the
// projections along x and y; `cubes_of` has tested the projection along z.
bool is_near(Columns columns, uvec3 cube) {
    vec3 middle = middle_of(columns.lattice, cube);
    float half_size = columns.half_size;
    return meets_plane(columns, middle)
        && !is_beside(columns.v0.yz, columns.v1.yz, columns.v2.yz, middle.yz, half_size)
        && !is_beside(columns.v0.zx, columns.v1.zx, columns.v2.zx, middle.zx, half_size);
}

#endif
