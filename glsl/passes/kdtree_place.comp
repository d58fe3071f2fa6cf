#version 460
#extension GL_GOOGLE_include_directive : require
// Kd-tree, place: writes the nodes into the finished tree, in depth-first order: a pair, then all pairs below its first
// node, then those below its second. One workgroup per group of pairs. An invocation goes from its pair to the root and
// adds up what comes before.
// The invocation of the root's pair also writes what the computation of slabs needs to know of the tree.
// Reads build, built_nodes, built_parents, below; writes places, nodes, parents, tree.
#include "kdtree_build/kd_build.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_KD_BUILT_NODES) readonly buffer BuiltNodesBlock { KdNode built_nodes[]; };
layout(std430, set = 0, binding = BIND_KD_BUILT_PARENTS) readonly buffer BuiltParentsBlock { uint built_parents[]; };
layout(std430, set = 0, binding = BIND_KD_BELOW) readonly buffer BelowBlock { uvec2 below[]; };
layout(std430, set = 0, binding = BIND_KD_PLACES) writeonly buffer PlacesBlock { uvec2 places[]; };
layout(std430, set = 0, binding = BIND_KD_NODES) writeonly buffer NodesBlock { KdNode nodes[]; };
layout(std430, set = 0, binding = BIND_KD_PARENTS) writeonly buffer ParentsBlock { uint parents[]; };
layout(std430, set = 0, binding = BIND_KD_SLAB_TREE) writeonly buffer TreeBlock { KdSlabTree tree; };

// Writes a node. place: the pair of its children, if it has any, and its first entry.
void write_node(uint built_ix, uint node_ix, uvec2 place) {
    KdNode node = built_nodes[built_ix];
    if ((node.axis_and_child & KD_LEAF) != 0u) {
        node.split_or_first = place.y;
    } else {
        node.axis_and_child = place.x << KD_PAIR_SHIFT | (node.axis_and_child & KD_AXIS_MASK);
        parents[place.x] = node_ix;
    }
    nodes[node_ix] = node;
    places[built_ix] = place;
}

void write_tree() {
    tree.box_min = build.box_min;
    tree.n_nodes = 2u * build.n_pairs;
    tree.box_max = build.box_max;
    tree.n_entries = build.n_entries;
    tree.largest = build.largest;
    tree.margin = build.margin;
    tree.finest_scale = build.finest;
    tree.reserved = 0u;
}

// The index of a pair in the finished tree, and that of the first entry below it.
uvec2 place_of(uint pair_ix) {
    uvec2 place = uvec2(1u, 0u);
    for (uint node_ix = built_parents[pair_ix]; node_ix != 0u; node_ix = built_parents[node_ix >> 1]) {
        place.x += 1u;
        if ((node_ix & 1u) != 0u) place += below[node_ix - 1u];
    }
    return place;
}

void main() {
    uint built_ix = index_of_entry();
    if (built_ix >= build.n_pairs) return;
    if (built_ix == 0u) {
        write_node(0u, 0u, uvec2(1u, 0u));
        nodes[1] = KdNode(0u, KD_LEAF);
        parents[0] = 0u;
        write_tree();
        return;
    }
    uvec2 place = place_of(built_ix);
    uvec2 first = uvec2(place.x + 1u, place.y);
    write_node(2u * built_ix, 2u * place.x, first);
    write_node(2u * built_ix + 1u, 2u * place.x + 1u, first + below[2u * built_ix]);
}
