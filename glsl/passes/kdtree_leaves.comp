#version 460
#extension GL_GOOGLE_include_directive : require
// Kd-tree, leaves: writes the leaf entries, a triangle and its plane for each reference in a leaf. One workgroup per
// group of these references. Twin of src/accel/kdtree/planes.rs.
// Reads build, triangles, leaf_references, built_nodes, places; writes leaf_triangles, leaf_planes.
#include "kdtree_build/kd_scales.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_KD_TRIANGLES) readonly buffer TrianglesBlock { Triangle triangles[]; };
layout(std430, set = 0, binding = BIND_KD_LEAF_REFERENCES) readonly buffer LeafReferencesBlock {
    uvec2 leaf_references[];
};
layout(std430, set = 0, binding = BIND_KD_BUILT_NODES) readonly buffer BuiltNodesBlock { KdNode built_nodes[]; };
layout(std430, set = 0, binding = BIND_KD_PLACES) readonly buffer PlacesBlock { uvec2 places[]; };
// Three rows per entry, which make up a LeafTriangle.
layout(std430, set = 0, binding = BIND_KD_LEAF_TRIANGLES) writeonly buffer LeafTrianglesBlock {
    uvec4 leaf_triangles[];
};
layout(std430, set = 0, binding = BIND_KD_LEAF_PLANES) writeonly buffer LeafPlanesBlock { vec4 leaf_planes[]; };

// The largest error of a point's height above a plane that the rounding of the normal may cause, in units of 2^-24
// times the length of the scale. src/accel/kdtree/planes.rs adds the other errors.
const float MAX_ERROR = 16.0;
// The smallest positive number that is not denormal.
const float LEAST_NORMAL = 1.17549435e-38;

// The plane of a triangle, whose normal has the length 2^scale. Zeros if rounding may put the plane too far off.
vec4 plane_of(Triangle triangle, uint scale) {
    precise vec3 a = triangle.v1 - triangle.v0;
    precise vec3 b = triangle.v2 - triangle.v0;
    precise vec3 products_1 = a.yzx * b.zxy;
    precise vec3 products_2 = a.zxy * b.yzx;
    precise vec3 normal = products_1 - products_2;
    float longest = max(abs(normal.x), max(abs(normal.y), abs(normal.z)));
    // Each component of the normal is off by 4 units of the sum of its products. No point of the triangle is farther
    // from v0 on an axis than v1 or v2.
    precise vec3 errors = (abs(products_1) + abs(products_2)) * max(abs(a), abs(b));
    precise float error = 4.0 * (errors.x + errors.y + errors.z);
    precise float limit = MAX_ERROR * (build.largest * length_of_scale(scale) * longest);
    uint exponent = floatBitsToUint(longest) >> 23;
    // If the limit is denormal, a device may flush the limit and the error to 0.
    bool is_certain = limit >= LEAST_NORMAL && error <= limit;
    if (!is_certain || exponent < 3u || exponent >= 250u) return vec4(0.0);
    precise vec3 scaled = normal * uintBitsToFloat((252u - exponent) << 23);
    precise vec3 squares = scaled * scaled;
    precise float squared_length = squares.x + squares.y + squares.z;
    precise float per_length = inversesqrt(squared_length);
    precise vec3 unit = scaled * per_length;
    precise vec3 products = unit * triangle.v0;
    precise float distance = products.x + products.y + products.z;
    precise vec4 plane = vec4(unit, distance) * uintBitsToFloat((127u + scale) << 23);
    return plane;
}

void write_entry(uint entry_ix, uint triangle_ix, Triangle triangle, uint cell_scale) {
    leaf_triangles[3u * entry_ix] = uvec4(floatBitsToUint(triangle.v0), triangle_ix);
    leaf_triangles[3u * entry_ix + 1u] = uvec4(floatBitsToUint(triangle.v1), 0u);
    leaf_triangles[3u * entry_ix + 2u] = uvec4(floatBitsToUint(triangle.v2), 0u);
    uint scale = min(cell_scale, scale_of(least_of(triangle), greatest_of(triangle)));
    leaf_planes[entry_ix] = plane_of(triangle, scale);
}

void main() {
    uint i = index_of_entry();
    if (i >= build.n_entries) return;
    uvec2 reference = leaf_references[i];
    uint built_ix = reference.y & 0x7ffffffu;
    uint entry_ix = places[built_ix].y + i - built_nodes[built_ix].split_or_first;
    write_entry(entry_ix, reference.x, triangles[reference.x], reference.y >> 27);
}
