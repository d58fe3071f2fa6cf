// Triangles and their kd-tree, an accessor each. They are read by address: they grow with the scene, beyond what a
// descriptor reaches on some devices.
#ifndef KDRAY_SCENE
#define KDRAY_SCENE

#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require

#include "layout.glsl"

layout(std140, set = 0, binding = BIND_FRAME) uniform FrameBlock { Frame frame; };

// Whole rows with their alignment: a device then loads each at once.
layout(std430, buffer_reference, buffer_reference_align = 16) readonly buffer Rows { vec4 at[]; };
layout(std430, buffer_reference, buffer_reference_align = 8) readonly buffer Pairs { uvec2 at[]; };
layout(std430, buffer_reference, buffer_reference_align = 4) readonly buffer Words { uint at[]; };

// Corner i % 3 of triangle i / 3.
vec3 corner_at(uint corner_ix) {
    return Rows(frame.triangles).at[corner_ix].xyz;
}

Triangle triangle_at(uint triangle_ix) {
    Rows triangles = Rows(frame.triangles);
    vec4 v0 = triangles.at[3u * triangle_ix];
    vec4 v1 = triangles.at[3u * triangle_ix + 1u];
    vec4 v2 = triangles.at[3u * triangle_ix + 2u];
    return Triangle(v0.xyz, floatBitsToUint(v0.w), v1.xyz, floatBitsToUint(v1.w), v2.xyz, floatBitsToUint(v2.w));
}

uint triangle_material(uint triangle_ix) {
    return Words(frame.triangle_materials).at[triangle_ix];
}

KdNode kd_node_at(uint node_ix) {
    uvec2 words = Pairs(frame.kd_nodes).at[node_ix];
    return KdNode(words.x, words.y);
}

uint kd_parent(uint node_ix) {
    return Words(frame.kd_parents).at[node_ix >> 1];
}

// Entry i of all leaves.
uint leaf_triangle(uint i) {
    return Words(frame.leaf_triangles).at[i];
}

// A Plane: normal, distance.
vec4 leaf_plane(uint i) {
    return Rows(frame.leaf_planes).at[i];
}

KdBox kd_box(uint node_ix) {
    Pairs boxes = Pairs(frame.kd_boxes);
    vec2 a = uintBitsToFloat(boxes.at[3u * node_ix]);
    vec2 b = uintBitsToFloat(boxes.at[3u * node_ix + 1u]);
    vec2 c = uintBitsToFloat(boxes.at[3u * node_ix + 2u]);
    return KdBox(a.x, a.y, b.x, b.y, c.x, c.y);
}

// side: below and above on x, y, z. 0: the face is the root's.
uint kd_rope(uint node_ix, uint side) {
    return Words(frame.kd_ropes).at[6u * node_ix + side];
}

#endif
