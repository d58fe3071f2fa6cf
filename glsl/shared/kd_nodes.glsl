// Nodes of the kd-tree and the cells that a ray goes through. A part of kdtree.glsl.

struct Cell {
    // The node's place in kd_nodes, in bytes: what a split names its children by.
    uint node_offset;
    float t_enter;
    float t_exit;
};

// The root.
Cell whole(TraversalRay ray) {
    return Cell(0u, ray.t_enter, ray.t_exit);
}

uint node_ix_of(uint node_offset) {
    return node_offset / KD_NODE_BYTES;
}

uint offset_of(uint node_ix) {
    return KD_NODE_BYTES * node_ix;
}

uint sibling_of(uint node_offset) {
    return node_offset ^ KD_NODE_BYTES;
}

KdNode kd_node(uint node_offset) {
    count_steps(1u);
    count_turn();
    return kd_node_at(node_ix_of(node_offset));
}

bool is_leaf(KdNode node) {
    return (node.axis_and_child & KD_LEAF) != 0u;
}

float along(vec3 v, uint axis) {
    return axis == 0u ? v.x : (axis == 1u ? v.y : v.z);
}

// Along a split's axis, whose two bits choose at once.
float along_split(vec3 v, KdNode node) {
    return (node.axis_and_child & 2u) != 0u ? v.z : ((node.axis_and_child & 1u) != 0u ? v.y : v.x);
}

// Where a split's plane meets its axis. A leaf's number of an entry, which lanes that wait hold in lockstep, is no number to
// compute with: it is denormal as a float, and lavapipe's kernels spent a sixth of their time on its products. Its mask is made of its bits, since a
// compiler takes away what asks for a leaf where a branch has asked before.
float plane_of(KdNode node) {
    const int LEAF_BIT = findMSB(KD_LEAF);
    uint bits = node.split_or_first;
    if (PREDICATES_BRANCHES) bits &= ~uint(bitfieldExtract(int(node.axis_and_child), LEAF_BIT, 1));
    return uintBitsToFloat(bits);
}

// Where the ray meets the split plane. `precise`: a traversal that comes the same way again must come to the same bits.
float crossing(TraversalRay ray, KdNode node) {
    precise float t = fma(plane_of(node), along_split(ray.inv_direction, node), along_split(ray.bias, node));
    return t;
}

// The child on the side that the ray comes from, or the other one.
uint child_of(TraversalRay ray, KdNode node, bool second) {
    bool is_above = (along_split(ray.inv_direction, node) < 0.0) != second;
    uint pair_at = node.axis_and_child & ~((1u << KD_PAIR_SHIFT) - 1u);
    return pair_at | (is_above ? KD_NODE_BYTES : 0u);
}

uint first_child(TraversalRay ray, KdNode node) {
    return child_of(ray, node, false);
}
