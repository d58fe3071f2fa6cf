#version 460
#extension GL_GOOGLE_include_directive : require
// Kd-tree, relocate: makes the indices in a finished tree those of arrays that hold several trees, one after the other.
// One workgroup per block of nodes or entries, whichever are more; an invocation changes one of each per row. Twin of
// src/buffers/two_level.rs.
// Reads build; updates nodes, parents, leaf_triangles.
#include "layout.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(push_constant) uniform PlaceBlock { StructurePlace place; };
layout(std430, set = 0, binding = BIND_KD_BUILD) readonly buffer BuildBlock { KdBuild build; };
layout(std430, set = 0, binding = BIND_KD_NODES) buffer NodesBlock { KdNode nodes[]; };
layout(std430, set = 0, binding = BIND_KD_PARENTS) buffer ParentsBlock { uint parents[]; };
// Three rows per entry, which make up a LeafTriangle.
layout(std430, set = 0, binding = BIND_KD_LEAF_TRIANGLES) buffer LeafTrianglesBlock { uvec4 leaf_triangles[]; };

void relocate_node(uint node_ix) {
    KdNode node = nodes[node_ix];
    if ((node.axis_and_child & KD_LEAF) != 0u) {
        node.split_or_first += place.first_entry;
    } else {
        node.axis_and_child += place.first_element / 2u << KD_PAIR_SHIFT;
    }
    nodes[node_ix] = node;
}

void main() {
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    uint begin = group * KD_BLOCK_SIZE + gl_LocalInvocationIndex;
    for (uint row = 0u; row < KD_ROWS; ++row) {
        uint i = begin + row * SCAN_GROUP_SIZE;
        if (i < 2u * build.n_pairs) relocate_node(i);
        if (i < build.n_pairs) parents[i] += place.first_element;
        if (i < build.n_entries) leaf_triangles[3u * i].w += place.first_row;
    }
}
