// The scene's triangles and their kd-tree, an accessor an array, and three ways to read them, one for all kernels over a scene:
//
// - as storage buffers that are bound, on GPUs;
// - as texels of the same buffers, on software drivers: lavapipe fetches the texels of eight lanes side by side, and loads
//   from storage lane by lane, by which rays take 1.2 to 1.4 times as long;
// - by address where an array grows beyond what the device binds. The traversal loses up to 7 % of its speed by it on a large
//   GPU.
#ifndef KDRAY_SCENE
#define KDRAY_SCENE

#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require

#include "layout.glsl"

layout(constant_id = CONSTANT_READING) const uint READING = READING_BOUND;

// Triangles, and the leaves' triangles, as three rows, nodes and ropes as one each: a device then loads each at once.
layout(std430, set = 0, binding = BIND_TRIANGLES) readonly buffer TrianglesBlock { vec4 triangle_rows[]; };
layout(std430, set = 0, binding = BIND_TRIANGLE_MATERIALS) readonly buffer TriangleMaterialsBlock { uint triangle_materials[]; };
layout(std430, set = 0, binding = BIND_KD_NODES) readonly buffer KdNodesBlock { uvec2 kd_nodes[]; };
layout(std430, set = 0, binding = BIND_KD_PARENTS) readonly buffer KdParentsBlock { uint kd_parents[]; };
layout(std430, set = 0, binding = BIND_LEAF_TRIANGLES) readonly buffer LeafTrianglesBlock { vec4 leaf_triangle_rows[]; };
layout(std430, set = 0, binding = BIND_LEAF_PLANES) readonly buffer LeafPlanesBlock { vec4 leaf_planes[]; };
layout(std430, set = 0, binding = BIND_KD_SLABS) readonly buffer KdSlabsBlock { vec4 kd_slabs[]; };
layout(std430, set = 0, binding = BIND_KD_BOXES) readonly buffer KdBoxesBlock { KdBox kd_boxes[]; };
layout(std430, set = 0, binding = BIND_KD_ROPES) readonly buffer KdRopesBlock { uvec2 kd_ropes[]; };

layout(set = 0, binding = BIND_TEXELS + BIND_TRIANGLES) uniform usamplerBuffer triangle_texels;
layout(set = 0, binding = BIND_TEXELS + BIND_TRIANGLE_MATERIALS) uniform usamplerBuffer triangle_material_texels;
layout(set = 0, binding = BIND_TEXELS + BIND_KD_NODES) uniform usamplerBuffer kd_node_texels;
layout(set = 0, binding = BIND_TEXELS + BIND_KD_PARENTS) uniform usamplerBuffer kd_parent_texels;
layout(set = 0, binding = BIND_TEXELS + BIND_LEAF_TRIANGLES) uniform usamplerBuffer leaf_triangle_texels;
layout(set = 0, binding = BIND_TEXELS + BIND_LEAF_PLANES) uniform usamplerBuffer leaf_plane_texels;
layout(set = 0, binding = BIND_TEXELS + BIND_KD_SLABS) uniform usamplerBuffer kd_slab_texels;
layout(set = 0, binding = BIND_TEXELS + BIND_KD_BOXES) uniform usamplerBuffer kd_box_texels;
layout(set = 0, binding = BIND_TEXELS + BIND_KD_ROPES) uniform usamplerBuffer kd_rope_texels;

layout(std140, set = 0, binding = BIND_ADDRESSES) uniform AddressesBlock { Addresses addresses; };
layout(std430, buffer_reference, buffer_reference_align = 16) readonly buffer Rows { vec4 at[]; };
layout(std430, buffer_reference, buffer_reference_align = 8) readonly buffer Pairs { uvec2 at[]; };
layout(std430, buffer_reference, buffer_reference_align = 4) readonly buffer Words { uint at[]; };
layout(std430, buffer_reference, buffer_reference_align = 8) readonly buffer Boxes { KdBox at[]; };

uint word_of(usamplerBuffer texels, uint ix) {
    return texelFetch(texels, int(ix)).x;
}

uvec2 pair_of(usamplerBuffer texels, uint ix) {
    return texelFetch(texels, int(ix)).xy;
}

vec4 row_of(usamplerBuffer texels, uint ix) {
    return uintBitsToFloat(texelFetch(texels, int(ix)));
}

// Row 3 i + k: corner k of triangle i, and what its fourth word holds.
vec4 triangle_row(uint row_ix) {
    if (READING == READING_TEXELS) return row_of(triangle_texels, row_ix);
    if (READING == READING_ADDRESS) return Rows(addresses.triangles).at[row_ix];
    return triangle_rows[row_ix];
}

Triangle triangle_at(uint triangle_ix) {
    vec4 v0 = triangle_row(3u * triangle_ix);
    vec4 v1 = triangle_row(3u * triangle_ix + 1u);
    vec4 v2 = triangle_row(3u * triangle_ix + 2u);
    return Triangle(v0.xyz, floatBitsToUint(v0.w), v1.xyz, floatBitsToUint(v1.w), v2.xyz, floatBitsToUint(v2.w));
}

uint triangle_material_at(uint triangle_ix) {
    if (READING == READING_TEXELS) return word_of(triangle_material_texels, triangle_ix);
    if (READING == READING_ADDRESS) return Words(addresses.triangle_materials).at[triangle_ix];
    return triangle_materials[triangle_ix];
}

KdNode kd_node_of(uint node_ix) {
    uvec2 words;
    if (READING == READING_TEXELS) words = pair_of(kd_node_texels, node_ix);
    else if (READING == READING_ADDRESS) words = Pairs(addresses.kd_nodes).at[node_ix];
    else words = kd_nodes[node_ix];
    return KdNode(words.x, words.y);
}

uint kd_parent_of(uint node_ix) {
    if (READING == READING_TEXELS) return word_of(kd_parent_texels, node_ix >> 1);
    if (READING == READING_ADDRESS) return Words(addresses.kd_parents).at[node_ix >> 1];
    return kd_parents[node_ix >> 1];
}

// As triangle_row, of a leaf's entry.
vec4 leaf_triangle_row(uint row_ix) {
    if (READING == READING_TEXELS) return row_of(leaf_triangle_texels, row_ix);
    if (READING == READING_ADDRESS) return Rows(addresses.leaf_triangles).at[row_ix];
    return leaf_triangle_rows[row_ix];
}

LeafTriangle leaf_triangle_at(uint entry_ix) {
    vec4 v0 = leaf_triangle_row(3u * entry_ix);
    vec4 v1 = leaf_triangle_row(3u * entry_ix + 1u);
    vec4 v2 = leaf_triangle_row(3u * entry_ix + 2u);
    return LeafTriangle(v0.xyz, floatBitsToUint(v0.w), v1.xyz, 0u, v2.xyz, 0u);
}

// What a test needs of it.
Triangle corners_of(LeafTriangle entry) {
    return Triangle(entry.v0, 0u, entry.v1, 0u, entry.v2, 0u);
}

// A Plane as a vector: normal, distance.
vec4 leaf_plane_at(uint entry_ix) {
    if (READING == READING_TEXELS) return row_of(leaf_plane_texels, entry_ix);
    if (READING == READING_ADDRESS) return Rows(addresses.leaf_planes).at[entry_ix];
    return leaf_planes[entry_ix];
}

// A Slab as a vector: normal, offset.
vec4 kd_slab_of(uint node_ix) {
    if (READING == READING_TEXELS) return row_of(kd_slab_texels, node_ix);
    if (READING == READING_ADDRESS) return Rows(addresses.kd_slabs).at[node_ix];
    return kd_slabs[node_ix];
}

// A box as texels: three pairs.
KdBox fetch_kd_box(uint node_ix) {
    vec2 a = uintBitsToFloat(pair_of(kd_box_texels, 3u * node_ix));
    vec2 b = uintBitsToFloat(pair_of(kd_box_texels, 3u * node_ix + 1u));
    vec2 c = uintBitsToFloat(pair_of(kd_box_texels, 3u * node_ix + 2u));
    return KdBox(a.x, a.y, b.x, b.y, c.x, c.y);
}

KdBox kd_box_of(uint node_ix) {
    if (READING == READING_TEXELS) return fetch_kd_box(node_ix);
    if (READING == READING_ADDRESS) return Boxes(addresses.kd_boxes).at[node_ix];
    return kd_boxes[node_ix];
}

// side: below and above on x, y, z.
KdRope kd_rope_of(uint node_ix, uint side) {
    uvec2 words;
    if (READING == READING_TEXELS) words = pair_of(kd_rope_texels, 6u * node_ix + side);
    else if (READING == READING_ADDRESS) words = Pairs(addresses.kd_ropes).at[6u * node_ix + side];
    else words = kd_ropes[6u * node_ix + side];
    return KdRope(uintBitsToFloat(words.x), words.y);
}

#endif
