// Access to the scene's triangles and their acceleration structure. There are three ways of reading. All kernels over
// a scene read all of its arrays in the same way:
//
// - GPUs read them as bound storage buffers.
// - Software drivers read them as texels of the same buffers. lavapipe fetches the texels of eight lanes side by
//   side, but loads from storage buffers lane by lane. With loads from storage buffers, rays take 1.2 to 1.4 times as
//   long.
// - If any array is larger than what the device binds, all arrays are read by their device addresses. This costs the
//   traversal up to 7 % of its speed on a large GPU.
//
// Needs nothing: it includes layout.glsl, and declares all bindings of the scene's arrays. Provides `accel`, the
// function `load_NAME` for each array, and functions that assemble an element: `stored_triangle_at`, `kd_node_at`,
// `kd_parent_of`, `leaf_triangle_at`, `corners_of`, `kd_box_of` and `kd_rope_of`.
#ifndef KDRAY_SCENE
#define KDRAY_SCENE

#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require

#include "layout.glsl"
#include "octahedral.glsl"

layout(constant_id = CONSTANT_READING) const uint READING = READING_BOUND;

layout(std140, set = 0, binding = BIND_ACCEL) uniform AccelBlock { AccelConstants accel; };

// For each type of row: a reference by device address, and a function that reads a texel.
layout(std430, buffer_reference, buffer_reference_align = 16) readonly buffer vec4_array { vec4 at[]; };
layout(std430, buffer_reference, buffer_reference_align = 8) readonly buffer uvec2_array { uvec2 at[]; };
layout(std430, buffer_reference, buffer_reference_align = 4) readonly buffer uint_array { uint at[]; };

vec4 vec4_texel(usamplerBuffer texels, uint row_ix) {
    return uintBitsToFloat(texelFetch(texels, int(row_ix)));
}

uvec2 uvec2_texel(usamplerBuffer texels, uint row_ix) {
    return texelFetch(texels, int(row_ix)).xy;
}

uint uint_texel(usamplerBuffer texels, uint row_ix) {
    return texelFetch(texels, int(row_ix)).x;
}

// For each array: its buffer, the same buffer as texels, and the function that loads a row.
#define ARRAY(name, element, row, number) \
    layout(std430, set = 0, binding = number) readonly buffer name##_block { row name[]; }; \
    layout(set = 0, binding = BIND_TEXELS + number) uniform usamplerBuffer name##_texels; \
    row load_##name(uint row_ix) { \
        if (READING == READING_TEXELS) return row##_texel(name##_texels, row_ix); \
        if (READING == READING_ADDRESS) return row##_array(accel.name).at[row_ix]; \
        return name[row_ix]; \
    }
#include "scene_arrays.glsl"
#undef ARRAY

// A triangle as it is stored: of the world, or of a geometry.
Triangle stored_triangle_at(uint row) {
    vec4 v0 = load_triangles(3u * row);
    vec4 v1 = load_triangles(3u * row + 1u);
    vec4 v2 = load_triangles(3u * row + 2u);
    return Triangle(v0.xyz, floatBitsToUint(v0.w), v1.xyz, floatBitsToUint(v1.w), v2.xyz, floatBitsToUint(v2.w));
}

#include "instances/placed.glsl"

KdNode kd_node_at(uint node_ix) {
    uvec2 words = load_kd_nodes(node_ix);
    return KdNode(words.x, words.y);
}

// The parent of a node. Siblings share one entry.
uint kd_parent_of(uint node_ix) {
    return load_kd_parents(node_ix >> 1);
}

LeafTriangle leaf_triangle_at(uint entry_ix) {
    vec4 v0 = load_leaf_triangles(3u * entry_ix);
    vec4 v1 = load_leaf_triangles(3u * entry_ix + 1u);
    vec4 v2 = load_leaf_triangles(3u * entry_ix + 2u);
    return LeafTriangle(v0.xyz, floatBitsToUint(v0.w), v1.xyz, 0u, v2.xyz, 0u);
}

// The corners of a leaf's triangle, without shading normals: a test needs only the corners.
Triangle corners_of(LeafTriangle entry) {
    return Triangle(entry.v0, 0u, entry.v1, 0u, entry.v2, 0u);
}

KdBox kd_box_of(uint node_ix) {
    vec2 a = uintBitsToFloat(load_kd_links(3u * node_ix));
    vec2 b = uintBitsToFloat(load_kd_links(3u * node_ix + 1u));
    vec2 c = uintBitsToFloat(load_kd_links(3u * node_ix + 2u));
    return KdBox(a.x, a.y, b.x, b.y, c.x, c.y);
}

// side: 0..5, the face of the node's cell: -x, +x, -y, +y, -z, +z.
KdRope kd_rope_of(uint node_ix, uint side) {
    uvec2 words = load_kd_links(6u * node_ix + side);
    return KdRope(uintBitsToFloat(words.x), words.y);
}

#endif
