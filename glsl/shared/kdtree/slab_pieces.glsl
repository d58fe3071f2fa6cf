// Pieces of triangles near their leaves. Needs nothing before it; includes slab_build.glsl.
//
// Triangles are clipped by Sutherland and Hodgman's algorithm, in f32, in scaled units from the centre of the leaf's
// cell. Let D be the largest coordinate there of the triangle's corners and of the cell, and u = 2^-24. On each axis,
// a corner is off by u D to begin with. A new corner `a + t (b - a)` is off by 10 u |b - a| + u D <= 21 u D more: 8 for
// t, of which the division has 5 (2.5 units in the last place), one each for the difference and the product, and u D
// for the sum. A piece is cut six times, so its corners are off by at most 127 u D on each axis. A point of the exact
// piece, which is inside of a face, can thus be at most that far outside by the computed corners. So each face is moved
// outwards by SLACK * D. The height of a corner along a unit normal is off by sqrt(3) * 127 u D + 6 u D = 226 u D.
// Rounding may also bend a piece, by no more than its corners are off. SLACK covers twice the sum: 512 u = 2^-15.
#ifndef KDRAY_SLAB_PIECES
#define KDRAY_SLAB_PIECES

#include "kdtree/slab_build.glsl"

layout(std430, set = 0, binding = BIND_KD_SLAB_LEAF_TRIANGLES) readonly buffer LeafTrianglesBlock {
    LeafTriangle leaf_triangles[];
};
layout(std430, set = 0, binding = BIND_KD_SLAB_ENTRY_LEAVES) readonly buffer EntryLeavesBlock { uint entry_leaves[]; };

// Three, and one more for each of the six faces of a cell.
const uint MAX_CORNERS = 9u;
// See above.
const float SLACK = 0.000030517578;
// A coordinate nearer to 0 than this becomes 0 (scaled units). So no difference of two coordinates is denormal. This is
// far less than a slab's reach, which is at least 2^-33.
const float LEAST_COORDINATE = 8.6736174e-19;

// The corners of each invocation's piece, in their order round it. They are in shared memory since invocations of a
// subgroup access different ones at the same time; components of different invocations are side by side.
shared float corners[MAX_CORNERS][3][SCAN_GROUP_SIZE];
uint n_corners;

vec3 corner(uint i) {
    uint own = gl_LocalInvocationIndex;
    return vec3(corners[i][0][own], corners[i][1][own], corners[i][2][own]);
}

void set_corner(uint i, vec3 v) {
    for (uint axis = 0u; axis < 3u; ++axis) corners[i][axis][gl_LocalInvocationIndex] = v[axis];
}

vec3 snapped(vec3 v) {
    return mix(v, vec3(0.0), lessThan(abs(v), vec3(LEAST_COORDINATE)));
}

float along(vec3 v, uint axis) {
    return axis == 0u ? v.x : (axis == 1u ? v.y : v.z);
}

// Cuts off what is above a position on an axis (`side` 1) or below it (-1). Returns whether there was room for the
// corners: more than MAX_CORNERS come only from a piece that rounding has bent.
bool clip(uint axis, float side, float position) {
    bool is_cut = false;
    for (uint i = 0u; i < n_corners; ++i) {
        is_cut = is_cut || side * (corners[i][axis][gl_LocalInvocationIndex] - position) > 0.0;
    }
    if (!is_cut) return true;
    // What is kept overwrites corners that have been read. Of a convex polygon, it is never more than one corner longer
    // than what has been read.
    uint n_kept = 0u;
    vec3 a = corner(n_corners - 1u), b = corner(0u);
    float height_a = side * (along(a, axis) - position);
    for (uint i = 0u; i < n_corners; ++i) {
        vec3 next = corner(min(i + 1u, MAX_CORNERS - 1u));
        float height_b = side * (along(b, axis) - position);
        bool crosses = (height_a > 0.0 && height_b < 0.0) || (height_a < 0.0 && height_b > 0.0);
        uint n_new = (crosses ? 1u : 0u) + (height_b > 0.0 ? 0u : 1u);
        if (n_kept + n_new > min(i + 2u, MAX_CORNERS)) return false;
        if (crosses) {
            float t = height_a / (height_a - height_b);
            set_corner(n_kept++, snapped(a + t * (b - a)));
        }
        if (!(height_b > 0.0)) set_corner(n_kept++, b);
        a = b;
        height_a = height_b;
        b = next;
    }
    n_corners = n_kept;
    return true;
}

void begin_with(vec3 v0, vec3 v1, vec3 v2) {
    set_corner(0u, v0);
    set_corner(1u, v1);
    set_corner(2u, v2);
    n_corners = 3u;
}

// The scale of an entry's triangle.
uint scale_of_triangle(LeafTriangle triangle) {
    if (tree.finest_scale == 0u) return 0u;
    return scale_of_length(greatest(max(abs(triangle.v0), max(abs(triangle.v1), abs(triangle.v2)))));
}

// Finds the corners of an entry's piece: `corners` and `n_corners`, scaled, from the centre of the cell. Returns D. If
// there is no room for the corners, the piece is the whole triangle. triangle_scale: that of the triangle.
float find_piece(LeafTriangle triangle, uint triangle_scale, KdSlabPatch leaf) {
    float scale = world_scale();
    vec3 centre = scaled_centre(leaf.cell_min, leaf.cell_max);
    vec3 v0 = snapped(scale * triangle.v0 - centre);
    vec3 v1 = snapped(scale * triangle.v1 - centre);
    vec3 v2 = snapped(scale * triangle.v2 - centre);
    vec3 low = scale * leaf.cell_min - centre, high = scale * leaf.cell_max - centre;
    float reach = greatest(max(max(abs(v0), max(abs(v1), abs(v2))), max(-low, high)));
    float margin = scale * tree.margin * length_of(triangle_scale) + SLACK * reach;
    low = snapped(low - margin);
    high = snapped(high + margin);
    begin_with(v0, v1, v2);
    bool has_room = true;
    for (uint axis = 0u; axis < 3u; ++axis) {
        has_room = has_room && clip(axis, -1.0, along(low, axis));
        has_room = has_room && clip(axis, 1.0, along(high, axis));
    }
    if (!has_room) begin_with(v0, v1, v2);
    return reach;
}

// The area vector of the piece, whose length is twice the area.
vec3 area_of_piece() {
    vec3 area = vec3(0.0);
    for (uint i = 2u; i < n_corners; ++i) area += cross(corner(i - 1u) - corner(0u), corner(i) - corner(0u));
    return area;
}

#endif
