// The scene's triangles and their kd-tree, an accessor an array. On most devices each is bound; one that grows beyond what
// the device binds is read behind its address, and so are all of them then.
#ifndef KDRAY_SCENE
#define KDRAY_SCENE

#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require

#include "layout.glsl"

// The same for all kernels over one scene. By address the traversal loses up to 7 % of its speed on a large GPU, up to half on
// lavapipe: only scenes that could not be had otherwise are read so.
layout(constant_id = CONSTANT_BY_ADDRESS) const bool BY_ADDRESS = false;

// Triangles as three rows, nodes as one: a device then loads each at once.
layout(std430, set = 0, binding = BIND_TRIANGLES) readonly buffer TrianglesBlock { vec4 triangle_rows[]; };
layout(std430, set = 0, binding = BIND_TRIANGLE_MATERIALS) readonly buffer TriangleMaterialsBlock { uint triangle_materials[]; };
layout(std430, set = 0, binding = BIND_KD_NODES) readonly buffer KdNodesBlock { uvec2 kd_nodes[]; };
layout(std430, set = 0, binding = BIND_KD_PARENTS) readonly buffer KdParentsBlock { uint kd_parents[]; };
layout(std430, set = 0, binding = BIND_LEAF_TRIANGLES) readonly buffer LeafTrianglesBlock { uint leaf_triangles[]; };
layout(std430, set = 0, binding = BIND_LEAF_PLANES) readonly buffer LeafPlanesBlock { vec4 leaf_planes[]; };
layout(std430, set = 0, binding = BIND_KD_SLABS) readonly buffer KdSlabsBlock { vec4 kd_slabs[]; };
layout(std430, set = 0, binding = BIND_KD_BOXES) readonly buffer KdBoxesBlock { KdBox kd_boxes[]; };
layout(std430, set = 0, binding = BIND_KD_ROPES) readonly buffer KdRopesBlock { uint kd_ropes[]; };

layout(std140, set = 0, binding = BIND_ADDRESSES) uniform AddressesBlock { Addresses addresses; };
layout(std430, buffer_reference, buffer_reference_align = 16) readonly buffer Rows { vec4 at[]; };
layout(std430, buffer_reference, buffer_reference_align = 8) readonly buffer Pairs { uvec2 at[]; };
layout(std430, buffer_reference, buffer_reference_align = 4) readonly buffer Words { uint at[]; };
layout(std430, buffer_reference, buffer_reference_align = 8) readonly buffer Boxes { KdBox at[]; };

// Row 3 i + k: corner k of triangle i, and what its fourth word holds.
vec4 triangle_row(uint row_ix) {
    if (BY_ADDRESS) return Rows(addresses.triangles).at[row_ix];
    return triangle_rows[row_ix];
}

Triangle triangle_at(uint triangle_ix) {
    vec4 v0 = triangle_row(3u * triangle_ix);
    vec4 v1 = triangle_row(3u * triangle_ix + 1u);
    vec4 v2 = triangle_row(3u * triangle_ix + 2u);
    return Triangle(v0.xyz, floatBitsToUint(v0.w), v1.xyz, floatBitsToUint(v1.w), v2.xyz, floatBitsToUint(v2.w));
}

uint triangle_material_at(uint triangle_ix) {
    if (BY_ADDRESS) return Words(addresses.triangle_materials).at[triangle_ix];
    return triangle_materials[triangle_ix];
}

KdNode kd_node_of(uint node_ix) {
    uvec2 words;
    if (BY_ADDRESS) words = Pairs(addresses.kd_nodes).at[node_ix];
    else words = kd_nodes[node_ix];
    return KdNode(words.x, words.y);
}

uint kd_parent_of(uint node_ix) {
    if (BY_ADDRESS) return Words(addresses.kd_parents).at[node_ix >> 1];
    return kd_parents[node_ix >> 1];
}

uint leaf_triangle_at(uint entry_ix) {
    if (BY_ADDRESS) return Words(addresses.leaf_triangles).at[entry_ix];
    return leaf_triangles[entry_ix];
}

// A Plane as a vector: normal, distance.
vec4 leaf_plane_at(uint entry_ix) {
    if (BY_ADDRESS) return Rows(addresses.leaf_planes).at[entry_ix];
    return leaf_planes[entry_ix];
}

// A Slab as a vector: normal, offset.
vec4 kd_slab_of(uint node_ix) {
    if (BY_ADDRESS) return Rows(addresses.kd_slabs).at[node_ix];
    return kd_slabs[node_ix];
}

KdBox kd_box_of(uint node_ix) {
    if (BY_ADDRESS) return Boxes(addresses.kd_boxes).at[node_ix];
    return kd_boxes[node_ix];
}

// side: below and above on x, y, z. 0: the face is the root's.
uint kd_rope_of(uint node_ix, uint side) {
    if (BY_ADDRESS) return Words(addresses.kd_ropes).at[6u * node_ix + side];
    return kd_ropes[6u * node_ix + side];
}

#endif
