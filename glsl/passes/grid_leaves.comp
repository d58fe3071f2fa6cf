#version 460
#extension GL_GOOGLE_include_directive : require
// Grid, leaves: writes the leaf entries, a triangle and its plane for each pair, in the order of the cells. One
// workgroup per block of GRID_BLOCK_SIZE pairs; an invocation writes one entry per row. Twin of
// src/accel/grid/planes.rs.
// Reads build, pairs_from, triangles; writes leaf_triangles, leaf_planes.
#include "grid/grid_build.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_GRID_TRIANGLES) readonly buffer TrianglesBlock { Triangle triangles[]; };
layout(std430, set = 0, binding = BIND_GRID_PAIRS_FROM) readonly buffer PairsFromBlock { uvec2 pairs_from[]; };
// Three rows per entry, which make up a LeafTriangle.
layout(std430, set = 0, binding = BIND_GRID_LEAF_TRIANGLES) writeonly buffer LeafTrianglesBlock {
    uvec4 leaf_triangles[];
};
layout(std430, set = 0, binding = BIND_GRID_LEAF_PLANES) writeonly buffer LeafPlanesBlock { vec4 leaf_planes[]; };

// The largest error of a point's height above a plane that the rounding of the normal may cause, in units of 2^-24
// times the largest coordinate. Derived in src/accel/grid/planes.rs.
const float MAX_ERROR = 16.0;
// The smallest positive number that is not denormal.
const float LEAST_NORMAL = 1.17549435e-38;

// Returns the plane of a triangle: a normal, and in w the normal's dot product with the plane's points. The normal is
// scaled by a power of two, so that its longest component is in [1/4, 1/2). Returns zeros if rounding may put the
// plane too far off.
vec4 plane_of(Triangle triangle) {
    precise vec3 a = triangle.v1 - triangle.v0;
    precise vec3 b = triangle.v2 - triangle.v0;
    precise vec3 normal = a.yzx * b.zxy - a.zxy * b.yzx;
    float longest = max(abs(normal.x), max(abs(normal.y), abs(normal.z)));
    precise float edges = sum_of_magnitudes(a) * sum_of_magnitudes(b);
    float reach = max(sum_of_magnitudes(a), sum_of_magnitudes(b));
    precise float error = 4.0 * edges * reach;
    precise float limit = MAX_ERROR * (build.largest_coordinate * longest);
    uint exponent = floatBitsToUint(longest) >> 23;
    // If the limit is denormal, a device may flush the limit and the error to 0.
    bool is_certain = limit >= LEAST_NORMAL && error <= limit;
    if (!is_certain || exponent < 3u || exponent >= 250u) return vec4(0.0);
    precise vec3 scaled = normal * uintBitsToFloat((252u - exponent) << 23);
    precise vec3 products = scaled * triangle.v0;
    precise float distance = products.x + products.y + products.z;
    return vec4(scaled, distance);
}

void main() {
    uint begin = block_of_group() * GRID_BLOCK_SIZE + gl_LocalInvocationIndex;
    for (uint row = 0u; row < GRID_ROWS; ++row) {
        uint entry_ix = begin + row * SCAN_GROUP_SIZE;
        if (entry_ix >= build.n_pairs) break;
        uint triangle_ix = pairs_from[entry_ix].y;
        Triangle triangle = triangles[triangle_ix];
        leaf_triangles[3u * entry_ix] = uvec4(floatBitsToUint(triangle.v0), triangle_ix);
        leaf_triangles[3u * entry_ix + 1u] = uvec4(floatBitsToUint(triangle.v1), 0u);
        leaf_triangles[3u * entry_ix + 2u] = uvec4(floatBitsToUint(triangle.v2), 0u);
        leaf_planes[entry_ix] = plane_of(triangle);
    }
}
