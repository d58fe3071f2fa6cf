#version 460
#extension GL_GOOGLE_include_directive : require
// Slabs of a kd-tree, 1 of 8: the only invocation sizes the dispatches over nodes and entries.
// Reads tree; writes build.
#include "kdtree/slab_build.glsl"

layout(local_size_x = 1) in;
layout(std430, set = 0, binding = BIND_KD_SLAB_BUILD) writeonly buffer BuildBlock { KdSlabBuild build; };

// Workgroups over n elements, in rows.
uvec3 groups_over(uint n) {
    uint n_groups = (n + SCAN_GROUP_SIZE - 1u) / SCAN_GROUP_SIZE;
    return uvec3(min(n_groups, GRID_GROUPS_X), (n_groups + GRID_GROUPS_X - 1u) / GRID_GROUPS_X, 1u);
}

void main() {
    uvec3 node_groups = groups_over(tree.n_nodes), entry_groups = groups_over(tree.n_entries);
    build.node_groups_x = node_groups.x;
    build.node_groups_y = node_groups.y;
    build.node_groups_z = node_groups.z;
    build.entry_groups_x = entry_groups.x;
    build.entry_groups_y = entry_groups.y;
    build.entry_groups_z = entry_groups.z;
    build.n_large = 0u;
}
